"""Linear least squares of rows that come in parts: a triangle stands for all rows so far.

The rows [J | r] of any number are kept as the R of their QR decomposition, [columns + 1, columns + 1]: the memory does
not grow with the rows, and unlike in normal equations no digits are lost by squaring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from irtscots_cl.maths.arrays import FloatArray

SAME = 1e-6  # of a column, that others do not imitate: less is rounding
AT_ONCE = 4096  # rows that stay in a processor's cache


@dataclass(frozen=True)
class Triangle:
    """values: [columns + 1, columns + 1] upper triangle of all rows [J | r]; the last column is the right side."""

    values: FloatArray

    @classmethod
    def empty(cls, columns: int) -> Triangle:
        return cls(np.zeros((columns + 1, columns + 1)))

    @property
    def columns(self) -> int:
        return len(self.values) - 1

    @property
    def matrix(self) -> FloatArray:
        """[columns, columns]: R of J."""
        return self.values[:-1, :-1]

    @property
    def square_left(self) -> float:
        """Sum of squares of r that no x explains in r = J x."""
        return float(self.values[-1, -1] ** 2)

    def with_rows(self, rows: FloatArray) -> Triangle:
        """With further rows [n, columns + 1]."""
        values = self.values
        for first in range(0, len(rows), AT_ONCE):
            values = _triangle(np.vstack([values, rows[first : first + AT_ONCE]]))
        return Triangle(values)

    def solution(self) -> FloatArray:
        """x [columns] of least |r - J x|, the shortest if there are several."""
        return np.asarray(np.linalg.lstsq(self.matrix, self.values[:-1, -1])[0], np.float64)

    def covariance(self) -> FloatArray:
        """(J^T J)^-1 [columns, columns]: of x, if the rows have errors of 1. Needs rows that determine x."""
        inverse = solve_triangular(self.matrix, np.eye(self.columns))
        found: FloatArray = inverse @ inverse.T
        return found

    def directions(self) -> tuple[FloatArray, FloatArray]:
        """Singular values of J, ascending, and the unit vectors [value, columns] that they belong to."""
        _, values, vectors = np.linalg.svd(self.matrix)
        return values[::-1], vectors[::-1]

    def without_right_side(self) -> Triangle:
        """The columns alone, for another right side."""
        values = self.values.copy()
        values[:, -1] = 0.0
        return Triangle(values)

    def left_beside(self, first: int) -> FloatArray:
        """By how much the squares fall if each single column from `first` on joins the columns before: [others]."""
        inside, right = self.values[first:-1, first:-1], self.values[first:-1, -1]
        squares, whole = np.sum(inside**2, axis=0), np.sum(self.values[:, first:-1] ** 2, axis=0)
        own = squares > SAME**2 * whole
        return np.where(own, (inside.T @ right) ** 2 / np.where(own, squares, 1.0), 0.0)


def _triangle(rows: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.qr(rows, mode="r"), np.float64)
