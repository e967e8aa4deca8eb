"""The kernels' sources of rays: emitters of the screen, receivers of the detector."""

from __future__ import annotations

import numpy as np

from irtscots_cl.opencl.structs import PRECISIONS, WEIGHT_ONE, emitter_dtype, line_receiver_dtype, receiver_dtype
from irtscots_cl.optics.aim import pixel_centres
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.setup import Setup
from irtscots_cl.system.memory import check_memory

MIN_COSINE4 = 2.0**-6  # weights stay at or below WEIGHT_ONE times its inverse, 2^30


def receivers(chief: ChiefRays, visible_pixels: np.ndarray, origins: np.ndarray, precision: str) -> np.ndarray:
    """Adjoint sources [slots]: slots are flat detector pixel numbers, origins [slots, 2] the windows' (column, row)."""
    rows, columns = np.divmod(visible_pixels, chief.shape[1])
    out = np.zeros(len(visible_pixels), receiver_dtype(PRECISIONS[precision]))
    out["x"], out["y"] = chief.image_point(rows, columns)
    out["weight_scale"] = WEIGHT_ONE / cosine4(chief, visible_pixels)
    out["column"], out["row"] = origins.T
    out["pixel"] = visible_pixels
    return out


def line_receivers(setup: Setup, visible_pixels: np.ndarray, origins: np.ndarray, precision: str) -> np.ndarray:
    """Sources [slots] of the smoothed adjoint estimator: receivers and, from the pixels' maps, their chords.

    A pixel without a map (some of its rays miss the surface) gets chords of no length: its rays land as points.
    """
    chief, light = setup.chief_rays, setup.pixel_response
    real = PRECISIONS[precision]
    out = np.zeros(len(visible_pixels), line_receiver_dtype(real))
    out["start"] = receivers(chief, visible_pixels, origins, precision)
    index = np.searchsorted(light.pixels, visible_pixels)  # light is of all pixels that see the mirror
    radius, pitch = chief.scene.camera.aperture_diameter_mm / 2, chief.scene.screen.pitch_mm
    for k, output in enumerate("uv"):
        chord = light.chord(output)
        values = (*chord.normal, chord.slope / pitch / radius, chord.bend / pitch / radius**2, chord.growth / radius,
                  *(chord.mirror / radius))  # fmt: skip
        for name, value in zip(out["chords"].dtype.names, values, strict=True):
            out["chords"][name][:, k] = value[index]
    return out


def cosine4(chief: ChiefRays, visible_pixels: np.ndarray) -> np.ndarray:
    """cos^4 of the chief rays' object-side angle to the camera's axis at the pixels' centres [slots].

    At least LEAST_COSINE4: a pixel so wide that its centre is far off the axis and its edge near it would otherwise
    have rays whose weight, relative to the centre's, does not fit 31 bits.
    """
    x, y = chief.image_point(*np.divmod(visible_pixels, chief.shape[1]))
    distance = chief.scene.camera.image_distance_mm
    return np.maximum((1 + (x**2 + y**2) / distance**2) ** -2, MIN_COSINE4)


BYTES_PER_PIXEL = {"mirror": 140, "camera": 840}  # of the screen, while its aim is found; measured


def emitters(setup: Setup, precision: str, overfill: float, aim: str) -> tuple[np.ndarray, np.ndarray]:
    """Forward sources [rows * columns of the screen] and the area of their aim's ellipse in direction cosines [same].

    overfill: the ellipse's area over the least of the aim, which is one of options.AIMS. Raises ValueError if the
    screen has more pixels than the memory can hold aims of.
    """
    scene = setup.scene
    columns, rows = scene.screen.pixels
    check_memory(f"scene {scene.name}: screen.pixels = {[columns, rows]}", columns * rows * BYTES_PER_PIXEL[aim])
    chosen = (setup.camera_aim if aim == "camera" else setup.mirror_aim).overfilled(overfill)
    out = np.zeros(len(chosen.centre), emitter_dtype(PRECISIONS[precision]))
    out["x"], out["y"] = pixel_centres(setup.chief_rays)
    out["centre_l"], out["centre_m"] = chosen.centre.T
    out["aim_ll"], out["aim_ml"], out["aim_mm"] = chosen.root[:, 0, 0], chosen.root[:, 1, 0], chosen.root[:, 1, 1]
    return out, chosen.area
