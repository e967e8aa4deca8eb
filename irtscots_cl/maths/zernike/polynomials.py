"""Zernike polynomials on the unit disk: values and gradients.

Coordinates are dimensionless (position over pupil radius). Values are always Noll-normalised (rms 1 over the
unit disk) for any numbering. ``m > 0`` is a cosine term, ``m < 0`` a sine term, the angle counted
from +x towards +y.

With s = x^2 + y^2, t = 2 s - 1, zeta = x + i y and k = (n - |m|)/2 every polynomial is

    N P_k^(0,|m|)(t) Re zeta^m   (m >= 0)    or    N P_k^(0,|m|)(t) Im zeta^|m|   (m < 0)

with P the Jacobi polynomial and N = sqrt(n + 1), times sqrt(2) unless m = 0. There is no division by rho and
no angle, so the origin is an ordinary point. The recurrence in k avoids the cancellation of the factorial sum.

Sources: R. J. Noll, J. Opt. Soc. Am. 66, 207 (1976), for normalisation and numbering; ANSI Z80.28 / L. N.
Thibos et al., J. Refract. Surg. 18, S652 (2002), for OSA; J. C. Wyant and K. Creath, Applied Optics and
Optical Engineering XI, 28 (1992), for the University of Arizona fringe set; DLMF 18.9.2 for the Jacobi
recurrence.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irtscots_cl.maths.zernike.indices import index_to_nm
from irtscots_cl.system import interruption


def normalisation(n: int, m: int) -> float:
    """Noll's factor that makes the rms over the unit disk 1: sqrt(n + 1), times sqrt(2) unless m = 0."""
    return math.sqrt((n + 1) * (1 if m == 0 else 2))


def zernike(j: int, x: ArrayLike, y: ArrayLike, ordering: str = "noll") -> NDArray[np.float64]:
    """Noll-normalised Zernike polynomial ``j`` at unit-disk coordinates ``x``, ``y``.

    ``ordering`` selects only the numbering. Returns the broadcast shape of ``x`` and ``y``. Points outside the
    disk get the polynomial itself. Raises ValueError as `index_to_nm` does, or if the shapes do not
    broadcast.
    """
    interruption.check()
    n, m = index_to_nm(j, ordering)
    x, y = broadcast_points(x, y)
    radial, _ = _jacobi((n - abs(m)) // 2, abs(m), 2.0 * (x * x + y * y) - 1.0)
    power: NDArray[np.complex128] = (x + 1j * y) ** abs(m)
    return normalisation(n, m) * radial * (power.real if m >= 0 else power.imag)


def zernike_gradient(
    j: int, x: ArrayLike, y: ArrayLike, ordering: str = "noll"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives (d/dx, d/dy) of `zernike` per unit-disk coordinate, each of the broadcast shape.

    Exact at the origin. Divide by the pupil radius for a derivative per length. Raises as `zernike`.
    """
    n, m = index_to_nm(j, ordering)
    x, y = broadcast_points(x, y)
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


def broadcast_points(x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    on_x, on_y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    return on_x, on_y


def recurrence(k: int, m: int) -> tuple[float, float, float]:
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
        alpha, beta, gamma = recurrence(k, m)
        line = alpha * t + beta
        previous_slope, slope = slope, alpha * value + line * slope + gamma * previous_slope
        previous, value = value, line * value + gamma * previous
    return value, slope
