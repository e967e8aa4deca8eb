"""Sums of Zernike terms at points, in float64 on the host."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irtscots_cl.maths.zernike.polynomials import broadcast_points
from irtscots_cl.maths.zernike.series import RadialSeries
from irtscots_cl.system import interruption

_AT_ONCE = 2**11  # points evaluated at a time: fewer calls, and their rows still stay near the processor
BANDS = 8  # intervals of r^2 for rows of different azimuthal orders
MAX_ORDER = 30  # radial order up to which the intervals lose no more than three digits


@dataclass(frozen=True, eq=False)
class SeriesEvaluation:
    """Evaluates a RadialSeries; what that takes is made once."""

    series: RadialSeries = field(repr=False)

    @cached_property
    def _rows(self) -> ChebyshevRows | None:
        """None for a series of high order."""
        order = (self.series.m + 2 * (self.series.count - 1)).max(initial=0)
        return chebyshev_rows(self.series) if order <= MAX_ORDER else None

    def at(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """W, dW/dx and dW/dy at unit-disk coordinates.

        Each result has the broadcast shape of ``x`` and ``y``; the slopes are per unit-disk coordinate.
        """
        x, y = broadcast_points(x, y)
        result = np.empty((3, x.size))
        flat_x, flat_y = x.ravel(), y.ravel()
        for first in range(0, x.size, _AT_ONCE):
            interruption.check()
            part = slice(first, first + _AT_ONCE)
            if self._rows is None:
                result[:, part] = _by_clenshaw(self.series, flat_x[part], flat_y[part])
            else:
                _evaluate(self._rows, flat_x[part], flat_y[part], result[:, part])
        height, slope_x, slope_y = result.reshape(3, *x.shape)
        return height, slope_x, slope_y


def evaluate_series(
    series: RadialSeries, x: ArrayLike, y: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """W, dW/dx and dW/dy of a `RadialSeries` at unit-disk coordinates: see SeriesEvaluation.at."""
    return SeriesEvaluation(series).at(x, y)


@dataclass(frozen=True, eq=False)
class ChebyshevRows:
    """A `RadialSeries` as rows c(t) B, B the real or the imaginary part of zeta^m, c a sum of Chebyshev polynomials.

    order, sine: int [rows], azimuthal order m, ascending, and 1 for the imaginary part; series' rows of one order are
    added up. bands: rows whose polynomials are of one interval of t, so that a matrix product gives them all at once:
    the interval's lower end, the rows [n], and the coefficients [n, degrees] of c and of dc/dt.

    A row oscillates where r > m / n. Nearer to the centre c grows as zeta^m falls: an interval that went on there would
    cost digits at the rim.
    """

    order: NDArray[np.intp]
    sine: NDArray[np.intp]
    bands: tuple[tuple[float, NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]], ...]


def chebyshev_rows(series: RadialSeries) -> ChebyshevRows:
    """Expand each non-zero part of a series in Chebyshev polynomials, exactly: by its values at their nodes."""
    degrees: dict[int, int] = {}
    for m, count in zip(series.m.tolist(), series.count.tolist(), strict=True):
        degrees[m] = max(degrees.get(m, 0), count)
    rows: dict[tuple[int, int], NDArray[np.float64]] = {}
    for row, m in enumerate(series.m.tolist()):
        node, transform = _nodes(degrees[m])
        low = _band(m, degrees[m])
        radial, _ = _clenshaw(series, row, low + (node + 1) / 2 * (1 - low))
        for sine, values in enumerate((radial.real, radial.imag)):
            if values.any():
                rows[m, sine] = rows.get((m, sine), 0.0) + transform @ values
    places = sorted(rows)
    bands = []
    for low in sorted({_band(m, degrees[m]) for m, _ in places}):
        chosen = [k for k, (m, _) in enumerate(places) if _band(m, degrees[m]) == low]
        own = np.zeros((len(chosen), max(degrees[places[k][0]] for k in chosen)))
        for coefficients, k in zip(own, chosen, strict=True):
            coefficients[: len(rows[places[k]])] = rows[places[k]]
        slope = np.zeros_like(own)
        if own.shape[1] > 1:
            slope[:, :-1] = np.polynomial.chebyshev.chebder(own, scl=2 / (1 - low), axis=1)
        bands.append((low, np.array(chosen), own, slope))
    keys = np.array(places, np.intp).reshape(-1, 2)
    return ChebyshevRows(keys[:, 0], keys[:, 1], tuple(bands))


def _band(m: int, degrees: int) -> float:
    """Lower end of the interval of t on which a row with so many radial degrees is expanded."""
    turning = (m / max(m + 2 * (degrees - 1), 1)) ** 2  # in r^2
    return 2 * min(int(turning * BANDS), BANDS - 1) / BANDS - 1


def _nodes(degrees: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Chebyshev's nodes on [-1, 1], and the matrix from values there to coefficients [degrees, degrees]."""
    angle = np.pi * (np.arange(degrees) + 0.5) / degrees
    transform = np.cos(np.outer(np.arange(degrees), angle)) * (2 / degrees)
    transform[0] /= 2
    return np.cos(angle), transform


