"""A grid of dots on the screen, as bright disks on black, in several frames that are shifted against each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.shown_frames import DOTS, ShownFrame
from irtscots_cl.maths.arrays import FloatArray

SAMPLES = 8  # along a pixel: parts of it that a dot covers
MAX_SHIFTS = 32


@dataclass(frozen=True)
class DotGrid:
    """Dots pitch_px apart along x and y in shifts x shifts frames; one dot of the first is at the screen's middle.

    Raises ValueError for dots that touch or do not fit.
    """

    pitch_px: float
    diameter_px: float
    shifts: int = 1

    def __post_init__(self) -> None:
        if not 0 < self.diameter_px < self.pitch_px < 1e6:
            raise ValueError(
                f"dots: diameter {self.diameter_px:g}, pitch {self.pitch_px:g} pixels: must be above 0, and the "
                "diameter below the pitch"
            )
        if not 1 <= self.shifts <= MAX_SHIFTS:
            raise ValueError(f"dots: shifts = {self.shifts}: must be from 1 to {MAX_SHIFTS}")

    def series(self, pixels: tuple[int, int]) -> list[ShownFrame]:
        """The frames of a screen of (columns, rows)."""
        step = self.pitch_px / self.shifts
        return [
            ShownFrame(
                DOTS,
                first_px=(self._first(pixels[0], i * step), self._first(pixels[1], j * step)),
                pitch_px=self.pitch_px,
                diameter_px=self.diameter_px,
            )
            for j in range(self.shifts)
            for i in range(self.shifts)
        ]

    def _first(self, pixels: int, shift: float) -> float:
        """Centre of the first dot that lies wholly on the screen."""
        least = self.diameter_px / 2
        first = pixels / 2 + shift
        return round(first - math.floor((first - least) / self.pitch_px) * self.pitch_px, 6)


def dot_centres(frame: ShownFrame, pixels: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Centres along x [columns of dots] and along y [rows of dots] of a frame's dots that lie wholly on the screen, in
    pixels from the screen's -x and -y edge."""
    x, y = (
        float(first)
        + frame.pitch_px * np.arange(max(math.floor((n - frame.diameter_px / 2 - first) / frame.pitch_px) + 1, 0))
        for first, n in zip(frame.first_px, pixels, strict=True)
    )
    return np.asarray(x, float), np.asarray(y, float)


def dot_values(frame: ShownFrame, pixels: tuple[int, int]) -> FloatArray:
    """What the screen's pixels [rows, columns] show, from 0 to 1: the part of each that is covered by a dot."""
    grid = np.zeros((pixels[1], pixels[0]))
    reach = math.ceil(frame.diameter_px / 2) + 1
    fine = (np.arange(2 * reach * SAMPLES) + 0.5) / SAMPLES
    xs, ys = dot_centres(frame, pixels)
    for y in ys:
        for x in xs:
            left, low = math.floor(x) - reach, math.floor(y) - reach
            inside = (fine + left - x) ** 2 + (fine[:, None] + low - y) ** 2 <= (frame.diameter_px / 2) ** 2
            part = inside.reshape(2 * reach, SAMPLES, 2 * reach, SAMPLES).mean((1, 3))
            rows, columns = np.arange(low, low + 2 * reach), np.arange(left, left + 2 * reach)
            on = (rows >= 0) & (rows < pixels[1]), (columns >= 0) & (columns < pixels[0])
            grid[np.ix_(rows[on[0]], columns[on[1]])] += part[np.ix_(on[0], on[1])]
    return np.clip(grid, 0.0, 1.0)
