"""The misfit of integration: the part of the slopes that no surface has.

Slopes of a surface have no curl: around every loop of nodes their rises add up to 0. What the least-squares heights
leave of the rises is the part with curl. Noise has such a part, and so have many faults of a measurement: images that
are turned, mirrored or exchanged, wrong line positions, a lost frame. The rises are those of `cubic_rises` for every
integration method: a smooth surface must not have a misfit from the rule itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irtscots_cl.maths.integration.node_graph import NodeGraph, node_graph
from irtscots_cl.maths.integration.zonal_rules import cubic_rises

NOISE_LIMIT = 1.5  # times the misfit that the noise of the slopes leaves
SHARE_LIMIT = 0.01  # of the rms slope: pixels, edges and lines of a screen leave up to half of that without noise
UNKNOWN_NOISE_SHARE = 0.1  # of the rms slope where the noise is not known
LEAST_LIMIT = 0.05e-6  # rad: what cannot matter, on a mirror that has no deviation
DRAWS = 16  # maps of noise: of some thousand loops each, so that their mean is known to a percent;
_DRAWN_NODES = 200_000  # in all maps of noise: large masks need fewer maps

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Misfit:
    """Rms misfit of integration as a slope [rad], beside what known errors leave of it, and the rms slope itself.

    slope: root mean square over all pairs of neighbours of (rise - difference of heights) / distance, corrected for
    the heights that were fitted. expected: the same of noise alone, NaN where the noise is unknown. rms_slope: of the
    slopes without their mean. NaN for a mask without a loop. systematic: the misfit of errors that are known, but no
    noise.
    """

    slope: float
    expected: float
    rms_slope: float
    systematic: float = 0.0

    @property
    def limit(self) -> float:
        """Largest misfit [rad] that noise, known errors or the pixels explain.

        The largest of NOISE_LIMIT x expected and systematic as squares, SHARE_LIMIT x rms_slope and LEAST_LIMIT;
        UNKNOWN_NOISE_SHARE x rms_slope where the noise is unknown.
        """
        noise, share = (self.expected, SHARE_LIMIT) if np.isfinite(self.expected) else (0.0, UNKNOWN_NOISE_SHARE)
        return max(NOISE_LIMIT * float(np.hypot(noise, self.systematic)), share * self.rms_slope, LEAST_LIMIT)

    @property
    def suspicious(self) -> bool:
        """Whether the misfit is above its limit."""
        return bool(self.slope > self.limit)


def integration_misfit(
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    slope_x: ArrayLike,
    slope_y: ArrayLike,
    mask: ArrayLike,
    noise_x: ArrayLike | None = None,
    noise_y: ArrayLike | None = None,
    systematic: tuple[ArrayLike, ArrayLike] | None = None,
) -> Misfit:
    """The `Misfit` of slopes [rows, columns] at the nodes x_mm, y_mm of a mask, as for `integrate_slopes`.

    noise_x, noise_y: standard errors of the slopes [rows, columns], if they are known; their errors count as
    independent. systematic: other errors of the slopes (x, y) [rows, columns] that are known. Raises ValueError as
    `integrate_slopes` does.
    """
    graph = node_graph(mask)
    x, y = graph.values("x_mm", x_mm)[0], graph.values("y_mm", y_mm)[0]
    p, q = graph.values("slope_x", slope_x), graph.values("slope_y", slope_y)
    rms_slope = float(np.sqrt(np.mean((p - p.mean()) ** 2 + (q - q.mean()) ** 2) / 2))
    expected = np.nan
    if noise_x is not None and noise_y is not None:
        draws = _draws(x.size)
        noise = [graph.values(f"noise_{a}", n) for a, n in (("x", noise_x), ("y", noise_y))]
        expected = _misfit(graph, x, y, noise[0] * draws[0], noise[1] * draws[1])
    known = 0.0
    if systematic is not None:
        known = _misfit(graph, x, y, *(graph.values("systematic", part) for part in systematic))
    return Misfit(_misfit(graph, x, y, p, q), expected, rms_slope, known)


def white_noise(misfit: Misfit, x_mm: ArrayLike, y_mm: ArrayLike, mask: ArrayLike) -> float:
    """Standard error [rad] of slopes whose white noise alone would leave this misfit; NaN for a mask without a loop.

    An upper bound of the noise where other faults leave a misfit too.
    """
    one = np.ones(np.shape(mask))
    return misfit.slope / integration_misfit(x_mm, y_mm, one, one, mask, one, one).expected


def slope_noise(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values) -> float:
    """As `white_noise`, of slopes p, q [maps, nodes] on a graph; 0 without a loop."""
    found = _misfit(graph, x, y, p, q)
    if np.isnan(found) or found == 0:
        return 0.0
    return found / _misfit(graph, x, y, *_draws(x.size))


def _draws(nodes: int) -> Values:
    """White noise [2, maps, nodes]."""
    maps = int(np.clip(_DRAWN_NODES // nodes, 1, DRAWS))
    return np.random.default_rng(0).standard_normal((2, maps, nodes))


def _misfit(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values) -> float:
    """Root mean square over maps, pairs and (rise left) / distance, per degree of freedom."""
    loops = graph.pairs.shape[1] - x.size + int(graph.islands.max()) + 1
    if loops < 1:
        return float("nan")
    i, j = graph.pairs
    rises = cubic_rises(graph, x, y, p, q)
    heights = graph.heights(rises)
    left = (rises - (heights[:, j] - heights[:, i])) / np.hypot(x[j] - x[i], y[j] - y[i])
    return float(np.sqrt(np.sum(left**2) / (len(p) * loops)))
