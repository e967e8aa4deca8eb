"""Height maps of the mirror turned about its axis, on the pixels that see it.

A map is a polynomial of radial order ORDER, which is turned exactly, and the rest, which comes from the nearest pixel:
so the rule of budget/averaging.py holds exactly to that order, and noise keeps its size.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from irtscots_cl.calibration.seen_pixels import SeenPixels
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.maths.row_products import dots_of_rows, dual_rows, sums_of_rows
from irtscots_cl.maths.zernike.polynomials import zernike

ORDER = 12
FEWEST = 6  # pixels for each term of the polynomial
REACH = 1.5  # pixels: a turned point farther than that from any has no height


@dataclass(frozen=True)
class TurnedMaps:
    """turns: equal angles over a full circle. radius_mm: of the mirror."""

    seen: SeenPixels = field(repr=False)
    radius_mm: float
    turns: int

    @cached_property
    def _points(self) -> tuple[FloatArray, FloatArray]:
        seen = self.seen
        return seen.x_mm[seen.mask] / self.radius_mm, seen.y_mm[seen.mask] / self.radius_mm

    @cached_property
    def _terms(self) -> range:
        most = len(self._points[0]) / FEWEST
        order = max(order for order in range(ORDER + 1) if (order + 1) * (order + 2) / 2 <= most)
        return range(1, (order + 1) * (order + 2) // 2 + 1)

    def _basis(self, x: FloatArray, y: FloatArray) -> FloatArray:
        return np.stack([zernike(noll, x, y) for noll in self._terms])

    @cached_property
    def _fit(self) -> tuple[FloatArray, FloatArray]:
        """Values [terms, n] at the pixels, and what makes coefficients of heights, [terms, n]."""
        basis = self._basis(*self._points)
        return basis, dual_rows(basis)

    @cached_property
    def _copies(self) -> list[tuple[FloatArray, IntArray, BoolArray]]:
        """Of each turn: the terms [terms, n] there, the nearest pixels [n], and whether there is one."""
        x, y = self._points
        tree, found = cKDTree(np.stack([x, y], -1)), []
        own, _ = tree.query(np.stack([x, y], -1), k=2)
        pitch = float(np.median(own[:, 1]))
        for k in range(self.turns):
            cosine, sine = np.cos(2 * np.pi * k / self.turns), np.sin(2 * np.pi * k / self.turns)
            place = cosine * x - sine * y, sine * x + cosine * y
            distance, nearest = tree.query(np.stack(place, -1))
            found.append((self._basis(*place), nearest, distance <= REACH * pitch))
        return found

    @property
    def alone(self) -> int:
        """How many pixels have no height after some turn: what they see of the mirror is not seen then."""
        return int(np.count_nonzero(~np.all([has for _, _, has in self._copies], axis=0)))

    def mean(self, heights: FloatArray) -> FloatArray:
        """Mean [..., n] of heights [turns or 1, ..., n] as the turned mirror sees them; of one map, of its copies."""
        basis, inverse = self._fit
        total, count = np.zeros(heights.shape[1:]), np.zeros(heights.shape[-1])
        parts = [heights[0]] * self.turns if len(heights) == 1 else list(heights)
        for map_, (terms, nearest, has) in zip(parts, self._copies, strict=True):
            coefficients = dots_of_rows(map_, inverse)
            rest = map_ - sums_of_rows(coefficients, basis)
            total += np.where(has, sums_of_rows(coefficients, terms) + rest[..., nearest], 0.0)
            count += has
        found: FloatArray = total / count  # the first one is everywhere
        return found
