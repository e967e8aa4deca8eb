"""Rises between islands: links across the gaps of a mask, and polynomials that carry the slopes over them.

A link joins two nodes of different islands that see each other along a row, a column or a diagonal. The rise along it
is that of a polynomial whose gradients fit the slopes at the nodes next to both ends. Among all weights of these slopes
that are exact for polynomials of a degree, it takes those with the least sum of squares, so white noise has the least
effect: z_j - z_i = sum over nodes of (weight_x p + weight_y q).

Source: D. Levin, Math. Comp. 67, 1517 (1998), for least-squares weights with polynomial reproduction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from irtscots_cl.maths.integration.node_graph import NodeGraph

if TYPE_CHECKING:
    from scipy.spatial import KDTree

NEAR = 12  # nodes next to each end of a link
_DETOUR = 2.0  # links longer than this times the longest step of a way round over shorter links are left out
_DEGREES = (4, 3, 2)  # of the polynomials: the highest that the nodes determine
_CUT = 1e-10  # squared singular values below this part of the largest count as zero
_EXACT = 1e-12  # relative: how well the weights must reproduce the polynomials' rises
_EDGE = 1e-8  # of a gap: nodes so near to its edges lie outside
_BLOCK = 4096  # links at a time: 60 MB

Values = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Rises:
    """Rises [maps, links] of slopes p, q [maps, nodes] as sparse weights [links, nodes] in mm."""

    weight_x: sparse.csr_array
    weight_y: sparse.csr_array

    def of(self, p: Values, q: Values) -> Values:
        """Rises [maps, links] in mm."""
        rises: Values = (self.weight_x @ p.T + self.weight_y @ q.T).T
        return rises

    def gain(self) -> Values:
        """Rms rise [links] in mm per rad of white slope noise."""
        squares = self.weight_x.power(2).sum(axis=1) + self.weight_y.power(2).sum(axis=1)
        gain: Values = np.sqrt(squares)
        return gain


def links(graph: NodeGraph, x: Values, y: Values) -> Numbers:
    """Node numbers [2, links] of the links between islands, without detours.

    From every node, in the eight directions of the grid, to the first node there if that is of another island.
    """
    row, column = np.nonzero(graph.mask)
    found = []
    for line, along in ((row, column), (column, row), (row - column, row), (row + column, row)):
        order = np.lexsort((along, line))
        i, j = order[:-1], order[1:]
        across = (line[i] == line[j]) & (graph.islands[i] != graph.islands[j])
        found.append(np.stack([i[across], j[across]]))
    pairs = np.concatenate(found, axis=1)
    return pairs[:, _direct(pairs, np.hypot(*(v[pairs[1]] - v[pairs[0]] for v in (x, y))), graph.islands)]


def _direct(pairs: Numbers, length: Values, islands: Numbers) -> NDArray[np.bool_]:
    """Which links are not much longer than the steps of a way over other islands between the same two."""
    from scipy.sparse.csgraph import connected_components

    kept = np.ones(length.size, dtype=bool)
    first, second = islands[pairs]
    count = int(islands.max()) + 1
    reach = length.min(initial=np.inf) or 1.0
    while reach * _DETOUR < length.max(initial=0.0):
        short = length <= reach
        steps = sparse.coo_array((np.ones(short.sum()), (first[short], second[short])), shape=(count, count))
        joined = connected_components(steps, directed=False)[1]
        kept &= (length <= reach * _DETOUR) | (joined[first] != joined[second])
        reach *= np.sqrt(2.0)
    return kept


def rises(graph: NodeGraph, x: Values, y: Values, pairs: Numbers, open_slab: bool = False) -> Rises:
    """The rises of ``pairs`` [2, links]. open_slab: use no node between the two ends, as if a gap were there."""
    from scipy.spatial import KDTree  # imported late: few masks have gaps

    tree = KDTree(np.stack([x, y], axis=1))
    blocks = [
        _block(tree, x, y, pairs[:, start : start + _BLOCK], open_slab) for start in range(0, pairs.shape[1], _BLOCK)
    ]
    shape = (pairs.shape[1], x.size)
    if not blocks:
        return Rises(sparse.csr_array(shape), sparse.csr_array(shape))
    nodes, weight_x, weight_y = (np.concatenate(part) for part in zip(*blocks, strict=True))
    link = np.repeat(np.arange(shape[0]), nodes.shape[1])
    made = (sparse.coo_array((w.ravel(), (link, nodes.ravel())), shape=shape).tocsr() for w in (weight_x, weight_y))
    return Rises(*made)


def trapezoids(x: Values, y: Values, pairs: Numbers) -> Rises:
    """The rises of ``pairs`` [2, links] with the mean of the slopes at both ends: exact for quadratic surfaces."""
    shape = (pairs.shape[1], x.size)
    link = np.tile(np.arange(shape[0]), 2)
    steps = (np.tile((v[pairs[1]] - v[pairs[0]]) / 2, 2) for v in (x, y))
    return Rises(*(sparse.coo_array((step, (link, pairs.ravel())), shape=shape).tocsr() for step in steps))


def _block(tree: KDTree, x: Values, y: Values, pairs: Numbers, open_slab: bool) -> tuple[Numbers, Values, Values]:
    """Nodes [links, 2 NEAR] and their weights of some links."""
    nodes = np.concatenate([_near(tree, x, y, end, other, open_slab) for end, other in (pairs, pairs[::-1])], axis=1)
    middle_x, middle_y = (v[pairs].mean(axis=0) for v in (x, y))
    u, v = x[nodes] - middle_x[:, None], y[nodes] - middle_y[:, None]
    scale = np.hypot(u, v).max(axis=1)
    scale[scale == 0] = 1.0
    step_x, step_y = (w[pairs[1]] - w[pairs[0]] for w in (x, y))
    half = (step_x / 2 / scale, step_y / 2 / scale)
    # the trapezoid is what is left where no polynomial is determined
    weight_x, weight_y = (np.zeros(nodes.shape) for _ in "xy")
    for column in (0, NEAR):  # the ends themselves
        weight_x[:, column], weight_y[:, column] = step_x / 2, step_y / 2
    most = np.hypot(step_x, step_y) / np.sqrt(2.0)  # the trapezoid's gain
    left = np.arange(pairs.shape[1])
    for degree in _DEGREES:
        at = (u[left] / scale[left, None], v[left] / scale[left, None])
        weights, good = _polynomial(*at, half[0][left], half[1][left], degree)
        weights *= scale[left, None]
        good &= np.linalg.norm(weights, axis=1) <= most[left] * (1 + _EXACT)
        weight_x[left[good]], weight_y[left[good]] = np.split(weights[good], 2, axis=1)
        left = left[~good]
    return nodes, weight_x, weight_y


def _near(tree: KDTree, x: Values, y: Values, end: Numbers, other: Numbers, open_slab: bool) -> Numbers:
    """The NEAR nodes [links, NEAR] next to ``end``, that node first; the end again where there are fewer."""
    wanted = min(NEAR * (3 if open_slab else 1), x.size)
    nodes = tree.query(np.stack([x[end], y[end]], axis=1), k=np.arange(1, wanted + 1))[1]
    out = nodes == end[:, None]
    if open_slab:
        step_x, step_y = x[other] - x[end], y[other] - y[end]
        along = (x[nodes] - x[end][:, None]) * step_x[:, None] + (y[nodes] - y[end][:, None]) * step_y[:, None]
        along /= np.maximum(step_x**2 + step_y**2, np.finfo(float).tiny)[:, None]
        out |= (along > _EDGE) & (along < 1 - _EDGE)
    nodes = np.take_along_axis(np.where(out, end[:, None], nodes), np.argsort(out, axis=1, kind="stable"), axis=1)
    found: Numbers = np.concatenate([end[:, None], nodes, np.repeat(end[:, None], NEAR, axis=1)], axis=1)[:, :NEAR]
    return found


def _polynomial(u: Values, v: Values, half_x: Values, half_y: Values, degree: int) -> tuple[Values, NDArray[np.bool_]]:
    """Weights [links, 2 nodes] of p and q, exact up to a degree, and whether they are; from -half to +half.

    The least weights w with A^T w = r, where A are the gradients of the polynomials at the nodes and r their rises.
    """
    powers = [(a, total - a) for total in range(1, degree + 1) for a in range(total + 1)]
    raised = [[w**k for k in range(degree + 1)] for w in (u, v)]
    gradients = np.concatenate(
        [
            np.stack([a * raised[0][max(a - 1, 0)] * raised[1][b] for a, b in powers], axis=-1),
            np.stack([b * raised[0][a] * raised[1][max(b - 1, 0)] for a, b in powers], axis=-1),
        ],
        axis=1,
    )
    rise = np.stack([half_x**a * half_y**b * (1 - (-1) ** (a + b)) for a, b in powers], axis=-1)
    value, vector = np.linalg.eigh(np.swapaxes(gradients, 1, 2) @ gradients)
    inverse = np.where(value > _CUT * value[:, -1:], 1 / np.where(value > 0, value, 1.0), 0.0)
    weights, left = np.zeros(gradients.shape[:2]), rise
    for _ in range(3):  # further steps remove the rounding of the normal equations
        solved = np.einsum("nij,nj,nkj,nk->ni", vector, inverse, vector, left, optimize=True)
        weights += np.einsum("nij,nj->ni", gradients, solved)
        left = rise - np.einsum("nij,ni->nj", gradients, weights)
    good: NDArray[np.bool_] = np.abs(left).max(axis=1) <= _EXACT * np.abs(rise).max(axis=1)
    return weights, good
