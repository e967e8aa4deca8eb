"""Zernike polynomials on the unit disk: numbering, values, gradients, device tables, least-squares fit.

Coordinates are dimensionless (position over pupil radius). Values are always Noll-normalised, rms 1 over the
unit disk, whatever numbering is used. ``m > 0`` is a cosine term, ``m < 0`` a sine term, the angle counted
from +x towards +y.

With s = x^2 + y^2, t = 2 s - 1, zeta = x + i y and k = (n - |m|)/2 every polynomial is

    N P_k^(0,|m|)(t) Re zeta^m   (m >= 0)    or    N P_k^(0,|m|)(t) Im zeta^|m|   (m < 0)

with P the Jacobi polynomial and N = sqrt(n + 1), times sqrt(2) unless m = 0. Nothing is divided by rho and no
angle is taken, so the origin is an ordinary point; the recurrence in k has none of the cancellation of the
factorial sum.

Sources: R. J. Noll, J. Opt. Soc. Am. 66, 207 (1976), for normalisation and numbering; ANSI Z80.28 / L. N.
Thibos et al., J. Refract. Surg. 18, S652 (2002), for OSA; J. C. Wyant and K. Creath, Applied Optics and
Optical Engineering XI, 28 (1992), for the University of Arizona fringe set; DLMF 18.9.2 for the Jacobi
recurrence.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

ORDERINGS = ("noll", "fringe", "osa")

_FIRST_INDEX = {"noll": 1, "fringe": 1, "osa": 0}

# A sample computed as (cos a, sin a) may land a few ulp outside the disk; it is still a sample on the rim.
_AT_ONCE = 2**13  # points of a series: a dozen arrays of them stay in the cache
_RIM_TOLERANCE = 1e-12


def index_to_nm(j: int, ordering: str) -> tuple[int, int]:
    """Radial order n and azimuthal order m (m > 0 cosine, m < 0 sine) of term ``j``.

    ``ordering`` is "noll" (from 1), "fringe" (University of Arizona, from 1) or "osa" (OSA/ANSI, from 0).
    The fringe numbering is the regular one: the term (12, 0), printed last in many 37-term lists, is 49 here.

    Raises ValueError if the ordering is unknown or ``j`` is not an integer at or above the ordering's first.
    """
    _check_ordering(ordering)
    j = _integer(j, "Zernike index")
    if j < _FIRST_INDEX[ordering]:
        raise ValueError(f"Zernike index {j} is below the first {ordering} index, {_FIRST_INDEX[ordering]}")
    if ordering == "fringe":
        return _fringe_to_nm(j)
    position = j - _FIRST_INDEX[ordering]
    n = (math.isqrt(8 * position + 1) - 1) // 2
    within = position - n * (n + 1) // 2
    if ordering == "osa":
        return n, 2 * within - n
    m = n % 2 + 2 * ((within + 1 - n % 2) // 2)
    return n, m if j % 2 == 0 else -m


def nm_to_index(n: int, m: int, ordering: str) -> int:
    """Index of the term of radial order ``n`` and azimuthal order ``m``; the inverse of `index_to_nm`.

    Raises ValueError if the ordering is unknown or (n, m) names no polynomial.
    """
    _check_ordering(ordering)
    n, m = _checked_nm(n, m)
    if ordering == "osa":
        return (n * (n + 2) + m) // 2
    if ordering == "fringe":
        return (1 + (n + abs(m)) // 2) ** 2 - 2 * abs(m) + (m < 0)
    lower = n * (n + 1) // 2 + abs(m)
    if m == 0:
        return lower + 1
    # Noll gives the even one of the pair's two indices to the cosine.
    return lower + ((lower % 2 == 0) == (m < 0))


def noll_to_nm(j: int) -> tuple[int, int]:
    """`index_to_nm` for the Noll numbering, ``j`` from 1."""
    return index_to_nm(j, "noll")


def nm_to_noll(n: int, m: int) -> int:
    """`nm_to_index` for the Noll numbering."""
    return nm_to_index(n, m, "noll")


def fringe_to_nm(j: int) -> tuple[int, int]:
    """`index_to_nm` for the University of Arizona fringe numbering, ``j`` from 1."""
    return index_to_nm(j, "fringe")


def nm_to_fringe(n: int, m: int) -> int:
    """`nm_to_index` for the University of Arizona fringe numbering."""
    return nm_to_index(n, m, "fringe")


def osa_to_nm(j: int) -> tuple[int, int]:
    """`index_to_nm` for the OSA/ANSI numbering, ``j`` from 0."""
    return index_to_nm(j, "osa")


def nm_to_osa(n: int, m: int) -> int:
    """`nm_to_index` for the OSA/ANSI numbering."""
    return nm_to_index(n, m, "osa")


def normalisation(n: int, m: int) -> float:
    """Noll's factor that makes the rms over the unit disk 1: sqrt(n + 1), times sqrt(2) unless m = 0."""
    return math.sqrt((n + 1) * (1 if m == 0 else 2))


