"""What the camera sees of the mirror: how much of it, how large, how sharp."""

from __future__ import annotations

import math

import numpy as np

from irtscots_cl.planning.finding import Finding
from irtscots_cl.planning.sight import Sight

SEEN, FEW = 0.98, 0.6  # share of the mirror on the detector: below, part of it is not measured; below, most
SMALL_IMAGE = 0.2  # of the detector's smaller side
FEW_PIXELS = 40  # across the mirror
BLUR_PX = 3.0  # diameter of the blur at the mirror
DETAIL_PX = 4.0  # pixels for each period of a ripple that is to be measured


def check_view(sight: Sight, detail_mm: float | None = None) -> list[Finding]:
    """Findings about the camera's picture of the mirror. detail_mm: shortest period of ripples that is wanted."""
    found = []
    columns, rows = sight.scene.camera.detector.pixels
    share, (wide, high) = float(sight.detected.mean()), sight.image_px
    if math.isnan(wide):
        return [Finding("mirror-not-seen", "error", "camera: the whole mirror is behind it; must look at the mirror")]
    image = f"the mirror's image is {wide:.0f} x {high:.0f} pixels on a detector of {columns} x {rows}"
    if share < SEEN:
        found.append(_overfilled(sight, share, image))
    elif max(wide / columns, high / rows) < SMALL_IMAGE or max(wide, high) < FEW_PIXELS:
        longer = 0.9 * sight.scene.camera.focal_length_mm / max(wide / columns, high / rows)
        text = f"{image}: a focal length of {longer:.3g} mm would fill it"
        found.append(Finding("mirror-small", "warning", text))
    found += _blurred(sight)
    if detail_mm is not None:
        pitch = _pixel_on_mirror_mm(sight)
        if detail_mm < DETAIL_PX * pitch:
            text = (
                f"a pixel is {pitch:.3g} mm of the mirror: ripples of {detail_mm:g} mm need {DETAIL_PX:.0f} pixels a "
            )
            text += f"period, of {detail_mm / DETAIL_PX:.3g} mm"
            found.append(Finding("pixels-coarse", "warning", text))
    return found


def _overfilled(sight: Sight, share: float, image: str) -> Finding:
    """The mirror is cut off: what would show it all."""
    columns, rows = sight.scene.camera.detector.pixels
    need_x, need_y = 2 * _reach(sight.column, columns), 2 * _reach(sight.row, rows)
    shorter = 0.95 * sight.scene.camera.focal_length_mm * min(columns / need_x, rows / need_y)
    text = f"{share:.0%} of the mirror is on the detector ({image}): needs {math.ceil(need_x)} x {math.ceil(need_y)} "
    text += f"pixels, or a focal length of {shorter:.3g} mm, or the camera turned towards the mirror"
    return Finding("mirror-cut-off", "error" if share < FEW else "warning", text)


def _reach(values: np.ndarray, count: int) -> float:
    """Largest distance from the middle of the detector, in pixels, with half a pixel."""
    return float(np.nanmax(np.abs(values - (count - 1) / 2))) + 0.5


def _blurred(sight: Sight) -> list[Finding]:
    """The camera's focus is not on the mirror: the aperture's blur in its picture of it."""
    camera = sight.scene.camera
    centre = np.array([0.0, 0.0, 0.0])
    distance = float(np.linalg.norm(np.subtract(camera.position_mm, centre)))
    blur_mm = camera.aperture_diameter_mm * abs(camera.focus_mm - distance) / camera.focus_mm
    blur_px = blur_mm / _pixel_on_mirror_mm(sight)
    if blur_px <= BLUR_PX:
        return []
    text = f"the lens is in focus at {camera.focus_mm:.6g} mm, the mirror is {distance:.6g} mm away: a point of it is "
    text += f"blurred over {blur_mm:.3g} mm, {blur_px:.1f} pixels; camera.focus_distance_mm should be {distance:.6g}"
    return [Finding("camera-defocused", "warning", text)]


def _pixel_on_mirror_mm(sight: Sight) -> float:
    """Size of a detector pixel's picture on the mirror, in mm."""
    wide, high = sight.image_px
    size_x, size_y = np.ptp(sight.x_mm), np.ptp(sight.y_mm)
    return float(max(size_x / wide, size_y / high)) if wide > 0 and high > 0 else math.nan
