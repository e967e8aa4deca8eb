"""The kernels' sources of rays: emitters of the screen, receivers of the detector."""

from __future__ import annotations

import numpy as np

from irtscots_cl.opencl.structs import (
    LINE_WEIGHT_ONE,
    PRECISIONS,
    WEIGHT_ONE,
    cones_emitter_dtype,
    emitter_dtype,
    line_receiver_dtype,
    receiver_dtype,
)
from irtscots_cl.optics.aim import Aim
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.elements.emission import Emission
from irtscots_cl.optics.pixel.aperture_chords import Chords
from irtscots_cl.optics.screen_facets import ScreenFacets, pixel_centres
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.memory import check_memory

MIN_COSINE4 = 2.0**-6  # weights stay at or below WEIGHT_ONE times its inverse, 2^30: cos^4 is at most 1


def receivers(chief: ChiefRays, visible_pixels: np.ndarray, origins: np.ndarray, precision: str) -> np.ndarray:
    """Adjoint sources [slots]: slots are flat detector pixel numbers, origins [slots, 2] the windows' (column, row).

    Warns and raises as screen_patches.fill_patches where the screen is bent.
    """
    rows, columns = np.divmod(visible_pixels, chief.shape[1])
    model, bent = chief.camera_model, chief.screen_model.surface is not None
    out = np.zeros(len(visible_pixels), receiver_dtype(PRECISIONS[precision], model.is_distorted, bent))
    if model.is_distorted:
        from irtscots_cl.tracing.packing.image_maps import fill_images, image_maps  # imported late: few lenses distort

        fill_images(out, image_maps(model, rows, columns))
    else:
        out["x"], out["y"] = model.image_point(rows, columns)
    if bent:
        from irtscots_cl.tracing.packing.screen_patches import fill_patches  # imported late: few screens are bent

        fill_patches(out, chief, visible_pixels, precision)
    out["weight_scale"] = WEIGHT_ONE / relative_flux(chief, visible_pixels)
    out["column"], out["row"] = origins.T
    out["pixel"] = visible_pixels
    return out


def line_receivers(setup: Setup, visible_pixels: np.ndarray, origins: np.ndarray, precision: str) -> np.ndarray:
    """Sources [slots] of the smoothed adjoint estimator: receivers and their chords.

    A pixel some of whose rays miss the surface gets chords of no length: its rays land as points.
    """
    chief, real = setup.chief_rays, PRECISIONS[precision]
    bent = chief.screen_model.surface is not None
    out = np.zeros(len(visible_pixels), line_receiver_dtype(real, chief.camera_model.is_distorted, bent))
    out["start"] = receivers(chief, visible_pixels, origins, precision)
    out["start"]["weight_scale"] *= LINE_WEIGHT_ONE / WEIGHT_ONE
    chords, pitch = Chords.of(chief, visible_pixels), np.array(chief.scene.screen.pitch_xy_mm)
    radius = chief.scene.camera.aperture_diameter_mm / 2
    values = (*chords.normal, chords.slope / pitch / radius, chords.bend / pitch / radius**2, chords.growth / radius,
              *(chords.mirror / radius))  # fmt: skip
    for name, value in zip(out["chords"].dtype.names, values, strict=True):
        out["chords"][name] = value
    out["cut"] = ~chief.clear_of_edges.flat[visible_pixels]
    return out


def relative_flux(chief: ChiefRays, visible_pixels: np.ndarray) -> np.ndarray:
    """Flux of the pixels' centres over that of the plain camera on its axis [slots]: cos^4 of the chief ray's
    object-side angle, times the area that a lens with distortion makes of a pixel.

    At least MIN_COSINE4 of the largest that any ray of the pixel may have: a pixel so wide that its centre is far off
    the axis and its edge near it would otherwise have rays whose weight, relative to the centre's, does not fit 31
    bits.
    """
    rows, columns = np.divmod(visible_pixels, chief.shape[1])
    x, y = chief.camera_model.image_point(rows, columns)
    distance = chief.scene.camera.image_distance_mm
    cosine4 = (1 + (x**2 + y**2) / distance**2) ** -2
    if not chief.camera_model.is_distorted:
        return np.maximum(cosine4, MIN_COSINE4)
    from irtscots_cl.tracing.packing.image_maps import image_maps, stretches

    middle, most = stretches(chief.camera_model, image_maps(chief.camera_model, rows, columns))
    return np.maximum(cosine4 * middle, MIN_COSINE4 * most)