def zernike(j: int, x: ArrayLike, y: ArrayLike, ordering: str = "noll") -> NDArray[np.float64]:
    """Noll-normalised Zernike polynomial ``j`` at unit-disk coordinates ``x``, ``y``.

    ``ordering`` picks the numbering only. Returns the broadcast shape of ``x`` and ``y``. Points outside the
    disk get the polynomial itself. Raises ValueError as `index_to_nm`, or if the shapes do not broadcast.
    """
    n, m = index_to_nm(j, ordering)
    x, y = _broadcast(x, y)
    radial, _ = _jacobi((n - abs(m)) // 2, abs(m), 2.0 * (x * x + y * y) - 1.0)
    power = (x + 1j * y) ** abs(m)
    return normalisation(n, m) * radial * (power.real if m >= 0 else power.imag)


def zernike_gradient(
    j: int, x: ArrayLike, y: ArrayLike, ordering: str = "noll"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives (d/dx, d/dy) of `zernike` per unit-disk coordinate, each of the broadcast shape.

    Exact at the origin. Divide by the pupil radius for a derivative per length. Raises as `zernike`.
    """
    n, m = index_to_nm(j, ordering)
    x, y = _broadcast(x, y)
    radial, radial_slope = _jacobi((n - abs(m)) // 2, abs(m), 2.0 * (x * x + y * y) - 1.0)
    zeta = x + 1j * y
    lower = zeta ** (abs(m) - 1) if m != 0 else np.zeros_like(zeta)
    power = lower * zeta if m != 0 else np.ones_like(zeta)
    # d zeta^m/dx = m zeta^(m-1), d zeta^m/dy = i m zeta^(m-1), and dt/dx = 4 x.
    along_x = abs(m) * radial * lower + 4.0 * x * radial_slope * power
    along_y = 1j * abs(m) * radial * lower + 4.0 * y * radial_slope * power
    factor = normalisation(n, m)
    if m >= 0:
        return factor * along_x.real, factor * along_y.real
    return factor * along_x.imag, factor * along_y.imag


@dataclass(frozen=True, eq=False)
class RadialSeries:
    """Tables of W = sum over m of Re[conj(a_m(t)) zeta^m], a_m = sum_k (cosine_k + i sine_k) P_k^(0,m)(t).

    zeta = x + i y and t = 2 (x^2 + y^2) - 1 on the unit disk. One row per azimuthal order present, ascending.
    Row r owns the entries ``offset[r]`` to ``offset[r] + count[r] - 1`` of the flat tables, k from 0.
    ``cosine`` and ``sine`` include Noll's normalisation and carry the unit of the coefficients that went in.

    The recurrence is P_{k+1} = (alpha[k] t + beta[k]) P_k + gamma[k] P_{k-1} with P_0 = 1 and gamma[0] = 0.
    Clenshaw runs b_k = c_k + (alpha[k] t + beta[k]) b_{k+1} + gamma[k+1] b_{k+2} down to the sum b_0. Step
    k = count - 1 is b_k = c_k: it must not read gamma[k+1], which is another row's entry or past the end.
    """

    m: NDArray[np.int32]
    count: NDArray[np.int32]
    offset: NDArray[np.int32]
    cosine: NDArray[np.float64]
    sine: NDArray[np.float64]
    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]
    gamma: NDArray[np.float64]


def radial_series(terms: Mapping[tuple[int, int], float]) -> RadialSeries:
    """Tables that evaluate the sum of ``terms``, a mapping {(n, m): coefficient of the Noll-normalised term}.

    A term listed with coefficient 0 keeps its place in the tables; an empty mapping gives empty tables.
    Raises ValueError for an invalid (n, m) or a coefficient that is not finite.
    """
    orders: dict[int, int] = {}
    for (n, m), value in terms.items():
        n, m = _checked_nm(n, m)
        if not math.isfinite(value):
            raise ValueError(f"Zernike coefficient of (n, m) = ({n}, {m}) is not finite: {value}")
        orders[abs(m)] = max(orders.get(abs(m), 0), (n - abs(m)) // 2 + 1)
    rows = sorted(orders)
    count = np.array([orders[m] for m in rows], dtype=np.int32)
    offset = np.array([count[:row].sum() for row in range(len(rows))], dtype=np.int32)
    start = dict(zip(rows, offset.tolist(), strict=True))
    cosine, sine = np.zeros((2, int(count.sum())))
    for (n, m), value in terms.items():
        part = cosine if m >= 0 else sine
        part[start[abs(m)] + (n - abs(m)) // 2] = value * normalisation(n, m)
    steps = [_recurrence(k, m) for m in rows for k in range(orders[m])]
    alpha, beta, gamma = np.array(steps, dtype=np.float64).reshape(-1, 3).T.copy()
    series = RadialSeries(np.array(rows, dtype=np.int32), count, offset, cosine, sine, alpha, beta, gamma)
    for table in vars(series).values():
        table.setflags(write=False)
    return series


@dataclass(frozen=True)
class PowerRows:
    """A `RadialSeries` as rows c(t) B for evaluation by Horner's rule: see kernels/zernike_power.cl.

    order, sine, count: int32 [rows], azimuthal order m (ascending), 1 for the sine part, number of powers;
    coefficient: float64 [sum of count], each row's powers of t from the highest down. loss: how much larger the powers'
    coefficients are than the Jacobi series', the factor by which rounding errors grow; at most 1 where there is no row.
    """

    order: NDArray[np.int32]
    sine: NDArray[np.int32]
    count: NDArray[np.int32]
    coefficient: NDArray[np.float64]
    loss: float


def power_rows(series: RadialSeries) -> PowerRows:
    """Expand each part of a series that is not zero in powers of t.

    On [-1, 1] the powers of t cancel each other: `loss` says by how much, little for few radial terms of low order.
    """
    rows, coefficients, loss = [], [], 1.0
    for m, count, first in zip(series.m, series.count, series.offset, strict=True):
        terms = slice(first, first + count)
        for sine, part in enumerate((series.cosine[terms], series.sine[terms])):
            used = np.flatnonzero(part)
            if len(used) == 0:
                continue
            powers, before, now = np.zeros(1), np.zeros(1), np.ones(1)
            for k in range(used[-1] + 1):
                powers = np.polynomial.polynomial.polyadd(powers, part[k] * now)
                step = [series.beta[terms][k], series.alpha[terms][k]]
                following = np.polynomial.polynomial.polyadd(
                    np.polynomial.polynomial.polymul(step, now), series.gamma[terms][k] * before
                )
                before, now = now, following
            rows.append((m, sine, len(powers)))
            coefficients.append(powers[::-1])
            loss = max(loss, float(np.abs(powers).sum() / np.abs(part).sum()))
    order, sine, count = np.array(rows, np.int32).reshape(-1, 3).T
    return PowerRows(order, sine, count, np.concatenate([np.zeros(0), *coefficients]), loss)


def evaluate_series(
    series: RadialSeries, x: ArrayLike, y: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """W, dW/dx and dW/dy of a `RadialSeries` at unit-disk coordinates; the float64 twin of the device code.

    Each result has the broadcast shape of ``x`` and ``y``; the slopes are per unit-disk coordinate.
    """
    x, y = _broadcast(x, y)
    result = np.empty((3, x.size))
    flat_x, flat_y = x.ravel(), y.ravel()
    for first in range(0, x.size, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        result[:, part] = _evaluate(series, flat_x[part], flat_y[part])
    return tuple(result.reshape(3, *x.shape))


def _evaluate(series: RadialSeries, x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
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


def zernike_fit(
    x: ArrayLike,
    y: ArrayLike,
    values: ArrayLike,
    indices: Sequence[int],
    ordering: str = "noll",
    weights: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Least-squares coefficients [len(indices)] of Noll-normalised terms, in the order of ``indices``.

    Minimises sum weights (values - fit)^2 over the samples that are finite, lie on the unit disk and have a
    positive weight; weights are 1 by default (for noise use 1/variance). ``x``, ``y``, ``values`` and
    ``weights`` broadcast together. The coefficients have the unit of ``values``.

    Raises ValueError for no or invalid indices, negative or non-finite weights, fewer usable samples than
    terms, or samples that cannot tell the terms apart.
    """
    if len(indices) == 0:
        raise ValueError("a Zernike fit needs at least one index")
    weights = np.asarray(1.0 if weights is None else weights, dtype=np.float64)
    if not np.all(np.isfinite(weights) & (weights >= 0.0)):
        raise ValueError("the weights of a Zernike fit must be finite and not negative")
    samples = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x, y, values)), weights)
    x, y, values, weights = samples
    usable = np.isfinite(x) & np.isfinite(y) & np.isfinite(values) & (weights > 0.0)
    usable[usable] = np.hypot(x[usable], y[usable]) <= 1.0 + _RIM_TOLERANCE
    count = np.count_nonzero(usable)
    if count < len(indices):
        raise ValueError(f"{len(indices)} Zernike terms cannot be fitted to {count} samples")
    terms = [zernike(j, x[usable], y[usable], ordering) for j in indices]
    root = np.sqrt(weights[usable])
    solution, _, rank, _ = np.linalg.lstsq(np.stack(terms, axis=1) * root[:, None], values[usable] * root)
    if rank < len(indices):
        raise ValueError(f"the samples tell only {rank} of the {len(indices)} Zernike terms apart")
    return solution


