"""Rises of the surface from node to node, from slopes p = dz/dx, q = dz/dy and the nodes' true positions x, y.

Every rule integrates p dx + q dy along a curve through the nodes of a chain, an unbroken run of neighbours along a
row or a column. Between two nodes, positions and slopes are polynomials of the curve's parameter t, and their
integral is exact. A rule takes a `NodeGraph`, positions [nodes] and slopes [maps, nodes] and returns the rises [maps,
pairs] of the graph's pairs.

t is the length of the polygon through the nodes. Then a node away from its place in the grid, such as that of a pixel
at the mirror's edge, hardly bends the curve. With the node's index as t, the largest error on the deviation of
docs/accuracy.md is six times as large with `cubic_rises`, and ten times with `spline_rises`.

Sources: W. H. Southwell, J. Opt. Soc. Am. 70, 998 (1980); G. Li et al., J. Opt. Soc. Am. A 30, 1448 (2013), for four
nodes instead of two in a rise; L. Huang et al., Opt. Lasers Eng. 91, 221 (2017), for splines; Appl. Opt. 56, 5139
(2017), for rises between the nodes of irregular quadrilaterals.
"""

from __future__ import annotations

from collections import defaultdict
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.integration.node_graph import NodeGraph
from irtscots_cl.system import interruption

_STENCIL = 4  # nodes of a cubic

Values = NDArray[np.float64]
Numbers = NDArray[np.intp]
_Weighted = list[tuple[Numbers, Numbers, Values, Values]]
_LAST: WeakKeyDictionary[NodeGraph, tuple[Values, Values, _Weighted]] = WeakKeyDictionary()


def southwell_rises(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values) -> Values:
    """Rises [maps, pairs] along straight lines with linear slopes."""
    i, j = graph.pairs
    step_x, step_y = x[j] - x[i], y[j] - y[i]
    rises = np.empty((len(p), i.size))
    for rise, along_x, along_y in zip(rises, p, q, strict=True):  # map by map: less memory
        interruption.check()
        rise[:] = 0.5 * ((along_x.take(i) + along_x.take(j)) * step_x + (along_y.take(i) + along_y.take(j)) * step_y)
    return rises


def cubic_rises(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values) -> Values:
    """Cubics through the pair and the next node on either side; at the end of a chain, through its last four nodes.

    Chains of three nodes use parabolas, chains of two straight lines. Raises ValueError if neighbours coincide.
    """
    rises = np.zeros((len(p), graph.pairs.shape[1]))
    for pairs, nodes, weight_x, weight_y in _weighted(graph, x, y):
        for k, node in enumerate(nodes.T):
            interruption.check()
            rises[:, pairs] += p[:, node] * weight_x[:, k] + q[:, node] * weight_y[:, k]
    return rises


def spline_rises(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values) -> Values:
    """A cubic spline through all nodes of the chain, its third derivative continuous next to the ends too.

    Chains of three nodes use parabolas, chains of two straight lines. Raises ValueError if neighbours coincide.
    """
    from scipy.interpolate import CubicSpline  # imported late: it is slow, and one method wants it

    distance = _distances(graph, x, y)
    rises, start = np.empty((len(p), distance.size)), 0
    for chain in graph.chains:
        pairs = slice(start, start + chain.size - 1)
        values = np.concatenate([x[None, chain], y[None, chain], p[:, chain], q[:, chain]])
        pieces = CubicSpline(np.append(0.0, np.cumsum(distance[pairs])), values, axis=1).c[::-1]
        pieces *= distance[pairs, None] ** np.arange(4)[:, None, None]  # powers [power, pair, value] of t from 0 to 1
        moment_x, moment_y = _moments(pieces[..., :2].T)
        slope_x, slope_y = np.split(pieces[..., 2:], 2, axis=-1)
        rises[:, pairs] = np.einsum("jkm,kj->mk", slope_x, moment_x) + np.einsum("jkm,kj->mk", slope_y, moment_y)
        start = pairs.stop
    return rises


def _distances(graph: NodeGraph, x: Values, y: Values) -> Values:
    """Distances [pairs] between the nodes of each pair; ValueError if one is 0."""
    i, j = graph.pairs
    distance: Values = np.hypot(x[j] - x[i], y[j] - y[i])
    at_one_place = distance.size - np.count_nonzero(distance)
    if at_one_place:
        raise ValueError(
            f"x_mm, y_mm: {at_one_place} of {distance.size} pairs of neighbouring nodes lie at one place; "
            "all must lie apart for this method"
        )
    return distance


def _stencils(graph: NodeGraph) -> list[tuple[Numbers, Numbers, Numbers]]:
    """For each stencil size: its pairs [n], their stencils [n, size], and the place of a pair's first node [n]."""
    parts: defaultdict[int, list[tuple[Numbers, Numbers, Numbers]]] = defaultdict(list)
    start = 0
    for chain in graph.chains:
        size, count = min(chain.size, _STENCIL), chain.size - 1
        first = np.clip(np.arange(count) - (_STENCIL - 2) // 2, 0, chain.size - size)
        nodes = chain[first[:, None] + np.arange(size)]
        parts[size].append((np.arange(start, start + count), nodes, np.arange(count) - first))
        start += count
    return [
        (np.concatenate(pairs), np.concatenate(nodes), np.concatenate(place))
        for pairs, nodes, place in (zip(*of_size, strict=True) for of_size in parts.values())
    ]


def _weighted(graph: NodeGraph, x: Values, y: Values) -> _Weighted:
    """As _stencils, with the weights of p and of q [pairs, size]: made once for all maps over the same nodes."""
    last = _LAST.get(graph)
    if last is None or not (np.array_equal(last[0], x) and np.array_equal(last[1], y)):
        _distances(graph, x, y)
        weighted = [
            (pairs, nodes, *_stencil_weights(x[nodes], y[nodes], place)) for pairs, nodes, place in _stencils(graph)
        ]
        last = _LAST[graph] = (x, y, weighted)
    return last[2]


def _stencil_weights(x: Values, y: Values, place: Numbers) -> tuple[Values, Values]:
    """Weights [pairs, size] of p and of q in the rises; stencils at ``x``, ``y`` [pairs, size], ``place`` [pairs]."""
    row, size = np.arange(len(x)), x.shape[1]
    t = np.pad(np.cumsum(np.hypot(np.diff(x), np.diff(y)), axis=1), ((0, 0), (1, 0)))
    t = (t - t[row, place][:, None]) / (t[row, place + 1] - t[row, place])[:, None]
    powers = np.linalg.inv(t[..., None] ** np.arange(size))  # [pairs, power, size]: of the polynomial 1 at one node
    paths = (np.einsum("njk,nk->nj", powers, v - v[:, :1]) for v in (x, y))
    weight_x, weight_y = (np.einsum("nj,njk->nk", _moments(path), powers) for path in paths)
    return weight_x, weight_y


def _moments(path: Values) -> Values:
    """Integrals over t from 0 to 1 of t^j dx, [..., j], for x of the coefficients ``path`` [..., power]."""
    j, k = np.indices(2 * path.shape[-1:])
    moments: Values = path @ (k / np.maximum(j + k, 1)).T
    return moments