def _evaluate(rows: ChebyshevRows, x: NDArray[np.float64], y: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """W, dW/dx, dW/dy [3, n] at points [n].

    d zeta^m/dx = m zeta^(m-1), d zeta^m/dy = i m zeta^(m-1), and dt/dx = 4 x.
    """
    radial, slope, power, by_x, by_y = np.empty((5, len(rows.order), x.size))
    t = 2.0 * (x * x + y * y) - 1.0
    for low, chosen, own, of_slope in rows.bands:
        values = _chebyshev((t - low) * (2 / (1 - low)) - 1.0, own.shape[1])
        radial[chosen], slope[chosen] = own @ values, of_slope @ values
    zeta = x + 1j * y
    lower, now, reached = np.zeros_like(zeta), np.ones_like(zeta), 0
    for row, (m, sine) in enumerate(zip(rows.order.tolist(), rows.sine.tolist(), strict=True)):
        while reached < m:
            lower, now, reached = now, now * zeta, reached + 1
        turning = m * lower
        power[row] = now.imag if sine else now.real
        by_x[row] = turning.imag if sine else turning.real
        by_y[row] = turning.real if sine else -turning.imag
    slope *= power
    for out, rest in zip(result, (power, by_x, by_y), strict=True):
        rest *= radial
        np.add.reduce(rest, axis=0, out=out)
    stretching = 4.0 * np.add.reduce(slope, axis=0)
    result[1] += x * stretching
    result[2] += y * stretching


def _chebyshev(t: NDArray[np.float64], degrees: int) -> NDArray[np.float64]:
    """T_0 to T_(degrees - 1) at t [n], [degrees, n]."""
    values = np.empty((degrees, t.size))
    values[0] = 1.0
    if degrees > 1:
        values[1] = t
    twice = 2.0 * t
    for k in range(2, degrees):
        np.multiply(twice, values[k - 1], out=values[k])
        values[k] -= values[k - 2]
    return values


def _by_clenshaw(
    series: RadialSeries, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """As _evaluate, from the series itself: every digit, at several times the cost."""
    zeta = x + 1j * y
    value, slope_x, slope_y = np.zeros((3, *x.shape))
    lower, power, reached = np.zeros_like(zeta), np.ones_like(zeta), 0
    for row, m in enumerate(series.m.tolist()):
        if m > reached:
            lower = power * zeta ** (m - 1 - reached)
            power, reached = lower * zeta, m
        radial, radial_slope = _clenshaw(series, row, 2.0 * (x * x + y * y) - 1.0)
        turning = m * np.conj(radial) * lower
        stretching = 4.0 * (np.conj(radial_slope) * power).real
        value = value + (np.conj(radial) * power).real
        slope_x = slope_x + turning.real + x * stretching
        slope_y = slope_y - turning.imag + y * stretching
    return value, slope_x, slope_y


def _clenshaw(
    series: RadialSeries, row: int, t: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """a_m(t) and da_m/dt of one row, cosine part + i sine part."""
    first, count = int(series.offset[row]), int(series.count[row])
    last = first + count - 1
    b1 = np.full(t.shape, series.cosine[last] + 1j * series.sine[last])
    b2, d1, d2 = np.zeros((3, *t.shape), dtype=np.complex128)
    for k in range(last - 1, first - 1, -1):
        line = series.alpha[k] * t + series.beta[k]
        d1, d2 = series.alpha[k] * b1 + line * d1 + series.gamma[k + 1] * d2, d1
        b1, b2 = series.cosine[k] + 1j * series.sine[k] + line * b1 + series.gamma[k + 1] * b2, b1
    return b1, d1
