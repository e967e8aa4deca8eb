"""Zonal integration: two slope maps to one height map by least squares over neighbouring nodes.

The nodes form a logical grid [rows, columns] of any mask, but lie at their true positions, which need not be
regular: neighbours along a row may differ in y, neighbours along a column in x. For every pair (i, j) of
neighbouring nodes in the mask the height difference is taken as

    z_j - z_i = (p_i + p_j)/2 (x_j - x_i) + (q_i + q_j)/2 (y_j - y_i),    p = dz/dx, q = dz/dy,

which is exact for a quadratic surface on any node positions. All pairs weigh the same. An island (nodes
joined by pairs, that is 4-connected) has a free piston, set so that its mean height is 0; a lone node has
height 0.

Source: W. H. Southwell, J. Opt. Soc. Am. 70, 998 (1980), with the vector between the nodes in place
of a common pitch.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu
from skimage.measure import label

METHODS = ("southwell",)
TERMS = ("none", "piston", "piston_tilt", "piston_tilt_power")

# A run integrates over one mask, a tolerance study over a few; a factor of 10^4 nodes takes about 6 MB.
_CACHED_MASKS = 8


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
    method : "southwell", the only one (see the module's docstring)

    Returns [..., rows, columns] in mm, NaN outside the mask, zero mean over every island of the mask.

    Raises ValueError for an unknown method, a shape that does not fit, an empty or non-boolean mask, or
    positions or slopes that are not finite inside the mask.
    """
    if method not in METHODS:
        raise ValueError(f"unknown integration method {method!r}; allowed: {', '.join(METHODS)}")
    return zonal_integrator(mask).heights(x_mm, y_mm, slope_x, slope_y)


def zonal_integrator(mask: ArrayLike) -> ZonalIntegrator:
    """The `ZonalIntegrator` of a mask, bool [rows, columns], from a small cache of recent masks.

    Raises ValueError for an empty mask or one that is not a boolean [rows, columns] array.
    """
    mask = _checked_mask(mask)
    return _cached_integrator(mask.shape, np.packbits(mask).tobytes())


