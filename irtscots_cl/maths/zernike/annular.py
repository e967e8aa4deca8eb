"""Zernike polynomials on an annulus: orthonormal over a pupil with a central hole.

With zeta = x + i y, s = x^2 + y^2 and k = (n - |m|)/2 a polynomial is f(s) Re zeta^m (m >= 0) or f(s) Im zeta^|m|
(m < 0). f has degree k, and the f of one m are orthogonal over ratio^2 <= s <= 1 with the weight s^|m|; f(s) s^(|m|/2)
is the radial polynomial of the source. Each has rms 1 over the annulus and a positive leading coefficient. For a ratio
of 0 they are the polynomials of `zernike`.

Sources: V. N. Mahajan, J. Opt. Soc. Am. 71, 75 (1981); W. Gautschi, Orthogonal Polynomials (2004), section 2.2.3.1, for
the recurrence from a quadrature.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irtscots_cl.maths.zernike.indices import index_to_nm
from irtscots_cl.maths.zernike.polynomials import broadcast_points


def annular_zernike(j: int, x: ArrayLike, y: ArrayLike, ratio: float, ordering: str = "noll") -> NDArray[np.float64]:
    """Annular polynomial ``j`` at coordinates ``x``, ``y`` in units of the outer radius.

    ratio: inner over outer radius, 0 to below 1. Returns the broadcast shape of ``x`` and ``y``; points off the annulus
    get the polynomial itself. Raises ValueError for another ratio, and as `zernike` does.
    """
    n, m = index_to_nm(j, ordering)
    if not 0 <= ratio < 1:
        raise ValueError(f"ratio = {ratio!r}: must be at least 0 and below 1")
    x, y = broadcast_points(x, y)
    centre, scale, recurrence, norm = _recurrence((n - abs(m)) // 2, abs(m), float(ratio))
    t = (x * x + y * y - centre) / scale
    before, value = np.zeros_like(t), np.ones_like(t)
    for alpha, beta in recurrence:
        before, value = value, (t - alpha) * value - beta * before
    power: NDArray[np.complex128] = (x + 1j * y) ** abs(m)
    return norm * value * (power.real if m >= 0 else power.imag)


def annular_step(k: int, m: int, ratio: float) -> tuple[float, float, float]:
    """(alpha, beta, gamma) of P_{k+1} = (alpha t + beta) P_k + gamma P_{k-1} for the radial part over rho^m.

    P_k is 1 at the outer rim; t = 2 s - 1 there runs from -1 in the middle of the hole to 1. m at least 0.
    """
    centre, scale, steps, _ = _recurrence(k + 1, m, float(ratio))
    rim = _rim_values(steps)
    shift, square = steps[k]
    growth = rim[k] / rim[k + 1]
    alpha, beta = growth / (2 * scale), growth * ((0.5 - centre) / scale - shift)
    return alpha, beta, -square * rim[k - 1] / rim[k + 1] if k else 0.0


def annular_rim_value(n: int, m: int, ratio: float) -> float:
    """Largest value of the annular polynomial (n, m) on the outer rim, over angles."""
    _, _, steps, norm = _recurrence((n - abs(m)) // 2, abs(m), float(ratio))
    return norm * _rim_values(steps)[-1]


def _rim_values(steps: tuple[tuple[float, float], ...]) -> list[float]:
    """Monic polynomials of a recurrence at the outer rim, t = 1."""
    values = [1.0]
    for k, (shift, square) in enumerate(steps):
        values.append((1.0 - shift) * values[k] - (square * values[k - 1] if k else 0.0))
    return values


@lru_cache(maxsize=1024)
def _recurrence(degree: int, m: int, ratio: float) -> tuple[float, float, tuple[tuple[float, float], ...], float]:
    """Centre and scale of t, (alpha, beta) of P_{k+1} = (t - alpha) P_k - beta P_{k-1}, and the norm.

    t = (s - centre) / scale runs from -1 to 1. Gauss's quadrature with degree + m/2 + 1 nodes is exact for all
    integrals.
    """
    centre, scale = (1 + ratio * ratio) / 2, (1 - ratio * ratio) / 2
    node, weight = np.polynomial.legendre.leggauss(degree + m // 2 + 2)
    weight = weight * (centre + scale * node) ** m / 2  # a mean over s; over the annulus it is the mean over the area
    found, before, value, square = [], np.zeros_like(node), np.ones_like(node), weight.sum()
    beta = 0.0
    for _ in range(degree):
        alpha = float((weight * node * value**2).sum() / square)
        found.append((alpha, beta))
        before, value = value, (node - alpha) * value - beta * before
        square, last = (weight * value**2).sum(), square
        beta = float(square / last)
    return centre, scale, tuple(found), math.sqrt((1 if m == 0 else 2) / square)
