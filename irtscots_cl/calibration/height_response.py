"""From an error of the geometry to the error of the height map that the design's geometry makes of the images.

The moved geometry makes centroids that differ by (du, dv) from the design's. The measurement explains them by heights
w: by_height w + by_slope grad w = (du, dv) for the design's chief rays, with w integrated from grad w as measured
slopes are. The height moves the mirror point along the ray, so it is fed back until it stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from irtscots_cl.calibration.ray_changes import ray_changes
from irtscots_cl.calibration.seen_pixels import SeenPixels, seen_pixels
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.row_products import without_rows
from irtscots_cl.optics.setup import Setup

LEFT_AFTER = ("piston_tilt", "piston_tilt_power", "piston_tilt_power_astigmatism", "piston_tilt_power_astigmatism_coma")
_TERMS = (3, 4, 6, 8)  # of low_order_basis, that each of them removes
AT_ONCE = 32  # maps, to limit memory
MOST_ROUNDS, SETTLED = 40, 1e-5  # of the feedback; relative change of a map's rms


@dataclass(frozen=True)
class HeightResponse:
    """Makes height maps of changes of the centroids.

    by_height [2, n], from_places [2, 2, n]: of ray_changes, and the inverse of its by_slope. basis [n, 8]: orthonormal
    columns that span piston, x, y | power | two astigmatisms | two comas, in this order.
    """

    seen: SeenPixels
    method: str
    by_height: FloatArray = field(repr=False)
    from_places: FloatArray = field(repr=False)
    basis: FloatArray = field(repr=False)

    @classmethod
    def of(cls, setup: Setup, seen: SeenPixels | None = None, method: str = "southwell") -> HeightResponse:
        """method: of integrate_slopes. Raises the errors of seen_pixels."""
        seen = seen or seen_pixels(setup)
        changes = ray_changes(setup.chief_rays, *seen.pixels)
        (xx, xy), (yx, yy) = changes.by_slope.transpose(0, 2, 1)
        from_places = np.array([[yy, -xy], [-yx, xx]]) / (xx * yy - xy * yx)
        return cls(seen, method, changes.by_height, from_places, low_order_basis(seen))

    def heights_mm(self, places_mm: FloatArray) -> FloatArray:
        """Heights [maps, n] in mm from changes (du, dv) [maps, 2, n] in mm of the pixels in seen.mask; mean 0.

        Raises ValueError where the feedback of the height does not settle.
        """
        heights = self._integrated(places_mm)
        for _ in range(MOST_ROUNDS):
            before = heights
            heights = self._integrated(places_mm - heights[:, None] * self.by_height)
            size = np.sqrt(np.mean(heights**2, axis=-1))
            if np.all(np.sqrt(np.mean((heights - before) ** 2, axis=-1)) <= SETTLED * size):
                return heights
        raise ValueError(
            f"the height that moves the mirror points does not settle in {MOST_ROUNDS} rounds: the design's slopes do "
            "not determine its height"
        )

    def _integrated(self, places_mm: FloatArray) -> FloatArray:
        slope_x, slope_y = self.seen.on_grid(np.einsum("abn,mbn->amn", self.from_places, places_mm))
        seen = self.seen
        maps = integrate_slopes(seen.x_mm, seen.y_mm, slope_x, slope_y, seen.mask, self.method)
        return maps[:, seen.mask]

    @cached_property
    def _rows(self) -> FloatArray:
        return np.ascontiguousarray(self.basis.T)

    def left(self, heights: FloatArray) -> FloatArray:
        """Rms [maps, 4] of heights [maps, n] with the terms of LEFT_AFTER removed by least squares, in their unit."""
        found = np.empty((len(heights), len(LEFT_AFTER)))
        for first in range(0, len(heights), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            rest = self.without(heights[part], LEFT_AFTER[0])
            for level, stop in enumerate(_TERMS):
                rest = without_rows(rest, self._rows[_TERMS[level - 1] if level else 0 : stop])
                # the terms of the first level went twice: large tilts leave rounding
                found[part, level] = np.sqrt(np.einsum("mn,mn->m", rest, rest) / rest.shape[1])
        return found

    def without(self, heights: FloatArray, terms: str) -> FloatArray:
        """Heights [..., n] without the terms that one of LEFT_AFTER names."""
        return without_rows(heights, self._rows[: _TERMS[LEFT_AFTER.index(terms)]])


def low_order_basis(seen: SeenPixels) -> FloatArray:
    """Orthonormal columns [n, 8]: piston, x, y, power, two astigmatisms, two comas, each without those before it."""
    x, y = (v[seen.mask] - v[seen.mask].mean() for v in (seen.x_mm, seen.y_mm))
    scale = max(np.abs(x).max(), np.abs(y).max())
    x, y = x / scale, y / scale
    square = x * x + y * y
    columns = [np.ones_like(x), x, y, square, x * x - y * y, x * y, square * x, square * y]
    basis: FloatArray = np.linalg.qr(np.stack(columns, -1))[0]
    return basis


def by_terms(values: Sequence[float] | FloatArray) -> dict[str, float]:
    """Four numbers by the names of LEFT_AFTER."""
    return dict(zip(LEFT_AFTER, (float(value) for value in values), strict=True))