@dataclass(frozen=True, eq=False)
class ZonalIntegrator:
    """Southwell's normal equations for one mask, factored once.

    The difference operator knows only which nodes are neighbours; positions enter the right-hand side alone.
    One node per island is pinned at 0, which leaves the graph Laplacian of the others positive definite; the
    island's mean is taken out afterwards.

    ``mask`` bool [rows, columns]; ``islands`` int [rows, columns], 0 outside, islands from 1; ``pairs``
    int [2, pairs], the nodes of each neighbour pair, numbered row by row inside the mask.
    """

    mask: NDArray[np.bool_]
    islands: NDArray[np.intp]
    pairs: NDArray[np.intp]
    _free: NDArray[np.intp] = field(repr=False)
    _gather: sparse.csr_array = field(repr=False)
    _factor: SuperLU | None = field(repr=False)

    @classmethod
    def from_mask(cls, mask: ArrayLike) -> ZonalIntegrator:
        """Build and factor for a boolean mask [rows, columns]; ValueError as `zonal_integrator`."""
        mask = _checked_mask(mask).copy()
        islands = label(mask, connectivity=1).astype(np.intp)
        pairs = _neighbour_pairs(mask)
        pinned = np.unique(islands[mask], return_index=True)[1]
        free = np.setdiff1d(np.arange(np.count_nonzero(mask)), pinned)
        gather = _difference_operator(pairs, np.count_nonzero(mask))[:, free].T.tocsr()
        for array in (mask, islands, pairs, free):
            array.setflags(write=False)
        # Lone nodes alone leave nothing to solve for, and an empty matrix is outside SuperLU's contract.
        factor = _factorise((gather @ gather.T).tocsc()) if free.size else None
        return cls(mask, islands, pairs, free, gather, factor)

    def heights(self, x_mm: ArrayLike, y_mm: ArrayLike, slope_x: ArrayLike, slope_y: ArrayLike) -> NDArray[np.float64]:
        """Heights [..., rows, columns] in mm; arguments, result and errors as `integrate_slopes`."""
        x = self._nodes("x_mm", x_mm, self.mask.shape)
        y = self._nodes("y_mm", y_mm, self.mask.shape)
        lead = np.shape(slope_x)[:-2]
        p = self._nodes("slope_x", slope_x, lead + self.mask.shape)
        q = self._nodes("slope_y", slope_y, lead + self.mask.shape)
        i, j = self.pairs
        rise = 0.5 * ((p[:, i] + p[:, j]) * (x[:, j] - x[:, i]) + (q[:, i] + q[:, j]) * (y[:, j] - y[:, i]))
        nodes = np.zeros_like(p)
        if self._factor is not None:
            nodes[:, self._free] = self._factor.solve(self._gather @ rise.T).T
        z_mm = np.full((*lead, *self.mask.shape), np.nan)
        z_mm[..., self.mask] = self._without_piston(nodes).reshape(*lead, nodes.shape[1])
        return z_mm

    def _nodes(self, name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """The checked values inside the mask, [maps, nodes]."""
        values = np.asarray(values, dtype=np.float64)
        if values.shape != shape:
            raise ValueError(f"{name} has shape {values.shape}, expected {shape} for this mask")
        inside = values[..., self.mask].reshape(-1, np.count_nonzero(self.mask))
        bad = inside.size - np.count_nonzero(np.isfinite(inside))
        if bad:
            raise ValueError(f"{name} is not finite at {bad} of {inside.size} points inside the mask")
        return inside

    def _without_piston(self, nodes: NDArray[np.float64]) -> NDArray[np.float64]:
        island = self.islands[self.mask] - 1
        members = sparse.csr_array((np.ones(island.size), (island, np.arange(island.size))))
        means = (members @ nodes.T) / np.bincount(island)[:, None]
        return nodes - means[island].T


def remove_terms(x_mm: ArrayLike, y_mm: ArrayLike, z: ArrayLike, mask: ArrayLike, terms: str) -> NDArray[np.float64]:
    """``z`` without its least-squares fit of the named low-order terms, in the unit of ``z``.

    "none" removes nothing, "piston" 1, "piston_tilt" 1, x, y and "piston_tilt_power" 1, x, y, x^2 + y^2. All
    arrays are [rows, columns]. The fit runs over the samples inside the mask whose z is finite; the others
    are NaN in the result.

    Raises ValueError for unknown terms, a shape that does not fit, an empty or non-boolean mask, fewer
    samples than terms, or a position that is not finite where a sample is used.
    """
    if terms not in TERMS:
        raise ValueError(f"unknown terms {terms!r}; allowed: {', '.join(TERMS)}")
    z, used = _samples(z, mask)
    result = np.where(used, z, np.nan)
    count = (0, 1, 3, 4)[TERMS.index(terms)]
    if np.count_nonzero(used) < count:
        raise ValueError(f"{count} terms cannot be fitted to {np.count_nonzero(used)} samples")
    x, y = _centred(x_mm, "x_mm", used), _centred(y_mm, "y_mm", used)
    if count:
        # x and y share their scale, so x^2 + y^2 differs from power only by tilt and piston, removed with it.
        scale = max(np.abs(x).max(), np.abs(y).max()) or 1.0
        x, y = x / scale, y / scale
        basis = np.stack([np.ones_like(x), x, y, x * x + y * y], axis=1)[:, :count]
        result[used] -= basis @ np.linalg.lstsq(basis, z[used])[0]
    return result


def rms(z: ArrayLike, mask: ArrayLike) -> float:
    """Root mean square of ``z`` over its finite samples inside ``mask``, both [rows, columns]; unit of ``z``.

    Nothing is removed first, not even the mean: see `remove_terms`. Raises ValueError if no sample is left,
    or for a mask as `zonal_integrator` would.
    """
    z, used = _samples(z, mask)
    if not used.any():
        raise ValueError("no finite sample inside the mask")
    return float(np.sqrt(np.mean(z[used] ** 2)))


@lru_cache(maxsize=_CACHED_MASKS)
def _cached_integrator(shape: tuple[int, int], packed: bytes) -> ZonalIntegrator:
    bits = np.unpackbits(np.frombuffer(packed, dtype=np.uint8), count=shape[0] * shape[1])
    return ZonalIntegrator.from_mask(bits.reshape(shape).astype(bool))


def _checked_mask(mask: ArrayLike) -> NDArray[np.bool_]:
    mask = np.asarray(mask)
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise ValueError(f"mask must be boolean [rows, columns], got {mask.dtype} of shape {mask.shape}")
    if not mask.any():
        raise ValueError("mask is empty: no node to integrate over")
    return mask


def _neighbour_pairs(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    number = np.cumsum(mask).reshape(mask.shape) - 1
    along_row = mask[:, :-1] & mask[:, 1:]
    along_column = mask[:-1] & mask[1:]
    first = np.concatenate([number[:, :-1][along_row], number[:-1][along_column]])
    second = np.concatenate([number[:, 1:][along_row], number[1:][along_column]])
    return np.stack([first, second])


def _difference_operator(pairs: NDArray[np.intp], nodes: int) -> sparse.csc_array:
    """[pairs, nodes], -1 at the first and +1 at the second node of each pair."""
    count = pairs.shape[1]
    signs = np.repeat([-1.0, 1.0], count)
    return sparse.csc_array((signs, (np.tile(np.arange(count), 2), pairs.ravel())), shape=(count, nodes))


def _factorise(normal: sparse.csc_array) -> SuperLU:
    # Positive definite: an ordering of A^T + A without pivoting keeps the factor half as full as the default.
    options = {"SymmetricMode": True}
    return splu(normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def _samples(z: ArrayLike, mask: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    z, mask = np.asarray(z, dtype=np.float64), _checked_mask(mask)
    if z.shape != mask.shape:
        raise ValueError(f"z has shape {z.shape}, expected {mask.shape} for this mask")
    return z, mask & np.isfinite(z)


def _centred(position: ArrayLike, name: str, used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Used positions less their mean: centred columns keep the fit well conditioned."""
    position = np.asarray(position, dtype=np.float64)
    if position.shape != used.shape:
        raise ValueError(f"{name} has shape {position.shape}, expected {used.shape} for this mask")
    position = position[used]
    bad = position.size - np.count_nonzero(np.isfinite(position))
    if bad:
        raise ValueError(f"{name} is not finite at {bad} of {position.size} points inside the mask")
    return position - position.mean() if position.size else position