BYTES_PER_PIXEL = {"mirror": 140, "camera": 840}  # of the screen, while its aim is found; measured
BYTES_PER_FACET = 1200  # more for a pixel of a bent screen
BYTES_PER_CONE = 400  # more for each further cone


def emitters(setup: Setup, precision: str, overfill: float, aim: str) -> tuple[np.ndarray, np.ndarray]:
    """Forward sources [rows * columns of the screen] and the area of their aim's ellipse in direction cosines [same].

    Of a bent screen the areas are multiplied by the pixels' own area over that on the grid.

    overfill: the ellipse's area over the least of the aim, which is one of options.AIMS. Raises ValueError if the
    screen has more pixels than the memory can hold aims of.
    """
    chief, bent = setup.chief_rays, setup.chief_rays.screen_model.surface is not None
    check_screen_memory(setup.scene, BYTES_PER_PIXEL[aim] + BYTES_PER_FACET * bent)
    chosen = (setup.camera_aim if aim == "camera" else setup.mirror_aim).overfilled(overfill)
    if not bent:
        return _emitters(setup, chosen, emitter_dtype(PRECISIONS[precision])), chosen.area
    structs, area = _facet_emitters(chief, chosen, PRECISIONS[precision])
    return structs, chosen.area * (area / setup.scene.screen.pixel_area_mm2)


def _facet_emitters(chief: ChiefRays, aim: Aim, real) -> tuple[np.ndarray, np.ndarray]:
    """Sources of a bent screen, and areas [mm^2] of its pixels: as the mirror's vertex sees them, over the cosine."""
    out, facets = np.zeros(len(aim.centre), emitter_dtype(real, True)), ScreenFacets.of(chief)
    to_vertex = facets.from_pixels(np.zeros((1, 3)))[:, 0]
    side_u, side_v = facets.seen_sides(to_vertex / np.linalg.norm(to_vertex, axis=-1, keepdims=True))
    _fill_aim(out, aim)
    for name, values in (("point", facets.points), ("pixel_x", side_u), ("pixel_y", side_v),
                         *((f"axis_{axis}", facets.axes[:, k]) for k, axis in enumerate("xyz"))):  # fmt: skip
        out["facet"][name] = values
    projected = np.sum(np.cross(side_u, side_v) * to_vertex, -1)
    return out, projected / np.sum(facets.axes[:, 2] * to_vertex, -1)


def cone_emitters(setup: Setup, precision: str, emission: Emission) -> np.ndarray:
    """Sources [rows * columns of the screen] whose rays go into the cones of an emission: Emitters for one cone.

    Raises ValueError as emitters does.
    """
    real, count = PRECISIONS[precision], len(emission.cones)
    if count == 1:
        return _emitters(setup, emission.cones[0], emitter_dtype(real))
    check_screen_memory(setup.scene, BYTES_PER_PIXEL["mirror"] + BYTES_PER_CONE * count)
    out = _emitters(setup, emission.cones[0], cones_emitter_dtype(real, count))
    for k, (cone, share) in enumerate(zip(emission.cones, cone_shares(emission), strict=True)):
        _fill_aim(out["cones"][:, k], cone)
        out["cones"]["density"][:, k] = share * np.pi / cone.area
    return out


def cone_shares(emission: Emission) -> np.ndarray:
    """Shares [cones] of the rays: the emission's, in steps of 2^-32."""
    return np.diff([0, *cone_starts(emission), 2**32]) / 2.0**32


def cone_starts(emission: Emission) -> np.ndarray:
    """The least 32-bit number [cones - 1] of the rays of each cone but the first."""
    return np.rint(np.cumsum(emission.shares)[:-1] * 2.0**32).astype(np.int64)


def check_screen_memory(scene: Scene, bytes_per_pixel: int = BYTES_PER_PIXEL["mirror"]) -> None:
    """Raise ValueError if the memory cannot hold the aims of so many screen pixels."""
    columns, rows = scene.screen.pixels
    check_memory(f"scene {scene.name}: screen.pixels = {[columns, rows]}", columns * rows * bytes_per_pixel)


def _emitters(setup: Setup, aim: Aim, dtype: np.dtype) -> np.ndarray:
    out = np.zeros(len(aim.centre), dtype)
    out["x"], out["y"] = pixel_centres(setup.chief_rays)
    _fill_aim(out, aim)
    return out


def _fill_aim(out: np.ndarray, aim: Aim) -> None:
    out["centre_l"], out["centre_m"] = aim.centre.T
    out["aim_ll"], out["aim_ml"], out["aim_mm"] = aim.root[:, 0, 0], aim.root[:, 1, 0], aim.root[:, 1, 1]
