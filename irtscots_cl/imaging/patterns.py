"""Patterns on the screen. Light is additive, so each pattern is a product with the transport map: no new rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.model import Scene


@dataclass(frozen=True)
class LineScan:
    """Single lines of screen pixels: one column at a time (x scan), then one row at a time (y scan).

    brightness: [rows, columns] of the screen, factor on the radiance of every screen pixel; None: all 1.
    """

    scene: Scene
    brightness: FloatArray | None = None

    def __post_init__(self) -> None:
        columns, rows = self.scene.screen.pixels
        if self.brightness is None:
            return
        if np.shape(self.brightness) != (rows, columns):
            raise ValueError(f"brightness has shape {np.shape(self.brightness)}, must be {(rows, columns)}: the screen")
        if not (np.isfinite(self.brightness).all() and np.min(self.brightness) >= 0):
            raise ValueError("brightness must be finite and not negative")

    def positions_mm(self, axis: str) -> FloatArray:
        """Centres [lines] of the lines of the "x" or "y" scan in the screen's own x or y."""
        k = "xy".index(axis)
        screen = self.scene.screen
        count = screen.pixels[k]
        return (np.arange(count, dtype=float) - (count - 1) / 2) * screen.pitch_xy_mm[k] + screen.centre_offset_mm[k]
