"""A scene's numbers as the kernels' structures: which files they need and what goes into every field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.maths.zernike.series import PowerRows, RadialSeries, power_rows
from irtscots_cl.opencl.structs import (
    LAUNCH,
    PRECISIONS,
    chord_dtype,
    emitter_dtype,
    facet_dtype,
    frame_dtype,
    image_dtype,
    lens_dtype,
    line_receiver_dtype,
    mirror_dtype,
    patch_dtype,
    receiver_dtype,
    scene_dtype,
    zernike_clenshaw_dtype,
    zernike_power_dtype,
    zernike_term_dtype,
)
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.surface import Surface

MAX_POWER_LOSS = 100.0  # sums of powers that lose more than two digits leave the deviation to Clenshaw's recurrence
MAX_NEWTON_STEPS = 8  # more than any deviation needs that is still a mirror's
NEWTON_SLOPE = {"fp32": 1e-9, "fp64": 1e-13}  # rad, left by the last step; fp32's own rounding is 1e-8
EDGE_POINTS = 65  # along each side of the image, where its largest radius is looked for
BEYOND_EDGE = 1e-3  # of the square of that radius: room for the points between
SLIGHT_SLOPE = 1e-6  # 100 steps of a single-precision slope: larger ones are lost by less than 1e-3 on average


@dataclass(frozen=True)
class Packed:
    """A scene ready for the kernels: file choices, C structures and constants, and the scene structure itself."""

    choices: dict[str, str]
    structs: dict[str, np.dtype]
    constants: dict[str, tuple[int, ...]]
    scene: np.ndarray  # [1]


def pack(chief: ChiefRays, precision: str) -> Packed:
    """Everything about a scene that does not depend on the estimator."""
    real, surface = PRECISIONS[precision], chief.surface
    deviation = surface.deviation
    annular = surface.obscuration_radius_mm > 0
    mirror = mirror_dtype(real, deviation is not None, annular)
    distorted, bent = chief.camera_model.is_distorted, chief.screen_model.surface is not None
    structs = {
        "Launch": LAUNCH,
        **({"Facet": facet_dtype(real), "Patch": patch_dtype(real)} if bent else {}),
        **({"Image": image_dtype(real), "Lens": lens_dtype(real)} if distorted else {}),
        "Emitter": emitter_dtype(real, bent),
        "Receiver": receiver_dtype(real, distorted, bent),
        "Chord": chord_dtype(real),
        "LineReceiver": line_receiver_dtype(real, distorted, bent),
        "Frame": frame_dtype(real),
        "Mirror": mirror,
    }
    zernike, tables, choices, constants = None, None, {}, {}
    if deviation is not None:
        rows = power_rows(deviation)
        few = rows.loss <= MAX_POWER_LOSS
        tables, declared, constants = _zernike_power(rows, real) if few else _zernike_clenshaw(deviation, real)
        tables["inverse_radius"] = 1 / surface.deviation_radius_mm
        zernike = tables.dtype
        choices["zernike"] = "power" if few else "clenshaw"
        structs |= declared | {"Zernike": zernike}
    glass = chief.screen_model.glass
    structs["Scene"] = scene_dtype(real, mirror, zernike, structs.get("Lens"), glass is not None)
    scene = np.zeros(1, structs["Scene"])
    _fill_mirror(scene["mirror"][0:1], surface)
    if deviation is not None:
        scene["mirror"]["newton_steps"] = newton_steps(chief, NEWTON_SLOPE[precision])
    _fill_frame(scene["screen"], chief.screen_frame)
    _fill_frame(scene["camera"], chief.camera_frame)
    _fill_devices(scene, chief)
    if tables is not None:
        scene["zernike"] = tables
    if distorted:
        _fill_lens(scene["lens"], chief)
        choices["lens"] = "rational" if any(chief.camera_model.distortion[5:]) else "polynomial"
    if glass is not None:
        scene["glass_thickness"], scene["glass_index2"] = glass.thickness_mm, glass.index**2
    choices |= {
        "surface": _surface_file(chief.scene.mirror),
        "mirror": "deviated" if deviation is not None else "nominal",
        "arrival": "compensated" if _is_slight(surface, precision) else "plain",
        "aperture": "annulus" if annular else "disk",
        "frame": "turned" if chief.screen_frame.axes[0, 1] or chief.camera_frame.axes[0, 1] else "upright",
        "camera": "distorted" if distorted else "plain",
        "screen": "bent" if bent else "flat",
        "glass": "none" if glass is None else "plate",
    }
    return Packed(choices, structs, constants, scene)


def _surface_file(mirror) -> str:
    if mirror.is_flat:
        return "flat"
    if mirror.conic == 0:
        return "sphere"  # also off axis: every point of a sphere is a vertex
    return "off_axis" if mirror.off_axis_mm != 0 else "conic"


def _fill_mirror(out: np.ndarray, surface: Surface) -> None:
    for name in ("q_xx", "q_yy", "q_zz", "q_xz"):
        out[name] = getattr(surface.quadric, name)
    out["aperture_radius2"] = surface.aperture_radius_mm**2
    if surface.obscuration_radius_mm > 0:
        out["obscuration_radius2"] = surface.obscuration_radius_mm**2


def _spread(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Points (x, y) [n] over a deviated mirror, close enough to find its deviation's extremes; many on the rim."""
    radius = surface.aperture_radius_mm * np.sqrt((np.arange(16) + 1) / 16)
    angles = 2 * int(surface.deviation.m.max()) + 16
    angle = np.arange(angles) * (2 * np.pi / angles)
    return np.outer(radius, np.cos(angle)).ravel(), np.outer(radius, np.sin(angle)).ravel()


