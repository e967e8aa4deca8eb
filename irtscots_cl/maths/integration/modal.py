"""Modal integration: the gradients of Zernike polynomials fitted to the slopes, island by island.

The Zernike polynomials up to a radial order span all polynomials of that degree in x and y, for any disk. The disk
around the island, scaled to its extents in x and y, only keeps the fit well conditioned.

Source: R. Cubalchini, J. Opt. Soc. Am. 69, 972 (1979).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.integration.node_graph import NodeGraph
from irtscots_cl.maths.zernike.polynomials import zernike, zernike_gradient

MAX_ORDER = 24  # 324 terms

_ORDER_FACTOR = 2.5
_LEVER = 0.5  # of the island's diagonal; disks, rings, strips, crosses and the letters C and L reach 0.2 to 0.5
_BLOCK = 8192  # nodes processed at a time: 42 MB of gradients at the highest order
_RANK = 1e-10  # polynomials whose relative slopes at the nodes are smaller count as flat there

Values = NDArray[np.float64]


def modal_heights(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values) -> Values:
    """Heights [maps, nodes] in mm of the fit to slopes ``p``, ``q`` [maps, nodes] at ``x``, ``y`` [nodes] in mm.

    Every island has its own fit, up to `radial_order`, and a mean of 0.
    """
    heights = np.zeros_like(p)
    by_island = np.argsort(graph.islands, kind="stable")
    for nodes in np.split(by_island, np.cumsum(np.bincount(graph.islands))[:-1]):
        if nodes.size > 1:
            heights[:, nodes] = _fit(x[nodes], y[nodes], p[:, nodes], q[:, nodes])
    return graph.without_piston(heights)


def radial_order(nodes: int) -> int:
    """The highest radial order that is fitted to an island of so many nodes.

    It grows as the root of the number of nodes across a disk with as many nodes: polynomials of higher degree oscillate
    between evenly spaced nodes near the edge. With _ORDER_FACTOR 2.5 white noise has at most 1.15 times
    Southwell's effect on disks of 3 to 105 nodes across, annuli, strips, crosses and ellipses; with 3 it has up to 1.5
    times that. There are at most two more terms than nodes, so that three nodes have a quadratic. The order is at most
    MAX_ORDER.
    """
    across = math.sqrt(4 / math.pi * nodes)
    order = min(int(_ORDER_FACTOR * math.sqrt(across)), MAX_ORDER)
    while _count(order) > nodes + 2:
        order -= 1
    return order


def _fit(x: Values, y: Values, p: Values, q: Values) -> Values:
    """Heights [maps, nodes] of one island, up to a piston.

    The order is limited to polynomials that have slopes at the nodes. For example, on a strip of three rows some
    polynomials of degree four have almost no slope at the nodes but any height.
    """
    (u, half_x), (v, half_y) = _centred(x), _centred(y)
    reach = np.hypot(u, v).max() or 1.0
    u, v, half_x, half_y = u / reach, v / reach, half_x * reach, half_y * reach
    order, diagonal = radial_order(x.size), np.hypot(np.ptp(x), np.ptp(y))
    slopes, heights, projected = _triangles(u, v, half_x, half_y, p, q, _count(order))
    for count in map(_count, range(order, 0, -1)):
        left, slope, right = np.linalg.svd(slopes[:count, :count])
        height = heights[:count, :count] @ right.T  # heights of the polynomials with these slopes
        seen = slope > _RANK * slope[0]
        lever = np.linalg.norm(height[:, seen] / slope[seen], 2)
        unseen = np.linalg.norm(height[:, ~seen])
        if lever <= _LEVER * diagonal and unseen <= 100 * _RANK * np.linalg.norm(height):
            break
    coefficients = right[seen].T @ ((left.T @ projected[:, :count].T)[seen] / slope[seen][:, None])
    fitted: Values = sum(c[:, None] * zernike(j, u, v) for j, c in enumerate(coefficients, start=2))
    return fitted


def _count(order: int) -> int:
    """Zernike terms up to a radial order, without piston."""
    return order * (order + 3) // 2


def _triangles(
    u: Values, v: Values, half_x: float, half_y: float, p: Values, q: Values, count: int
) -> tuple[Values, Values, Values]:
    """QR factors of the first ``count`` terms after piston, at u = x/half_x, v = y/half_y.

    Returns R of their slopes and of their heights without the mean, [count, count], and the slopes p, q [maps, nodes]
    times Q, [maps, count]. Leading blocks of R are those of fewer terms.
    """
    from scipy.linalg import qr_multiply

    slopes, heights, projected = np.empty((0, count)), np.empty((0, 1 + count)), np.empty((len(p), 0))
    for start in range(0, u.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        terms = [zernike(j, u[part], v[part]) for j in range(1, count + 2)]
        rows = np.concatenate([heights, np.transpose(terms)])
        heights = np.linalg.qr(rows, mode="r")  # type: ignore[assignment]  # NumPy's types leave R alone out
        gradients = np.array([zernike_gradient(j, u[part], v[part]) for j in range(2, count + 2)])
        along_x, along_y = np.moveaxis(gradients, 0, -1)
        rows = np.concatenate([slopes, along_x / half_x, along_y / half_y])
        projected, slopes = qr_multiply(rows, np.concatenate([projected, p[:, part], q[:, part]], axis=1))
    return slopes, heights[1:, 1:], projected


def _centred(position: Values) -> tuple[Values, float]:
    """Positions from the middle of their range, in units of half the range, and that half (1 if all are the same)."""
    low, high = position.min(), position.max()
    half = (high - low) / 2 or 1.0
    return (position - (low + high) / 2) / half, half
