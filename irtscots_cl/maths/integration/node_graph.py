"""Zonal integration: heights from the rises between neighbouring nodes, by least squares on any mask.

The nodes form a logical grid [rows, columns]. Every pair (i, j) of neighbouring nodes in the mask gives an
equation z_j - z_i = rise, all of the same weight. zonal_rules.py computes the rises from the slopes and
the nodes' true positions. The matrix depends only on which nodes are neighbours: it is the graph's Laplacian, the
same for all rules and all maps. An island (nodes joined by pairs, that is 4-connected) has a free piston, set so that
its mean height is 0; a single node has height 0.

Sources: W. H. Southwell, J. Opt. Soc. Am. 70, 998 (1980), for the least squares; D. C. Ghiglia and L. A. Romero,
J. Opt. Soc. Am. A 11, 107 (1994), for conjugate gradients with the cosine transform as preconditioner.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from irtscots_cl.maths.low_order import checked_mask
from irtscots_cl.system import interruption

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

# A run uses one mask, a tolerance study a few. The factor of 10^4 nodes takes about 6 MB.
_CACHED_MASKS = 8
# More nodes are solved by iteration: for 2e5 nodes one map takes 0.1 s, and factoring takes 2.3 s.
_DIRECT_NODES = 50_000
# A disk needs 20 steps; two halves joined by one node need 130. Masks that need more have many holes and factor well.
_STEPS = 300
RESIDUAL = 1e-13  # heights to 1e-13 of their range; the factor's solution has 1e-12 on 2e5 nodes


def node_graph(mask: ArrayLike) -> NodeGraph:
    """The `NodeGraph` of a mask, bool [rows, columns], from a small cache of recent masks.

    Raises ValueError for an empty mask or one that is not a boolean [rows, columns] array.
    """
    mask = checked_mask(mask)
    return _cached_graph(mask.shape, np.packbits(mask).tobytes())


@dataclass(frozen=True, eq=False)
class NodeGraph:
    """The nodes of a mask, their neighbours, and the least-squares heights over them.

    Nodes are numbered row by row inside the mask. ``mask`` bool [rows, columns]; ``islands`` int [nodes], from 0;
    ``chains``: the numbers of the nodes in every unbroken run of two or more, row by row, then column by column;
    ``pairs`` int [2, pairs], the neighbours along the chains, chain after chain.
    """

    mask: NDArray[np.bool_]
    islands: NDArray[np.intp] = field(repr=False)
    chains: tuple[NDArray[np.intp], ...] = field(repr=False)
    pairs: NDArray[np.intp] = field(repr=False)

    @classmethod
    def from_mask(cls, mask: ArrayLike) -> NodeGraph:
        """Build for a boolean mask [rows, columns]; ValueError as `node_graph`."""
        from scipy.ndimage import label  # imported late, as all of scipy's parts: each is slow to import

        mask = checked_mask(mask).copy()
        islands = label(mask)[0][mask].astype(np.intp) - 1
        chains = _chains(mask)
        empty = np.empty(0, dtype=np.intp)
        first, second = ([chain[part] for chain in chains] for part in (slice(-1), slice(1, None)))
        pairs = np.stack([np.concatenate([empty, *first]), np.concatenate([empty, *second])])
        for array in (mask, islands, pairs, *chains):
            array.setflags(write=False)
        return cls(mask, islands, chains, pairs)

    def values(self, name: str, maps: ArrayLike, lead: tuple[int, ...] = ()) -> NDArray[np.float64]:
        """Values [maps, nodes] of ``maps`` [*lead, rows, columns]; ValueError for other shapes or non-finite values."""
        maps, shape = np.asarray(maps, dtype=np.float64), lead + self.mask.shape
        if maps.shape != shape:
            raise ValueError(f"{name} has shape {maps.shape}, expected {shape} for this mask")
        inside = maps[..., self.mask].reshape(-1, self.islands.size)
        bad = inside.size - np.count_nonzero(np.isfinite(inside))
        if bad:
            raise ValueError(f"{name} is not finite at {bad} of {inside.size} points inside the mask")
        return inside

    def heights(
        self, rises: NDArray[np.float64], start: NDArray[np.float64] | None = None, residual: float = RESIDUAL
    ) -> NDArray[np.float64]:
        """Heights [maps, nodes] that best fit ``rises`` [maps, pairs], in their unit; every island's mean is 0.

        start: heights [maps, nodes] near them, and residual, relative: where they are found by iteration.
        """
        sources = (self._difference.T @ rises.T).T
        nodes = None if self.islands.size <= _DIRECT_NODES else self._iterated(sources, start, residual)
        return self.without_piston(self._solved(sources) if nodes is None else nodes)

    def without_piston(self, nodes: NDArray[np.float64]) -> NDArray[np.float64]:
        """``nodes`` [maps, nodes] minus the mean of their island."""
        count = self.islands.size
        members = sparse.csr_array((np.ones(count), (self.islands, np.arange(count))))
        means: NDArray[np.float64] = (members @ nodes.T) / np.bincount(self.islands)[:, None]
        return nodes - means[self.islands].T

    @cached_property
    def _difference(self) -> sparse.csc_array:
        """[pairs, nodes], -1 at the first and +1 at the second node of each pair."""
        count = self.pairs.shape[1]
        signs, rows = np.repeat([-1.0, 1.0], count), np.tile(np.arange(count), 2)
        return sparse.csc_array((signs, (rows, self.pairs.ravel())), shape=(count, self.islands.size))

    @cached_property
    def _laplacian(self) -> sparse.csc_array:
        return (self._difference.T @ self._difference).tocsc()

    def _solved(self, sources: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solutions [maps, nodes] of Laplacian z = ``sources`` [maps, nodes], by a cached factorisation."""
        nodes = np.zeros_like(sources)
        # Without any pair there is nothing to solve, and SuperLU does not accept an empty matrix.
        if self.pairs.size:
            free, factor = self._factor
            nodes[:, free] = factor.solve(sources[:, free].T).T
        return nodes

    @cached_property
    def _factor(self) -> tuple[NDArray[np.intp], SuperLU]:
        """The free nodes and their factored Laplacian.

        The first node of each island is fixed at 0, so the Laplacian of the others is positive definite. Ordering
        A^T + A without pivoting gives a factor with half as many entries as the default.
        """
        from scipy.sparse.linalg import splu

        pinned = np.unique(self.islands, return_index=True)[1]
        free = np.setdiff1d(np.arange(self.islands.size), pinned)
        laplacian = self._laplacian[:, free].tocsr()[free].tocsc()
        options = {"SymmetricMode": True}
        return free, splu(laplacian, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)

    def _iterated(
        self, sources: NDArray[np.float64], start: NDArray[np.float64] | None, residual: float
    ) -> NDArray[np.float64] | None:
        """As `_solved`, by conjugate gradients, in little memory; None if that takes too many steps.

        The preconditioner solves the Laplacian of the whole rectangle around the mask, which the cosine transform
        diagonalises.
        """
        from scipy.sparse.linalg import LinearOperator, cg

        count, precondition = self.islands.size, _rectangle_solver(self.mask)
        operator = LinearOperator((count, count), matvec=precondition, dtype=np.float64)
        nodes = np.zeros_like(sources) if start is None else np.array(start)
        for k, source in enumerate(sources):
            nodes[k], failed = cg(
                self._laplacian, source, nodes[k], rtol=residual, maxiter=_STEPS, M=operator, callback=_between_steps
            )
            if failed:
                return None
        return nodes