def _is_slight(surface: Surface, precision: str) -> bool:
    """Whether single precision would lose the deviation's slopes in the sum with the design's."""
    if surface.deviation is None or precision != "fp32":
        return False
    return max(np.abs(slope).max() for slope in surface.deviation_at(*_spread(surface))[1:]) < SLIGHT_SLOPE


def newton_steps(chief: ChiefRays, slope: float) -> int:
    """Steps from the design surface to the deviated one that leave at most that slope error [rad], found by trial.

    The kernel takes the deviation's slopes before its last move, so k steps have the slopes of k - 1 moves.
    """
    surface = chief.surface
    x, y = _spread(surface)
    points = np.stack([x, y, surface.quadric.meet(x, y, 0.0, 0.0)], -1)
    left = np.zeros(MAX_NEWTON_STEPS - 1)
    for frame in (chief.camera_frame, chief.screen_frame):
        met = [surface.meet(points, points - frame.position_mm, moves)[0] for moves in range(MAX_NEWTON_STEPS)]
        slopes = [np.stack(surface.deviation_at(at[:, 0], at[:, 1])[1:]) for at in met]
        left = np.maximum(left, [np.nanmax(np.abs(found - slopes[-1])) for found in slopes[:-1]])
    enough = np.flatnonzero(left <= slope)
    return int(enough[0]) + 1 if len(enough) else MAX_NEWTON_STEPS


def _fill_frame(out: np.ndarray, frame: Frame) -> None:
    out["position"] = frame.position_mm
    for name, axis in zip(("axis_x", "axis_y", "axis_z"), frame.axes, strict=True):
        out[name] = axis
    out["offset"] = -frame.axes @ frame.position_mm


def _fill_devices(out: np.ndarray, chief: ChiefRays) -> None:
    screen, camera, model = chief.scene.screen, chief.scene.camera, chief.camera_model
    pitch, of_pixels = np.array(screen.pitch_xy_mm), np.array(model.pitch_mm)
    shift = np.array(model.shift) * model.image_distance_mm  # from an image point seen from the aperture's centre
    centre = np.array(model.centre[::-1]) if model.is_distorted else model.centre[::-1] + shift / of_pixels
    values = {
        "screen_pitch": pitch,
        "inverse_screen_pitch": 1 / pitch,
        "detector_pitch": of_pixels,
        "inverse_detector_pitch": 1 / of_pixels,
    }
    pairs = {f"{name}_{axis}": value for name, both in values.items() for axis, value in zip("xy", both, strict=True)}
    pairs["screen_left"], pairs["screen_top"] = np.array(screen.pixels) / 2 - np.array(screen.centre_offset_mm) / pitch
    pairs["detector_left"], pairs["detector_top"] = centre + 0.5
    for name, value in {
        "aperture_radius": camera.aperture_diameter_mm / 2,
        "aperture_radius2": (camera.aperture_diameter_mm / 2) ** 2,
        "inverse_focal_length": 1 / camera.focal_length_mm,
        "inverse_focus": 1 / camera.focus_mm,
        "image_distance": camera.image_distance_mm,
        "inverse_image_distance": 1 / camera.image_distance_mm,
        "detector_columns": camera.detector.pixels[0],
        "detector_rows": camera.detector.pixels[1],
        **pairs,
    }.items():
        out[name] = value


def _fill_lens(out: np.ndarray, chief: ChiefRays) -> None:
    model, (rows, columns) = chief.camera_model, chief.shape
    k1, k2, p1, p2, k3, k4, k5, k6 = model.distortion
    edge = np.linspace(-0.5, 0.5, EDGE_POINTS)
    across, down = (columns - 1) / 2 + edge * columns, (rows - 1) / 2 + edge * rows
    on_edge = [(down, -0.5), (down, columns - 0.5), (-0.5, across), (rows - 0.5, across)]
    points = [np.array(model.image_point(*at)) / model.image_distance_mm for at in on_edge]
    radius2 = [np.sum((point + np.array(model.shift)[:, None]) ** 2, 0) for point in points]
    focal = model.image_distance_mm / np.array(model.pitch_mm)
    for name, value in {
        "above": (k1 - k4, k2 - k5, k3 - k6),
        "below": (k4, k5, k6),
        "p1": p1,
        "p2": p2,
        "focal_x": focal[0],
        "focal_y": focal[1],
        "shift_x": model.shift[0],
        "shift_y": model.shift[1],
        "most2": np.nanmax(radius2) * (1 + BEYOND_EDGE),
        "inverse_pixel_area": 1 / model.pixel_area_mm2,
    }.items():
        out[name] = value


def _zernike_power(rows: PowerRows, real):
    """Tables [()], structures that they contain, and constants for kernels/mirror/zernike_power.cl."""
    out = np.zeros((), zernike_power_dtype(real, len(rows.coefficient)))
    out["coefficient"] = rows.coefficient
    return out, {}, {f"zernike_{name}": tuple(getattr(rows, name)) for name in ("order", "sine", "count")}


def _zernike_clenshaw(series: RadialSeries, real):
    """Tables [()], structures that they contain, and constants for kernels/mirror/zernike_clenshaw.cl."""
    out = np.zeros((), zernike_clenshaw_dtype(real, len(series.m), len(series.cosine)))
    for name in ("cosine", "sine", "alpha", "beta"):
        out["term"][name] = getattr(series, name)
    # the next term's gamma; at the end of a series it multiplies zero
    out["term"]["gamma_next"] = np.append(series.gamma[1:], 0.0)
    out["order"], out["count"], out["series_count"] = series.m, series.count, len(series.m)
    return out, {"ZernikeTerm": zernike_term_dtype(real)}, {}
