"""Joining of islands: the pistons of parts of a mask that no unbroken row or column connects.

Slopes alone do not tell the height between islands. But the deviation of a mirror from its design is smooth over the
mirror: where a gap is small against its correlation length, the slopes on both sides predict the rise across the gap
(bridges.py). Least squares over all gaps give every island's piston.

How well a rise is predicted is measured: the same rule is tried across gaps of the same size inside the islands, where
the heights are known. The errors of half as many trials side by side as there are links between two islands are
averaged; the root mean square of such averages is the stated error of the rise between the islands. (Half: errors along
a bent gap cancel less than along the straight gaps of the trials.) Gaps too large to be tried
have the error of the largest that was, scaled with the fifth power of the length. Where nothing can be tried, as
between single nodes, the error is the difference to the trapezoidal rule.

Two islands are joined if the stated error of the rise between them is at most JOIN_LIMIT times the rms of the heights.
Islands that are joined, directly or through others, form a group. Between groups the pistons are unknown.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from irtscots_cl.maths.integration.bridges import Rises, links, rises, trapezoids
from irtscots_cl.maths.integration.node_graph import NodeGraph, node_graph

JOIN_LIMIT = 0.3  # stated error of a rise between two islands, times the rms of the heights without piston and tilt
ERROR_DRAWS = 64  # of the joining errors: the stated errors are known to 9 %
_NOISE_DRAWS = 32  # of the slopes' noise, for the part of the stated errors that comes from it: to 12 %
NOISE_NODES = 50_000  # larger masks have no such part: it takes as many integrations as draws
_TRIALS = 256  # of each size of gap, about
_FEW = 8  # fewer averages of trials tell no error
_ROUNDING = 1e-9  # stated errors below this part of the largest height are none: a flat mirror has no rms
_LEAST_MM = 1e-15  # stated error of a rise, at least
_OWN = 0.25  # least part of a rise's variance that does not come from the noise of the slopes

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
        from scipy.sparse.linalg import splu

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


def separate_islands(mask: ArrayLike) -> Islands:
    """The islands of a mask, bool [rows, columns], none joined. Raises ValueError as `node_graph`."""
    return apart(node_graph(mask))


def apart(graph: NodeGraph) -> Islands:
    """The islands of a mask, none joined."""
    number = _by_size(graph)
    sizes = np.bincount(number)
    return _islands(graph, number, sizes, np.arange(sizes.size), np.zeros(sizes.size), None)


def joined(
    graph: NodeGraph,
    x: Values,
    y: Values,
    p: Values,
    q: Values,
    nodes: Values,
    solve: Callable[[Values, Values], Values],
    noise: float,
) -> Islands:
    """Join the islands of a mask by slopes p, q [nodes] at x, y [nodes] and the heights ``nodes`` of these, in mm.

    solve: heights [maps, nodes] in mm of slopes [maps, nodes], each island with a mean of 0. noise: standard error of
    the slopes [rad], or 0 to take the whole error of the rises for their own. The decisions follow from these slopes
    alone; `with_pistons` applies them to others at the same nodes.
    """
    number = _by_size(graph)
    sizes = np.bincount(number)
    pairs = links(graph, x, y)
    if not pairs.shape[1]:
        return apart(graph)
    first, second, between = _between(number, pairs)
    variance, share = _variances(graph, x, y, p, q, nodes, pairs, between)
    own = rises(graph, x, y, pairs)
    whole = Rises((share @ own.weight_x).tocsr(), (share @ own.weight_y).tocsr())
    ends, rows = np.concatenate([pairs[1], pairs[0]]), np.tile(np.arange(pairs.shape[1]), 2)
    signs = np.repeat([1.0, -1.0], pairs.shape[1])
    steps = (share @ sparse.csr_array((signs, (rows, ends)), shape=(pairs.shape[1], x.size))).tocsr()
    joint = _Joint(whole, steps, first, second, np.sqrt(variance), np.zeros(sizes.size, dtype=np.intp))
    joint = _decided(joint, x, y, number, sizes, joint.missing(p[None], q[None], nodes[None]), nodes)
    if not joint.first.size:
        return apart(graph)
    random = np.random.default_rng(0)
    by_noise = np.zeros((1, sizes.size))
    if noise:
        noise_p, noise_q = noise * random.standard_normal((2, _NOISE_DRAWS, x.size))
        by_noise = joint.pistons(joint.missing(noise_p, noise_q, solve(noise_p, noise_q)))
    own_error = np.sqrt(np.maximum(joint.error**2 - (noise * joint.rises.gain()) ** 2, _OWN * joint.error**2))
    draws = joint.pistons(random.standard_normal((ERROR_DRAWS, own_error.size)) * own_error)
    error = np.sqrt(np.mean(draws**2, axis=0) + np.mean(by_noise**2, axis=0))
    return _islands(graph, number, sizes, joint.group, error, dataclasses.replace(joint, draws=draws))


def with_pistons(islands: Islands, p: Values, q: Values, nodes: Values) -> Values:
    """Heights ``nodes`` [maps, nodes] of slopes p, q [maps, nodes] with the islands' pistons; mean 0 in every group."""
    if islands._joint is None:
        return nodes
    pistons = islands._joint.pistons(islands._joint.missing(p, q, nodes))
    number = islands.label[islands.mask] - 1
    return _without_mean(islands.group[number] - 1, nodes + pistons[:, number])