@lru_cache(maxsize=_CACHED_MASKS)
def _cached_graph(shape: tuple[int, int], packed: bytes) -> NodeGraph:
    bits = np.unpackbits(np.frombuffer(packed, dtype=np.uint8), count=shape[0] * shape[1])
    return NodeGraph.from_mask(bits.reshape(shape).astype(bool))


def _chains(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], ...]:
    number = np.cumsum(mask).reshape(mask.shape) - 1
    chains = []
    for on, numbers in ((mask, number), (mask.T, number.T)):
        # A chain ends where its line does or where the next node along the line is outside the mask.
        ends = on & ~np.pad(on[:, 1:], ((0, 0), (0, 1)))
        chains += np.split(numbers[on], np.flatnonzero(ends[on]) + 1)
    return tuple(chain for chain in chains if chain.size >= 2)


def _between_steps(_: NDArray[np.float64]) -> None:
    interruption.check()


def _rectangle_solver(mask: NDArray[np.bool_]) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Inverse of the Laplacian of a full rectangle that holds the mask, from and to the mask's nodes [nodes]."""
    from scipy.fft import dctn, idctn, next_fast_len

    row, column = (index - index.min() for index in np.nonzero(mask))
    shape = tuple(next_fast_len(int(index.max()) + 1, real=True) for index in (row, column))
    across, down = (2.0 - 2.0 * np.cos(np.pi * np.arange(length) / length) for length in shape)
    eigenvalues = np.add.outer(across, down)
    eigenvalues[0, 0] = np.inf  # the piston, which the Laplacian does not determine

    def solve(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
        rectangle = np.zeros(shape)
        rectangle[row, column] = nodes
        waves = dctn(rectangle, overwrite_x=True)
        waves /= eigenvalues
        solved: NDArray[np.float64] = idctn(waves, overwrite_x=True)[row, column]
        return solved

    return solve
