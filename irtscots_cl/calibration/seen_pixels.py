"""The pixels of a design on which its unknowns are judged: those whose chief rays go by way of mirror and screen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.optics.chief_rays import check_visible
from irtscots_cl.optics.setup import Setup

MOST_PER_AXIS = 160  # pixels: the effects are smooth, so that every second or third pixel of a large detector will do
FEWEST = 100  # pixels, for maps of low orders


@dataclass(frozen=True)
class SeenPixels:
    """A grid of every ``step``-th pixel's centre. row, column [rows], [columns] of the detector's upright grid.

    x_mm, y_mm [rows, columns]: mirror points. mask: those on the mirror whose chief ray meets the screen's pixels.
    """

    step: int
    row: FloatArray
    column: FloatArray
    x_mm: FloatArray = field(repr=False)
    y_mm: FloatArray = field(repr=False)
    mask: BoolArray = field(repr=False)

    @property
    def pixels(self) -> tuple[FloatArray, FloatArray]:
        """(row, column), each [n], of the pixels in the mask."""
        row, column = np.meshgrid(self.row, self.column, indexing="ij")
        return row[self.mask], column[self.mask]

    def on_grid(self, values: FloatArray) -> FloatArray:
        """Maps [..., rows, columns] of values [..., n] of the pixels in the mask; NaN outside."""
        maps = np.full((*values.shape[:-1], *self.mask.shape), np.nan)
        maps[..., self.mask] = values
        return maps


def seen_pixels(setup: Setup, most_per_axis: int = MOST_PER_AXIS) -> SeenPixels:
    """The pixels of a set-up. Raises SceneError if it sees no mirror or screen, ValueError if it sees too little."""
    chief = setup.chief_rays
    step = -(-max(chief.shape) // most_per_axis)
    row, column = (np.arange((n - 1) % step // 2, n, step, dtype=float) for n in chief.shape)
    points, u, v = chief.reverse(*np.meshgrid(row, column, indexing="ij"))
    mask = sees(setup, points, u, v)
    if np.count_nonzero(mask) < FEWEST:
        check_visible(chief, setup.scene.name)
        raise ValueError(
            f"scene {setup.scene.name}: camera.detector.pixels = {list(setup.scene.camera.detector.pixels)}: the chief "
            f"rays of {np.count_nonzero(mask)} of {mask.size} pixels go by way of the mirror to the screen's pixels; "
            f"must be at least {FEWEST}, for maps of the mirror"
        )
    return SeenPixels(step, row, column, points[..., 0], points[..., 1], mask)


def sees(setup: Setup, points: FloatArray, u: FloatArray, v: FloatArray) -> BoolArray:
    """Whether chief rays that meet the mirror's surface at points [..., 3] and the screen at (u, v) in mm [...] meet
    the mirror itself and the screen's pixels."""
    with np.errstate(invalid="ignore"):
        found: BoolArray = setup.chief_rays.surface.contains(points[..., 0], points[..., 1]) & on_screen(setup, u, v)
    return found


def on_screen(setup: Setup, u: FloatArray, v: FloatArray) -> BoolArray:
    """Whether places (u, v) in mm lie on the screen's grid of pixels."""
    screen = setup.scene.screen
    inside = np.ones(np.shape(u), bool)
    for place, offset, pitch, count in zip((u, v), screen.centre_offset_mm, screen.pitch_xy_mm, screen.pixels,
                                           strict=True):  # fmt: skip
        inside &= np.abs(place - offset) <= pitch * count / 2
    return inside
