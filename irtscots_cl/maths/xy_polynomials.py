"""Polynomials in x and y over a rectangle: Chebyshev series, and Legendre and power series turned into them.

A series is W(x, y) = sum c_ji T_i(u) T_j(v), u and v from -1 to 1 over the rectangle. All |T_n| are at most 1 there:
the sum is as exact as its coefficients. A polynomial of degree n stays one on every other rectangle; its values at
n + 1 Chebyshev points along an axis give the coefficients there, with no loss of digits where the other rectangle lies
inside the first.

Source: J. P. Boyd, Chebyshev and Fourier Spectral Methods (2001), section 4.5, for coefficients from values at points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import chebyshev, legendre, polynomial

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system import interruption

BASES = {"chebyshev": chebyshev.chebvander, "legendre": legendre.legvander, "monomial": polynomial.polyvander}
ROUNDING = 8 * float(np.finfo(float).eps)  # of a coefficient, relative to the sum of the terms' magnitudes
_AT_ONCE = 2**13  # points evaluated at a time: arrays of all T_n at them stay in the cache


@dataclass(frozen=True, eq=False)
class ChebyshevSeries:
    """coefficient: [rows, columns] of T_i(u) T_j(v) at [j, i]; centre_mm, half_size_mm: (x, y) of the rectangle."""

    coefficient: FloatArray = field(repr=False)
    centre_mm: tuple[float, float]
    half_size_mm: tuple[float, float]

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """W and dW/dx, dW/dy per mm at points of any one shape; the polynomial goes on beyond the rectangle."""
        x, y = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(y_mm, float))
        u, v = ((p.ravel() - c) / h for p, c, h in zip((x, y), self.centre_mm, self.half_size_mm, strict=True))
        found = np.empty((3, u.size))
        for first in range(0, u.size, _AT_ONCE):
            interruption.check()
            part = slice(first, first + _AT_ONCE)
            rows, columns = (
                _values_and_slopes(p[part], n) for p, n in zip((v, u), self.coefficient.shape, strict=True)
            )
            across = columns[0] @ self.coefficient.T
            found[0, part] = np.sum(across * rows[0], -1)
            found[1, part] = np.sum(columns[1] @ self.coefficient.T * rows[0], -1) / self.half_size_mm[0]
            found[2, part] = np.sum(across * rows[1], -1) / self.half_size_mm[1]
        height, slope_x, slope_y = found.reshape(3, *x.shape)
        return height, slope_x, slope_y

    def on(self, centre_mm: tuple[float, float], half_size_mm: tuple[float, float]) -> ChebyshevSeries:
        """The same polynomial as a series on another rectangle; one that lies in the series' own loses no digits."""
        if (centre_mm, half_size_mm) == (self.centre_mm, self.half_size_mm):
            return self
        rows, columns = (
            _moved_basis(count, centre_mm[axis], half_size_mm[axis], self.centre_mm[axis], self.half_size_mm[axis])
            for count, axis in zip(self.coefficient.shape, (1, 0), strict=True)
        )
        moved = ChebyshevSeries(rows @ self.coefficient @ columns.T, centre_mm, half_size_mm)
        return _trimmed(moved, float(np.abs(self.coefficient).sum()))


def series_of(
    basis: str,
    terms: Sequence[tuple[int, int, float]],
    centre_mm: tuple[float, float],
    half_size_mm: tuple[float, float],
) -> ChebyshevSeries:
    """The sum of value B_i(u) B_j(v) of terms (i, j, value), of different powers, as a series on the rectangle.

    basis: of BASES. Coefficients that are mere rounding of the terms are 0.
    """
    columns, rows = max(i for i, _, _ in terms) + 1, max(j for _, j, _ in terms) + 1
    given = np.zeros((rows, columns))
    for i, j, value in terms:
        given[j, i] = value
    down, across = (_coefficients_of(np.asarray(BASES[basis](_points(n), n - 1))) for n in (rows, columns))
    return _trimmed(ChebyshevSeries(down @ given @ across.T, centre_mm, half_size_mm), float(np.abs(given).sum()))


def sum_of(series: Sequence[ChebyshevSeries]) -> ChebyshevSeries:
    """The sum of series, on the rectangle that all of theirs share: that of the mirror lies in it."""
    low = [max(s.centre_mm[axis] - s.half_size_mm[axis] for s in series) for axis in (0, 1)]
    high = [min(s.centre_mm[axis] + s.half_size_mm[axis] for s in series) for axis in (0, 1)]
    if len({(s.centre_mm, s.half_size_mm) for s in series}) == 1:
        centre, half = series[0].centre_mm, series[0].half_size_mm
    else:
        centre = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2)
        half = ((high[0] - low[0]) / 2, (high[1] - low[1]) / 2)
    moved = [s.on(centre, half).coefficient for s in series]
    total = np.zeros(tuple(max(c.shape[axis] for c in moved) for axis in (0, 1)))
    for coefficient in moved:
        total[: coefficient.shape[0], : coefficient.shape[1]] += coefficient
    return ChebyshevSeries(total, centre, half)


def _values_and_slopes(t: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """T_n(t) and their derivatives [points, count]."""
    value, slope = np.ones((len(t), count)), np.zeros((len(t), count))
    if count > 1:
        value[:, 1], slope[:, 1] = t, 1.0
    for n in range(2, count):
        value[:, n] = 2 * t * value[:, n - 1] - value[:, n - 2]
        slope[:, n] = 2 * value[:, n - 1] + 2 * t * slope[:, n - 1] - slope[:, n - 2]
    return value, slope


def _points(count: int) -> FloatArray:
    """The zeros of T_count."""
    found: FloatArray = np.cos((np.arange(count) + 0.5) * (np.pi / count))
    return found


def _coefficients_of(values: FloatArray) -> FloatArray:
    """Chebyshev coefficients [count, functions] of polynomials of degree below count, from their values at _points."""
    count = len(values)
    waves = np.cos(np.outer(np.arange(count), (np.arange(count) + 0.5) * (np.pi / count))) * (2 / count)
    waves[0] /= 2
    found: FloatArray = waves @ values
    return found


def _moved_basis(count: int, centre: float, half: float, from_centre: float, from_half: float) -> FloatArray:
    """Coefficients [count, count] on one interval of the Chebyshev polynomials of another."""
    there = (centre + half * _points(count) - from_centre) / from_half
    return _coefficients_of(np.asarray(chebyshev.chebvander(there, count - 1), np.float64))


def _trimmed(series: ChebyshevSeries, size: float) -> ChebyshevSeries:
    """The series with coefficients of mere rounding set to 0, without empty rows and columns at the end."""
    kept = np.where(np.abs(series.coefficient) > ROUNDING * size, series.coefficient, 0.0)
    rows, columns = (int(np.flatnonzero(kept.any(axis)).max(initial=0)) + 1 for axis in (1, 0))
    return ChebyshevSeries(kept[:rows, :columns], series.centre_mm, series.half_size_mm)
