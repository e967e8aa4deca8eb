"""Patterns on the screen. Light is additive, so each pattern is a product with the transport map: no new rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption


@dataclass(frozen=True)
class LineScan:
    """Lines of screen pixels: columns one after the other (x scan), then rows (y scan).

    Each line is one pixel wide and next to the one before it, unless the screen's table of lines says otherwise.
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
        screen, lines = self.scene.screen, self.scene.screen.lines
        count = screen.pixels[k]
        if lines is None:
            number = np.arange(count, dtype=float)
        else:
            number = lines.first_px + (lines.width_px - 1) / 2 + lines.step_px * np.arange(lines.count(count))
        return (number - (count - 1) / 2) * screen.pitch_xy_mm[k] + screen.centre_offset_mm[k]

    def spacing_mm(self, axis: str) -> float:
        """Distance of the lines' centres."""
        lines = self.scene.screen.lines
        return self.scene.screen.pitch_xy_mm["xy".index(axis)] * (1 if lines is None else lines.step_px)

    @property
    def line_width(self) -> float:
        """Width of a line over the lines' distance: below 1 there are gaps, above 1 lines overlap."""
        lines = self.scene.screen.lines
        return 1.0 if lines is None else lines.width_px / lines.step_px

    def joined(self, axis: str, flux_w: FloatArray, origins: IntArray) -> tuple[FloatArray, IntArray]:
        """Light curves [replicates, n, window] of the lines, and their first lines [n].

        flux_w: [replicates, n, window] of single columns or rows, from the origins [n] on.
        """
        lines = self.scene.screen.lines
        if lines is None:
            return flux_w, origins.astype(np.int64)
        window, count = flux_w.shape[-1], lines.count(self.scene.screen.pixels["xy".index(axis)])
        most = min(-(-(window + lines.width_px - 1) // lines.step_px), count)
        first = -((lines.first_px + lines.width_px - 1 - origins.astype(np.int64)) // lines.step_px)
        first = np.clip(first, 0, count - most)
        start = lines.first_px + lines.step_px * (first[:, None] + np.arange(most)) - origins[:, None]
        joined = np.zeros((*flux_w.shape[:-1], most))
        for offset in range(lines.width_px):
            interruption.check()
            at = start + offset
            lit = np.take_along_axis(flux_w, np.clip(at, 0, window - 1)[None], -1)
            joined += np.where((at >= 0) & (at < window), lit, 0.0)
        return joined, first