def _decided(
    joint: _Joint, x: Values, y: Values, number: Numbers, sizes: Numbers, missing: Values, nodes: Values
) -> _Joint:
    """Drop the pairs of islands with too large an error, until none is left; errors grown to fit contradictions.

    missing: [1, pairs]; nodes: heights [nodes] of islands of their own.
    """
    use = np.isfinite(joint.error)
    while True:
        kept, lacking = _kept(joint, use, sizes), missing[:, use]
        heights = nodes + kept.pistons(lacking)[0, number]
        rms = np.sqrt(np.mean(_without_tilt(x, y, kept.group[number], heights) ** 2))
        large = use & (joint.error > max(JOIN_LIMIT * rms, _ROUNDING * np.abs(nodes).max(), _LEAST_MM))
        if not large.any():
            break
        use &= ~large
    loops = int(use.sum()) - kept._free.size
    if loops:
        worse = np.sqrt(max(1.0, float(np.sum(kept.left(lacking) ** 2)) / loops))
        kept = dataclasses.replace(kept, error=kept.error * worse)
    return kept


def _kept(joint: _Joint, use: NDArray[np.bool_], sizes: Numbers) -> _Joint:
    """The pairs to use, and the groups of islands that they join."""
    from scipy.sparse.csgraph import connected_components

    which = np.flatnonzero(use)
    first, second = joint.first[which], joint.second[which]
    graph = sparse.coo_array((np.ones(which.size), (first, second)), shape=(sizes.size, sizes.size))
    group = connected_components(graph, directed=False)[1]
    order = np.argsort(-np.bincount(group, sizes), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    part = Rises(joint.rises.weight_x[which], joint.rises.weight_y[which])
    return _Joint(part, joint.steps[which], first, second, joint.error[which], rank[group])


def _variances(
    graph: NodeGraph, x: Values, y: Values, p: Values, q: Values, nodes: Values, pairs: Numbers, between: Numbers
) -> tuple[Values, sparse.csr_array]:
    """Variance [pairs of islands] in mm^2 of the mean rises, and the share [pairs of islands, links] of each link.

    Links of one size between the same islands have equal shares. Sizes share by their variances; their errors are taken
    to be the same one.
    """
    row, column = np.nonzero(graph.mask)
    step = np.stack([row[pairs[1]] - row[pairs[0]], column[pairs[1]] - column[pairs[0]]])
    step *= np.where((step[0] < 0) | ((step[0] == 0) & (step[1] < 0)), -1, 1)  # a gap has no direction
    sizes, kind = np.unique(step, axis=1, return_inverse=True)
    kind = kind.ravel()
    length = np.hypot(*(v[pairs[1]] - v[pairs[0]] for v in (x, y)))
    lengths = np.bincount(kind, length) / np.bincount(kind)
    (pair, size), unit, count = np.unique(np.stack([between, kind]), axis=1, return_inverse=True, return_counts=True)
    errors = _trial_errors(graph, x, y, p, q, nodes, sizes)
    variance = np.array([_of_averages(errors[k], (n + 1) // 2) for k, n in zip(size, count, strict=True)])
    plain = np.array([_of_averages(error, 1) for error in errors])
    known = np.flatnonzero(~np.isnan(plain))
    differ = np.zeros(1)
    if not known.size:
        differ = (rises(graph, x, y, pairs).of(p[None], q[None]) - trapezoids(x, y, pairs).of(p[None], q[None]))[0]
    for k in np.flatnonzero(np.isnan(variance)):
        if known.size:
            near = known[np.argmin(np.abs(lengths[known] - lengths[size[k]]))]
            variance[k] = plain[near] * max(1.0, lengths[size[k]] / lengths[near]) ** 10
        else:
            variance[k] = np.mean(differ**2)
    # without noise some errors are but rounding: weights that differ by too much would spoil the least squares
    rounding = _ROUNDING / 1e3 * float(np.max(np.abs(nodes), initial=0.0))
    variance = np.maximum(variance, rounding**2 + _LEAST_MM**2)
    total = np.bincount(pair, 1 / variance)
    share = sparse.csr_array((1 / (variance * total[pair] * count), (pair, np.arange(count.size))))
    share = share @ sparse.csr_array((np.ones(kind.size), (unit.ravel(), np.arange(kind.size))))
    return (np.bincount(pair, 1 / np.sqrt(variance)) / total) ** 2, share.tocsr()


def _trial_errors(
    graph: NodeGraph, x: Values, y: Values, p: Values, q: Values, nodes: Values, sizes: Numbers
) -> list[list[Values]]:
    """For each size [2, sizes] of a gap, the errors in mm of trials inside islands, those of one gap side by side."""
    trials = [_trials(graph, int(rows), int(columns)) for rows, columns in sizes.T]
    none: Numbers = np.zeros((2, 0), dtype=np.intp)
    pairs = np.concatenate([none, *(gap for gaps in trials for gap in gaps)], axis=1)
    error = rises(graph, x, y, pairs, open_slab=True).of(p[None], q[None])[0] - (nodes[pairs[1]] - nodes[pairs[0]])
    parts = iter(np.split(error, np.cumsum([gap.shape[1] for gaps in trials for gap in gaps])))
    return [[next(parts) for _ in gaps] for gaps in trials]


def _of_averages(errors: list[Values], count: int) -> float:
    """Mean square of averages of ``count`` errors side by side, or of the most that can be had; NaN without."""
    while count:
        means = [e[: e.size // count * count].reshape(-1, count).mean(axis=1) for e in errors if e.size >= count]
        averages = np.concatenate([np.zeros(0), *means])
        if averages.size >= _FEW:
            return float(np.mean(averages**2) * (1 + 2 / averages.size))
        count //= 2
    return float("nan")


def _trials(graph: NodeGraph, rows: int, columns: int) -> list[Numbers]:
    """Gaps inside islands: for each, the nodes [2, trials] on both sides, so many rows and columns apart."""
    number: Numbers = np.full(graph.mask.shape, -1, dtype=np.intp)
    number[graph.mask] = np.arange(graph.islands.size)
    if abs(rows) >= number.shape[0] or abs(columns) >= number.shape[1]:
        return []
    i = number[_cut(-rows), _cut(-columns)].ravel()
    j = number[_cut(rows), _cut(columns)].ravel()
    there = np.flatnonzero((i >= 0) & (j >= 0))
    there = there[graph.islands[i[there]] == graph.islands[j[there]]]
    pairs = np.stack([i[there], j[there]])
    row, column = np.nonzero(graph.mask)
    across, along = (a * row[pairs[0]] + b * column[pairs[0]] for a, b in ((rows, columns), (columns, -rows)))
    order = np.lexsort((along, across))
    gaps = np.split(pairs[:, order], np.flatnonzero(np.diff(across[order])) + 1, axis=1)
    # evenly spread gaps with about _TRIALS trials in all
    wanted = max(_FEW, len(gaps) * _TRIALS // max(pairs.shape[1], 1))
    if pairs.shape[1] > _TRIALS and wanted < len(gaps):
        gaps = [gaps[k] for k in np.linspace(0, len(gaps) - 1, wanted).round().astype(int)]
    return gaps


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
