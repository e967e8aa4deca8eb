"""The mark of every map on the detector or the mirror: an arrow to the mirror's +x, and from where it is seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WORDS = "seen from the camera"
SIZE = 6.5  # of the letters, in points
LENGTH = 26  # of the arrow, in points
FROM = (0.03, 0.03)  # the corner that a round mirror leaves free, in parts of the axes
MISPLACED = 0.01  # of a map's width: a camera that looks at a slant sees equal steps in mm as unequal ones
UPRIGHT = 0.999  # cosine of the angle between the mirror's x and the detector's columns: 2.6 degrees


def mark_x(axes: Axes, towards: tuple[float, float] = (1.0, 0.0)) -> None:
    """Mark a map, drawn as the camera sees it, with an arrow to +x of the mirror's frame and with WORDS.

    towards: direction of +x on the page (right, up); of any length.
    """
    from matplotlib.patheffects import withStroke  # imported late: the page wants directions alone

    outline = [withStroke(linewidth=2, foreground="white")]  # readable on bright and dark maps
    way = np.array(towards, float) / np.hypot(*towards)
    half, label = LENGTH / 2 * way, (LENGTH / 2 + SIZE) * way
    # as near to the corner as tail and label allow, whatever the direction
    middle = np.maximum(5.0 + half, np.array([1.3, 1.1]) * SIZE - label)
    arrow = axes.annotate(
        "", xy=middle + half, xytext=middle - half, xycoords="axes points", textcoords="axes points",
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0,
                    "path_effects": outline},
    )  # fmt: skip
    arrow.set_gid("fiducial")
    axes.annotate(
        "+x", middle + label, xycoords="axes points", ha="center", va="center", fontsize=SIZE, path_effects=outline
    )
    axes.text(1 - FROM[0], FROM[1], WORDS, transform=axes.transAxes, ha="right", va="bottom", fontsize=SIZE,
              path_effects=outline)  # fmt: skip


def x_direction(x_mm: FloatArray, y_mm: FloatArray) -> tuple[float, float]:
    """Direction (along the columns, along the rows) of +x on a grid with mirror points x, y [rows, columns]; NaN where
    a pixel sees none.

    (1, 0) where fewer than three pixels tell.
    """
    row, column = np.nonzero(np.isfinite(x_mm + y_mm))
    if len(row) < 3 or min(np.ptp(row), np.ptp(column)) == 0:
        return 1.0, 0.0
    design = np.stack([column - column.mean(), row - row.mean(), np.ones(len(row))], -1)
    places = np.stack([x_mm[row, column], y_mm[row, column]], -1)
    along_column, along_row = np.linalg.lstsq(design, places, rcond=None)[0][:2]
    found = np.linalg.solve(np.stack([along_column, along_row], -1), [1.0, 0.0])
    found = found / np.hypot(*found)
    return float(found[0]), float(found[1])


@dataclass(frozen=True)
class MapFrame:
    """How a map on the detector's grid is drawn: the part that is shown, its edges on the axes, their labels, and the
    direction of the mirror's +x on the page.

    The axes are the mirror's x and y; where the grid is turned against them, or a place of theirs would be off by more
    than MISPLACED, detector columns and rows.
    """

    cut: tuple[slice, slice]
    extent: tuple[float, float, float, float]
    x_label: str
    y_label: str
    towards: tuple[float, float]

    @classmethod
    def of(cls, x_mm: FloatArray, y_mm: FloatArray, mask: BoolArray) -> MapFrame:
        """x_mm, y_mm: mirror points [rows, columns] of the pixels. mask: [rows, columns] that are shown."""
        rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
        cut = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        x, y = np.where(mask, x_mm, np.nan), np.where(mask, y_mm, np.nan)
        towards = x_direction(x, y)
        (x_ends, x_off), (y_ends, y_off) = _ends(x, axis=1), _ends(y, axis=0)
        if towards[0] > UPRIGHT and max(x_off, y_off) < MISPLACED:
            return cls(cut, x_ends + y_ends, "mirror x [mm]", "mirror y [mm]", towards)
        extent = (columns[0] - 0.5, columns[-1] + 0.5, rows[0] - 0.5, rows[-1] + 0.5)
        return cls(cut, extent, "detector column", "detector row", towards)


def _ends(places_mm: FloatArray, axis: int) -> tuple[tuple[float, float], float]:
    """Where the first pixel along the axis begins and the last one ends, on the line that fits the pixels' places; how
    far places are off that line, but for a pixel, as a share of the whole."""
    found = np.nonzero(np.isfinite(places_mm))
    pixel, place = found[axis], places_mm[found]
    if np.ptp(pixel) == 0:
        return (float(place.min()), float(place.max())), 0.0
    line = np.polynomial.Polynomial.fit(pixel, place, 1)
    first, last = (float(line(end)) for end in (pixel.min() - 0.5, pixel.max() + 0.5))
    off = np.abs(place - line(pixel)).max() / abs(last - first)
    return (first, last), max(0.0, float(off) - 1.0 / (np.ptp(pixel) + 1.0))
