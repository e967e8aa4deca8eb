"""The integration methods by name, and the checks of their arguments. The package's docstring describes the methods."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irtscots_cl.maths.integration.modal import modal_heights
from irtscots_cl.maths.integration.node_graph import node_graph
from irtscots_cl.maths.integration.zonal_rules import cubic_rises, southwell_rises, spline_rises

_RISES = {"southwell": southwell_rises, "cubic": cubic_rises, "spline": spline_rises}
METHODS = (*_RISES, "modal")


def integrate_slopes(
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    slope_x: ArrayLike,
    slope_y: ArrayLike,
    mask: ArrayLike,
    method: str = "southwell",
) -> NDArray[np.float64]:
    """Heights z_mm whose slopes fit ``slope_x`` = dz/dx and ``slope_y`` = dz/dy best.

    Parameters
    ----------
    x_mm, y_mm : [rows, columns], true positions of the nodes; ignored outside the mask
    slope_x, slope_y : [..., rows, columns], slopes (rise over run); leading axes are independent maps
    mask : bool [rows, columns], the nodes to use
    method : "southwell", "cubic", "spline" or "modal" (see irtscots_cl.maths.integration)

    Returns [..., rows, columns] in mm, NaN outside the mask, zero mean over every island of the mask.

    Raises ValueError for an unknown method, a shape that does not fit, an empty or non-boolean mask, positions
    or slopes that are not finite inside the mask, or, by cubic and spline, neighbours that lie at one place.
    """
    if method not in METHODS:
        raise ValueError(f"unknown integration method {method!r}; allowed: {', '.join(METHODS)}")
    graph = node_graph(mask)
    x, y = graph.values("x_mm", x_mm)[0], graph.values("y_mm", y_mm)[0]
    lead = np.shape(slope_x)[:-2]
    p, q = graph.values("slope_x", slope_x, lead), graph.values("slope_y", slope_y, lead)
    if method in _RISES:
        nodes = graph.heights(_RISES[method](graph, x, y, p, q))
    else:
        nodes = modal_heights(graph, x, y, p, q)
    z_mm = np.full((*lead, *graph.mask.shape), np.nan)
    z_mm[..., graph.mask] = nodes.reshape(*lead, nodes.shape[1])
    return z_mm
