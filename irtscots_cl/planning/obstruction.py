"""Devices in each other's way: the screen before the camera, or in the light's path. Nothing is known of housings."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.screen_model import ScreenModel
from irtscots_cl.planning.finding import Finding
from irtscots_cl.planning.sight import Sight

LEAST = 0.002  # share of the rays that are blocked
SAME_MM = 1e-6  # in the screen's plane
NEAR = 2.0  # a camera further before the screen than 1 / NEAR of its distance from the mirror is no slip


def check_obstruction(sight: Sight) -> list[Finding]:
    """Findings about rays that the screen's own rectangle blocks, on their way from the mirror to the camera."""
    model, screen = ScreenModel.of(sight.scene.screen), sight.scene.screen
    camera = np.array(sight.scene.camera.position_mm)
    points = np.stack([sight.x_mm, sight.y_mm, sight.chief.surface.sag(sight.x_mm, sight.y_mm)], -1)
    half = [count * pitch / 2 for count, pitch in zip(screen.pixels, screen.pitch_xy_mm, strict=True)]
    blocked = _crosses(model.frame, points, camera, screen.centre_offset_mm, half)
    at = (camera - model.frame.position_mm) @ model.frame.axes.T
    over = all(abs(at[k] - screen.centre_offset_mm[k]) <= half[k] for k in (0, 1))
    if blocked.mean() > LEAST:
        text = f"the screen stands between the mirror and the camera: it hides {blocked.mean():.0%} of the mirror"
        return [
            Finding("screen-blocks-camera", "error", text + "; move one of them sideways, or the camera in front of it")
        ]
    if over and -float(np.linalg.norm(points.mean(0) - camera)) < NEAR * float(at[2]) <= SAME_MM:
        text = (
            f"the camera, {abs(at[2]):.3g} mm in front of the screen, stands before its pixels: what its housing hides "
        )
        return [Finding("camera-before-screen", "warning", text + "gives no light; move it beside the screen's edge")]
    return []


def _crosses(frame, points: FloatArray, camera: FloatArray, offset, half) -> np.ndarray:
    """Which of the straight ways [n] from points [n, 3] to the camera cross the rectangle of the screen."""
    start, end = (points - frame.position_mm) @ frame.axes.T, (camera - frame.position_mm) @ frame.axes.T
    depth = start[:, 2] - end[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = start[:, 2] / depth  # of the way, where it crosses the plane
        u = start[:, 0] + share * (end[0] - start[:, 0]) - offset[0]
        v = start[:, 1] + share * (end[1] - start[:, 1]) - offset[1]
        return (share > 0) & (share < 1) & (np.abs(u) <= half[0]) & (np.abs(v) <= half[1])
