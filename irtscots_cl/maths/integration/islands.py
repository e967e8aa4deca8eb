"""Joining of islands: the pistons of parts of a mask that no unbroken row or column connects.

Slopes alone do not tell the height between islands. The deviation of a mirror from its design is smooth over the mirror,
though: where a gap is small against its correlation length, the slopes on both sides predict the rise across the gap
(bridges.py). Least squares over all gaps give every island's piston.

How well a rise is predicted is measured: the same rule is tried across gaps of the same size inside the islands, where
the heights are known. The root mean square of its errors there is the stated error of a link. Links between the same
two islands share that error, except for the part that is noise of the slopes. Gaps too large to be tried have the error
of the largest that was, scaled with the fifth power of the length. Where nothing can be tried, as between single
nodes, the error is the difference to the trapezoidal rule.

Two islands are joined if the stated error of the rise between them is at most JOIN_LIMIT times the rms of the heights.
Islands that are joined, directly or through others, form a group. Between groups the pistons are unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from irtscots_cl.maths.integration.bridges import Rises, links, rises, trapezoids
from irtscots_cl.maths.integration.node_graph import NodeGraph

JOIN_LIMIT = 0.3  # stated error of a rise between two islands, times the rms of the heights without piston and tilt
ERROR_DRAWS = 64  # of the joining errors: the stated errors are known to 9 %
_TRIALS = 48  # gaps of each size that are tried inside the islands
_FEW = 4  # fewer trials tell no error
_SHARED = 0.25  # least part of a link's variance that all links between two islands share

Values = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Islands:
    """The islands of a mask and how their heights are joined.

    mask: bool [rows, columns]. label: int [rows, columns], the island of a node, from 1, the largest first; 0 outside.
    sizes: int [islands], nodes of each. group: int [islands], the group of joined islands, from 1, the largest first.
    error_mm: [islands], stated standard error of an island's piston against the largest island of its group.
    """

    mask: NDArray[np.bool_] = field(repr=False)
    label: Numbers = field(repr=False)
    sizes: Numbers
    group: Numbers
    error_mm: Values
    _joint: _Joint | None = field(default=None, repr=False)

    @property
    def count(self) -> int:
        """Number of islands."""
        return self.sizes.size

    @property
    def groups(self) -> int:
        """Number of groups; pistons are known within each and unknown between them."""
        return int(self.group.max())

    @cached_property
    def group_map(self) -> Numbers:
        """Group [rows, columns] of each node, from 1; 0 outside the mask."""
        found: Numbers = np.append(0, self.group)[self.label]
        return found

    @cached_property
    def main(self) -> NDArray[np.bool_]:
        """The nodes [rows, columns] of the largest group: the whole mask if all islands are joined."""
        largest: NDArray[np.bool_] = self.group_map == 1
        return largest

    @property
    def alone(self) -> int:
        """Number of single nodes that are joined to nothing: their height is unknown."""
        return int(np.count_nonzero(np.bincount(self.group_map[self.mask])[1:] == 1)) if self.groups > 1 else 0

    def levelled(self, z: Values) -> Values:
        """``z`` [..., rows, columns] with zero mean over each group; NaN outside the mask."""
        result = np.full(z.shape, np.nan)
        result[..., self.mask] = _without_mean(self.group_map[self.mask] - 1, z[..., self.mask])
        return result

    def joining_errors(self) -> Values:
        """ERROR_DRAWS maps [draws, rows, columns] in mm of what the joining may have wrong, as stated.

        Every group has a mean of 0. No maps where nothing was joined.
        """
        if self._joint is None or not self._joint.draws.any():
            return np.zeros((0, *self.mask.shape))
        maps = np.full((len(self._joint.draws), *self.mask.shape), np.nan)
        maps[:, self.mask] = self._joint.draws[:, self.label[self.mask] - 1]
        return self.levelled(maps)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Pistons as a linear function of slopes and of heights: island numbers are those of `Islands`, from 0.

    rises: of the pairs of islands that are joined. steps: [pairs, nodes], the same pairs' differences of heights.
    first, second: island numbers [pairs]; error: [pairs] in mm. draws: [draws, islands] in mm.
    """

    rises: Rises
    steps: sparse.csr_array
    first: Numbers
    second: Numbers
    error: Values
    group: Numbers
    draws: Values = field(default_factory=lambda: np.zeros((0, 0)))

    def missing(self, p: Values, q: Values, nodes: Values) -> Values:
        """What the heights ``nodes`` [maps, nodes] lack of the rises between islands, [maps, pairs] in mm."""
        lacking: Values = self.rises.of(p, q) - (self.steps @ nodes.T).T
        return lacking

    @cached_property
    def _difference(self) -> sparse.csc_array:
        """[pairs, islands], in units of the errors."""
        pairs = self.first.size
        values = np.concatenate([-1 / self.error, 1 / self.error])
        places = (np.tile(np.arange(pairs), 2), np.concatenate([self.first, self.second]))
        return sparse.csc_array((values, places), shape=(pairs, self.group.size))

    @cached_property
    def _free(self) -> Numbers:
        """All islands but the first, which is the largest, of each group."""
        return np.setdiff1d(np.arange(self.group.size), np.unique(self.group, return_index=True)[1])

    @cached_property
    def _factor(self):  # type: ignore[no-untyped-def]  # SuperLU has no type
        laplacian = (self._difference.T @ self._difference).tocsc()[:, self._free].tocsr()[self._free].tocsc()
        return splu(laplacian, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def pistons(self, missing: Values) -> Values:
        """Pistons [maps, islands] in mm by weighted least squares; 0 for the largest island of each group."""
        pistons = np.zeros((len(missing), self.group.size))
        if self._free.size:
            sources = self._difference.T @ (missing / self.error).T
            pistons[:, self._free] = self._factor.solve(sources[self._free]).T
        return pistons

    def left(self, missing: Values) -> Values:
        """Residuals [maps, pairs] of the pistons' equations, in units of the errors."""
        residuals: Values = missing / self.error - (self._difference @ self.pistons(missing).T).T
        return residuals


def apart(graph: NodeGraph) -> Islands:
    """The islands of a mask, none joined."""
    number = _by_size(graph)
    sizes = np.bincount(number)
    return _islands(graph, number, sizes, np.arange(sizes.size), np.zeros(sizes.size), None)


def joined(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values, nodes: Values, noise: float) -> Islands:
    """Join the islands of a mask by slopes p, q [nodes] and the heights ``nodes`` [nodes] that they gave, in mm.

    x, y: [nodes] in mm. noise: standard error of the slopes [rad], or more. The decisions follow from these slopes
    alone; `with_pistons` applies them to other slopes at the same nodes.
    """
    number = _by_size(graph)
    sizes = np.bincount(number)
    pairs = links(graph, x, y)
    if not pairs.shape[1]:
        return apart(graph)
    variance = _variances(graph, x, y, p, q, nodes, pairs)
    first, second, between = _between(number, pairs)
    share = sparse.csr_array((1 / variance, (between, np.arange(variance.size))), shape=(first.size, variance.size))
    share = sparse.diags_array(1 / np.asarray(share.sum(axis=1)).ravel()).tocsr() @ share
    own = rises(graph, x, y, pairs)
    whole = Rises((share @ own.weight_x).tocsr(), (share @ own.weight_y).tocsr())
    shared = share @ np.maximum(variance - (noise * own.gain()) ** 2, _SHARED * variance)
    error = np.sqrt(shared + (noise * whole.gain()) ** 2)
    ends = np.concatenate([pairs[1], pairs[0]])
    signs, rows = np.repeat([1.0, -1.0], pairs.shape[1]), np.tile(np.arange(pairs.shape[1]), 2)
    # a link runs from the island of the lower number: turn those that run the other way
    steps = share @ sparse.csr_array((signs, (rows, ends)), shape=(pairs.shape[1], x.size))
    lacking = _Joint(whole, steps.tocsr(), first, second, error, np.zeros(sizes.size, dtype=np.intp))
    return _decided(graph, x, y, nodes, number, sizes, lacking, lacking.missing(p[None], q[None], nodes[None])[0])


def with_pistons(islands: Islands, p: Values, q: Values, nodes: Values) -> Values:
    """Heights ``nodes`` [maps, nodes] of slopes p, q [maps, nodes] with the islands' pistons; mean 0 in every group."""
    if islands._joint is None:
        return nodes
    pistons = islands._joint.pistons(islands._joint.missing(p, q, nodes))
    number = islands.label[islands.mask] - 1
    return _without_mean(islands.group[number] - 1, nodes + pistons[:, number])


def _decided(
    graph: NodeGraph, x: Values, y: Values, nodes: Values, number: Numbers, sizes: Numbers, joint: _Joint,
    missing: Values,
) -> Islands:  # fmt: skip
    """Drop the pairs of islands with too large an error, until none is left; then the pistons' own errors."""
    use = np.isfinite(joint.error)
    while True:
        kept, lacking = _kept(joint, use, sizes), missing[use]
        pistons = kept.pistons(lacking[None])[0]
        heights = _without_tilt(x, y, kept.group[number], nodes + pistons[number])
        large = use & (joint.error > JOIN_LIMIT * np.sqrt(np.mean(heights**2)))
        if not large.any():
            break
        use &= ~large
    if not use.any():
        return apart(graph)
    loops = int(use.sum()) - kept._free.size
    if loops:
        # pairs that contradict each other by more than they state
        worse = np.sqrt(max(1.0, float(np.sum(kept.left(lacking[None]) ** 2)) / loops))
        kept = _replaced(kept, kept.error * worse)
    noise = np.random.default_rng(0).standard_normal((ERROR_DRAWS, kept.error.size)) * kept.error
    draws = kept.pistons(noise)
    kept = _replaced(kept, kept.error, draws)
    return _islands(graph, number, sizes, kept.group, np.sqrt(np.mean(draws**2, axis=0)), kept)


def _kept(joint: _Joint, use: NDArray[np.bool_], sizes: Numbers) -> _Joint:
    """The pairs to use, and the groups of islands that they join."""
    which = np.flatnonzero(use)
    first, second = joint.first[which], joint.second[which]
    graph = sparse.coo_array((np.ones(which.size), (first, second)), shape=(sizes.size, sizes.size))
    group = connected_components(graph, directed=False)[1]
    order = np.argsort(-np.bincount(group, sizes), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    part = Rises(joint.rises.weight_x[which], joint.rises.weight_y[which])
    return _Joint(part, joint.steps[which], first, second, joint.error[which], rank[group])


def _replaced(joint: _Joint, error: Values, draws: Values | None = None) -> _Joint:
    none = np.zeros((0, 0)) if draws is None else draws
    return _Joint(joint.rises, joint.steps, joint.first, joint.second, error, joint.group, none)


def _variances(graph: NodeGraph, x: Values, y: Values, p: Values, q: Values, nodes: Values, pairs: Numbers) -> Values:
    """Variance [links] in mm^2 of the rises along the links, from trials across equal gaps inside islands."""
    row, column = np.nonzero(graph.mask)
    step = np.stack([row[pairs[1]] - row[pairs[0]], column[pairs[1]] - column[pairs[0]]])
    sizes, kind = np.unique(step, axis=1, return_inverse=True)
    kind = kind.ravel()
    length = np.hypot(*(v[pairs[1]] - v[pairs[0]] for v in (x, y)))
    lengths = np.bincount(kind, length) / np.bincount(kind)
    tried = [_trials(graph, int(rows), int(columns)) for rows, columns in sizes.T]
    both = np.concatenate([*tried, np.zeros((2, 0), dtype=np.intp)], axis=1)
    error = rises(graph, x, y, both, open_slab=True).of(p[None], q[None])[0] - (nodes[both[1]] - nodes[both[0]])
    found = np.full(lengths.size, np.nan)
    for k, part in enumerate(np.split(error, np.cumsum([t.shape[1] for t in tried])[:-1])):
        if part.size >= _FEW:
            found[k] = np.mean(part**2) * (1 + 2 / part.size)
    known = np.flatnonzero(~np.isnan(found))
    if not known.size:
        differ = (rises(graph, x, y, pairs).of(p[None], q[None]) - trapezoids(x, y, pairs).of(p[None], q[None]))[0]
        found[:] = np.bincount(kind, differ**2) / np.bincount(kind)
    else:
        for k in np.flatnonzero(np.isnan(found)):
            near = known[np.argmin(np.abs(lengths[known] - lengths[k]))]
            found[k] = found[near] * max(1.0, lengths[k] / lengths[near]) ** 10
    scale = float(np.max(np.abs(nodes), initial=0.0))
    return np.maximum(found, (np.finfo(float).eps * scale) ** 2 + np.finfo(float).tiny)[kind]


def _trials(graph: NodeGraph, rows: int, columns: int) -> Numbers:
    """Up to _TRIALS pairs of nodes [2, trials] of one island that lie so many rows and columns apart."""
    number = np.full(graph.mask.shape, -1)
    number[graph.mask] = np.arange(graph.islands.size)
    if abs(rows) >= number.shape[0] or abs(columns) >= number.shape[1]:
        return np.zeros((2, 0), dtype=np.intp)
    i = number[_cut(-rows), _cut(-columns)].ravel()
    j = number[_cut(rows), _cut(columns)].ravel()
    there = np.flatnonzero((i >= 0) & (j >= 0))
    there = there[graph.islands[i[there]] == graph.islands[j[there]]]
    if there.size > _TRIALS:
        there = there[np.linspace(0, there.size - 1, _TRIALS).round().astype(int)]
    return np.stack([i[there], j[there]])


def _cut(shift: int) -> slice:
    """The lines of an axis that are left when it is moved: the first ones for a negative shift."""
    return slice(shift, None) if shift >= 0 else slice(None, shift)


def _between(number: Numbers, pairs: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """The pairs of islands that links join: lower and higher number [pairs], and each link's pair [links].

    Turns ``pairs`` in place so that every link runs from the lower number to the higher.
    """
    turned = number[pairs[0]] > number[pairs[1]]
    pairs[:, turned] = pairs[::-1, turned]
    islands, between = np.unique(number[pairs], axis=1, return_inverse=True)
    return islands[0], islands[1], between.ravel()


def _by_size(graph: NodeGraph) -> Numbers:
    """Island number [nodes] from 0, the largest first, islands of one size in the order of the mask."""
    order = np.argsort(-np.bincount(graph.islands), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    numbered: Numbers = rank[graph.islands]
    return numbered


def _islands(
    graph: NodeGraph, number: Numbers, sizes: Numbers, group: Numbers, error: Values, joint: _Joint | None
) -> Islands:
    label = np.zeros(graph.mask.shape, dtype=np.intp)
    label[graph.mask] = number + 1
    for array in (label, sizes, group, error):
        array.setflags(write=False)
    return Islands(graph.mask, label, sizes, group + 1, error, joint)


def _without_mean(group: Numbers, nodes: Values) -> Values:
    """``nodes`` [..., nodes] minus the mean of their group, numbered from 0."""
    flat = nodes.reshape(-1, group.size)
    members = sparse.csr_array((np.ones(group.size), (group, np.arange(group.size))))
    means = (members @ flat.T) / np.bincount(group)[:, None]
    levelled: Values = (flat - means[group].T).reshape(nodes.shape)
    return levelled


def _without_tilt(x: Values, y: Values, group: Numbers, nodes: Values) -> Values:
    """Heights [nodes] without a piston for each group and one tilt for all."""
    columns: Sequence[Values] = [_without_mean(group, v) for v in (x, y, nodes)]
    basis = np.stack(columns[:2], axis=1)
    left: Values = columns[2] - basis @ np.linalg.lstsq(basis, columns[2])[0]
    return left
