"""Sums of Zernike terms as tables for the kernels. evaluation.py evaluates them on the host."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.zernike.annular import annular_rim_value, annular_step
from irtscots_cl.maths.zernike.indices import checked_nm
from irtscots_cl.maths.zernike.polynomials import normalisation, recurrence


@dataclass(frozen=True, eq=False)
class RadialSeries:
    """Tables of W = sum over rows of Re[conj(a(t)) zeta^m], a = sum_k (cosine_k + i sine_k) P_k(t).

    zeta = x + i y and t = 2 (x^2 + y^2) - 1 on the unit disk. One row per azimuthal order present, ascending: P_k is
    the Jacobi polynomial P_k^(0,m). Sets of terms with other recurrences have rows of their own (joined_series).
    Row r owns the entries ``offset[r]`` to ``offset[r] + count[r] - 1`` of the flat tables, k from 0.
    ``cosine`` and ``sine`` include the normalisation and have the unit of the given coefficients.

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


def radial_series(terms: Mapping[tuple[int, int], float], ratio: float = 0.0, size: float = 1.0) -> RadialSeries:
    """Tables that evaluate the sum of ``terms``, a mapping {(n, m): coefficient of the Noll-normalised term}.

    ratio: above 0 for annular terms (annular.py). size: radius of the terms' disk, at least 1, over the one on which
    the tables are evaluated. A term with coefficient 0 keeps its place in the tables; an empty mapping gives empty
    tables. Raises ValueError for an invalid (n, m) or a coefficient that is not finite.
    """
    orders: dict[int, int] = {}
    for (n, m), value in terms.items():
        n, m = checked_nm(n, m)
        if not math.isfinite(value):
            raise ValueError(f"Zernike coefficient of (n, m) = ({n}, {m}) is not finite: {value}")
        orders[abs(m)] = max(orders.get(abs(m), 0), (n - abs(m)) // 2 + 1)
    rows = sorted(orders)
    count = np.array([orders[m] for m in rows], dtype=np.int32)
    offset = np.array([count[:row].sum() for row in range(len(rows))], dtype=np.int32)
    start = dict(zip(rows, offset.tolist(), strict=True))
    cosine, sine = np.zeros((2, int(count.sum())))
    for (n, m), value in terms.items():
        part, k = cosine if m >= 0 else sine, (n - abs(m)) // 2
        norm = annular_rim_value(n, m, ratio) * size ** -abs(m) if ratio else normalisation(n, m) * size ** -abs(m)
        part[start[abs(m)] + k] = value * norm
    steps = [_step(k, m, ratio, size) for m in rows for k in range(orders[m])]
    alpha, beta, gamma = np.array(steps, dtype=np.float64).reshape(-1, 3).T.copy()
    return _frozen(RadialSeries(np.array(rows, dtype=np.int32), count, offset, cosine, sine, alpha, beta, gamma))


def joined_series(parts: Sequence[RadialSeries]) -> RadialSeries:
    """The sum of series, each row with its own recurrence; rows are in ascending azimuthal order."""
    if len(parts) == 1:
        return parts[0]
    rows = sorted(
        ((int(m), part, k) for part, p in enumerate(parts) for k, m in enumerate(p.m)), key=lambda row: row[0]
    )
    places = [(parts[part], slice(int(parts[part].offset[k]), int(parts[part].offset[k] + parts[part].count[k])))
              for _, part, k in rows]  # fmt: skip
    count = np.array([place.stop - place.start for _, place in places], dtype=np.int32)
    offset = np.append(0, np.cumsum(count)[:-1]).astype(np.int32)
    tables = [
        np.concatenate([getattr(part, name)[place] for part, place in places])
        for name in ("cosine", "sine", "alpha", "beta", "gamma")
    ]
    return _frozen(RadialSeries(np.array([m for m, _, _ in rows], dtype=np.int32), count, offset, *tables))


def _step(k: int, m: int, ratio: float, size: float) -> tuple[float, float, float]:
    """(alpha, beta, gamma) of a row in t of the evaluation's disk, which is ``size`` times smaller than the terms'."""
    alpha, beta, gamma = annular_step(k, m, ratio) if ratio else recurrence(k, m)
    inverse = size**-2  # 2 s - 1 on the terms' disk is inverse (t + 1) - 1
    return alpha * inverse, beta + alpha * (inverse - 1.0), gamma


def _frozen(series: RadialSeries) -> RadialSeries:
    for table in vars(series).values():
        table.setflags(write=False)
    return series


@dataclass(frozen=True)
class PowerRows:
    """A `RadialSeries` as rows c(t) B for evaluation by Horner's rule: see kernels/mirror/zernike_power.cl.

    order, sine, count: int32 [rows], azimuthal order m (ascending), 1 for the sine part, number of powers;
    coefficient: float64 [sum of count], each row's powers of t from the highest down. loss: the powers'
    coefficients relative to the Jacobi series', the factor by which rounding errors grow; at most 1 without rows.
    """

    order: NDArray[np.int32]
    sine: NDArray[np.int32]
    count: NDArray[np.int32]
    coefficient: NDArray[np.float64]
    loss: float


def power_rows(series: RadialSeries) -> PowerRows:
    """Expand each non-zero part of a series in powers of t.

    On [-1, 1] the powers of t cancel each other. `loss` measures this; it is small for few radial terms of low order.
    """
    rows: dict[tuple[int, int], NDArray[np.float64]] = {}
    loss = 1.0
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
            key = int(m), sine
            rows[key] = np.asarray(np.polynomial.polynomial.polyadd(rows.get(key, np.zeros(1)), powers), np.float64)
            loss = max(loss, float(np.abs(powers).sum() / np.abs(part).sum()))
    orders, sines = np.array(list(rows), np.int32).reshape(-1, 2).T
    counts = np.array([len(powers) for powers in rows.values()], np.int32)
    coefficients = [powers[::-1] for powers in rows.values()]
    return PowerRows(orders, sines, counts, np.concatenate([np.zeros(0), *coefficients]), loss)