def _check_ordering(ordering: str) -> None:
    if ordering not in ORDERINGS:
        raise ValueError(f"unknown Zernike ordering {ordering!r}; allowed: {', '.join(ORDERINGS)}")


def _integer(value: int, name: str) -> int:
    try:
        return operator.index(value)
    except TypeError:
        raise ValueError(f"{name} must be an integer, got {value!r}") from None


def _checked_nm(n: int, m: int) -> tuple[int, int]:
    n, m = _integer(n, "Zernike order n"), _integer(m, "Zernike order m")
    if abs(m) > n or (n - m) % 2:
        raise ValueError(f"no Zernike term (n, m) = ({n}, {m}): |m| <= n and n - m even are needed")
    return n, m


def _fringe_to_nm(j: int) -> tuple[int, int]:
    # Fringe groups share half = (n + |m|)/2, end at the square (half + 1)^2 and step |m| down to 0.
    half = math.isqrt(j - 1)
    behind = (half + 1) ** 2 - j
    m = (behind + 1) // 2
    return 2 * half - m, m if behind % 2 == 0 else -m


def _broadcast(x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))


def _recurrence(k: int, m: int) -> tuple[float, float, float]:
    """(alpha, beta, gamma) of P_{k+1} = (alpha t + beta) P_k + gamma P_{k-1} for P^(0,m), DLMF 18.9.2."""
    scale = 2.0 * (k + 1) * (k + 1 + m)
    alpha = (2 * k + m + 1) * (2 * k + m + 2) / scale
    if k == 0:
        return alpha, -0.5 * m, 0.0  # the general form is 0/0 for m = 0
    beta = -(2 * k + m + 1) * m * m / (scale * (2 * k + m))
    gamma = -2 * k * (k + m) * (2 * k + m + 2) / (scale * (2 * k + m))
    return alpha, beta, gamma


def _jacobi(degree: int, m: int, t: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """P_degree^(0,m)(t) and its derivative by t."""
    previous, value = np.zeros_like(t), np.ones_like(t)
    previous_slope, slope = np.zeros_like(t), np.zeros_like(t)
    for k in range(degree):
        alpha, beta, gamma = _recurrence(k, m)
        line = alpha * t + beta
        previous_slope, slope = slope, alpha * value + line * slope + gamma * previous_slope
        previous, value = value, line * value + gamma * previous
    return value, slope


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
