"""Forbes's polynomials for aspheres, Qcon and Qbfs, summed at one point. Plain Python: scenes are checked with them.

Sources: G. W. Forbes, "Shape specification for axially symmetric optical surfaces", Opt. Express 15, 5218 (2007), and
for the recurrence of Qbfs "Robust, efficient computational methods for axially symmetric optical aspheres", Opt.
Express 18, 19700 (2010), equations A.14 to A.16.
"""

from __future__ import annotations

import math
from collections.abc import Mapping


def sum_q_con(coefficients: Mapping[int, float], x: float) -> float:
    """Sum of a_m Qcon_m(x), x = u^2 from 0 to 1: the Jacobi polynomials P_m^(0,4)(2 x - 1), 1 at x = 1."""
    below, now, total = 0.0, 1.0, 0.0
    for m in range(max(coefficients, default=-1) + 1):
        total += coefficients.get(m, 0.0) * now
        n, size = m + 1, 2 * m + 6  # of the next polynomial: its degree, and 2 n + alpha + beta
        middle = (size - 1) * (size * (size - 2) * (2 * x - 1) - 16) * now
        below, now = now, (middle - 2 * (n - 1) * (n + 3) * size * below) / (2 * n * (n + 4) * (size - 2))
    return total


def sum_q_bfs(coefficients: Mapping[int, float], x: float) -> float:
    """Sum of a_m Qbfs_m(x), x = u^2 from 0 to 1; the slopes along the normal of u^2 (1 - u^2) Qbfs_m are orthogonal."""
    third_kind = [2.0, 6.0 - 8.0 * x]  # Chebyshev polynomials, to scale
    f, g, h = [2.0, math.sqrt(19.0) / 2], [-0.5], list[float]()
    q = [1.0, (third_kind[1] - g[0]) / f[1]]
    for m in range(2, max(coefficients, default=0) + 1):
        third_kind.append((2.0 - 4.0 * x) * third_kind[-1] - third_kind[-2])
        h.append(-m * (m - 1) / (2 * f[m - 2]))
        g.append(-(1 + g[m - 2] * h[m - 2]) / f[m - 1])
        f.append(math.sqrt(m * (m + 1) + 3 - g[m - 1] ** 2 - h[m - 2] ** 2))
        q.append((third_kind[m] - g[m - 1] * q[m - 1] - h[m - 2] * q[m - 2]) / f[m])
    return math.fsum(value * q[m] for m, value in coefficients.items())
