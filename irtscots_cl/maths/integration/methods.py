"""The integration methods by name, and the checks of their arguments. The package's docstring describes the methods."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irtscots_cl.maths.integration.islands import NOISE_NODES, Islands, apart, joined, with_pistons
from irtscots_cl.maths.integration.misfit import slope_noise
from irtscots_cl.maths.integration.modal import modal_heights
from irtscots_cl.maths.integration.node_graph import RESIDUAL, node_graph
from irtscots_cl.maths.integration.zonal_rules import cubic_rises, southwell_rises, spline_rises

_RISES = {"southwell": southwell_rises, "cubic": cubic_rises, "spline": spline_rises}
METHODS = (*_RISES, "modal")


@dataclass(frozen=True)
class Integration:
    """Heights z_mm [..., rows, columns] in mm, NaN outside the mask, and the islands that they stand on."""

    z_mm: NDArray[np.float64] = field(repr=False)
    islands: Islands


def integrate_slopes(
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    slope_x: ArrayLike,
    slope_y: ArrayLike,
    mask: ArrayLike,
    method: str = "southwell",
    join: bool | Islands = True,
) -> NDArray[np.float64]:
    """Heights z_mm whose slopes fit ``slope_x`` = dz/dx and ``slope_y`` = dz/dy best.

    Parameters
    ----------
    x_mm, y_mm : [rows, columns], true positions of the nodes; ignored outside the mask
    slope_x, slope_y : [..., rows, columns], slopes (rise over run); leading axes are independent maps
    mask : bool [rows, columns], the nodes to use
    method : "southwell", "cubic", "spline" or "modal" (see irtscots_cl.maths.integration)
    join : whether islands are joined across small gaps, or how: as in an earlier `integrate` over the same nodes

    Returns [..., rows, columns] in mm, NaN outside the mask, zero mean over every group of joined islands.

    Raises ValueError for an unknown method, a shape that does not fit, an empty or non-boolean mask, positions
    or slopes that are not finite inside the mask, or, by cubic and spline, neighbours that lie at one place.
    """
    return integrate(x_mm, y_mm, slope_x, slope_y, mask, method, join).z_mm


def integrate(
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    slope_x: ArrayLike,
    slope_y: ArrayLike,
    mask: ArrayLike,
    method: str = "southwell",
    join: bool | Islands = True,
    *,
    start: NDArray[np.float64] | None = None,
    residual: float = RESIDUAL,
) -> Integration:
    """As `integrate_slopes`, with what became of the mask's islands.

    Which islands are joined follows from the first map; the others are joined in the same way. start: heights [...,
    rows, columns] in mm near the result, and residual: of the least squares, for masks so large that they are solved by
    iteration. Raises ValueError as `integrate_slopes` does, and for islands of another mask.
    """
    if method not in METHODS:
        raise ValueError(f"unknown integration method {method!r}; allowed: {', '.join(METHODS)}")
    graph = node_graph(mask)
    x, y = graph.values("x_mm", x_mm)[0], graph.values("y_mm", y_mm)[0]
    lead = np.shape(slope_x)[:-2]
    p, q = graph.values("slope_x", slope_x, lead), graph.values("slope_y", slope_y, lead)

    def solve(
        p: NDArray[np.float64], q: NDArray[np.float64], near: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        if method in _RISES:
            return graph.heights(_RISES[method](graph, x, y, p, q), near, residual)
        return modal_heights(graph, x, y, p, q)

    near = None if start is None else np.nan_to_num(start[..., graph.mask]).reshape(-1, x.size)
    nodes = solve(p, q, near)
    if isinstance(join, Islands):
        if not np.array_equal(join.mask, graph.mask):
            raise ValueError("join: the islands are those of another mask")
        islands = join
    elif join and graph.islands.any() and len(p):
        noise = slope_noise(graph, x, y, p[:1], q[:1]) if len(x) <= NOISE_NODES else 0.0
        islands = joined(graph, x, y, p[0], q[0], nodes[0], solve, noise)
    else:
        islands = apart(graph)
    nodes = with_pistons(islands, p, q, nodes)
    z_mm = np.full((*lead, *graph.mask.shape), np.nan)
    z_mm[..., graph.mask] = nodes.reshape(*lead, nodes.shape[1])
    return Integration(z_mm, islands)
