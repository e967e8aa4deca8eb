"""Least-squares fits of Zernike terms: what the samples can tell apart, and how well.

Over a whole disk with many even samples the terms are orthogonal: independent errors of 1 in N samples give every
coefficient a standard error of 1/sqrt(N). On other pupils terms resemble each other, and the error of each grows by its
inflation, sqrt(N [(B^T B)^-1]_jj) with the matrix B of the terms at the samples. Radial orders from which on a term
has more than MAX_INFLATION are left out: their coefficients would be noise, and spoil the others'.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import pinvh, solve_triangular

from irtscots_cl.maths.zernike.annular import annular_zernike
from irtscots_cl.maths.zernike.indices import noll_to_nm
from irtscots_cl.maths.zernike.polynomials import zernike

MAX_INFLATION = 10.0  # of a term's standard error over that on a whole disk
SAMPLES_OF_PART = 2**13  # of a large matrix: its parts stay in the cache
_RIM_TOLERANCE = 1e-12

Values = NDArray[np.float64]
Groups = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ZernikeFit:
    """A fit of Noll terms to samples at fixed points.

    nolls: the terms of the fit, ascending. dropped: those that the samples cannot separate. ratio: of the annulus, 0
    for the terms of the disk. condition: of the matrix of the terms' values, of the fitted ones; condition_all: of all
    that were asked for (infinite if they are more than the samples). inflation: [terms], see the module. basis:
    [samples, terms]. matrix: [terms, samples], from values to coefficients. groups: see separable_terms.
    """

    nolls: tuple[int, ...]
    dropped: tuple[int, ...]
    ratio: float
    condition: float
    condition_all: float
    inflation: Values = field(repr=False)
    basis: Values = field(repr=False)
    matrix: Values = field(repr=False)
    groups: Groups | None = field(default=None, repr=False)

    def coefficients(self, values: Values) -> Values:
        """Coefficients [..., terms] of values [..., samples], in their unit."""
        found: Values = values @ self.matrix.T
        return found

    def residual_rms(self, values: Values) -> float:
        """Rms of what the fit leaves of values [samples]."""
        left = _levelled(values[:, None], self.groups)[:, 0] - self.basis @ self.coefficients(values)
        return float(np.sqrt(np.mean(left**2)))


def separable_terms(
    x: Values, y: Values, nolls: Sequence[int], ratio: float = 0.0, groups: Groups | None = None
) -> ZernikeFit:
    """The fit of those of the Noll terms ``nolls`` that samples at x, y [samples] in units of the radius can separate.

    ratio: above 0 for annular terms (annular.py). groups: [samples], from 0: the values of each group but the first
    have an unknown piston, which is fitted too. Whole radial orders are left out, the highest first, until no inflation
    is above MAX_INFLATION. Raises ValueError for no term or no sample.
    """
    nolls = sorted(set(nolls))
    if not nolls or not x.size:
        raise ValueError("a Zernike fit needs at least one term and one sample")
    basis = np.stack([annular_zernike(j, x, y, ratio) if ratio else zernike(j, x, y) for j in nolls], axis=1)
    basis = _levelled(basis, groups)
    order = [noll_to_nm(j)[0] for j in nolls]
    ends = [k for k in range(1, len(nolls) + 1) if k == len(nolls) or order[k] > order[k - 1]]
    triangle: Values = np.linalg.qr(basis, mode="r")  # type: ignore[assignment]  # NumPy's types leave R alone out
    condition_all = _condition(triangle) if x.size >= len(nolls) else np.inf
    for count in reversed(ends):
        inflation = _inflation(triangle[:count, :count], x.size)
        if inflation.max() <= MAX_INFLATION or count == ends[0]:
            break
    orthogonal, part = np.linalg.qr(basis[:, :count])
    matrix = solve_triangular(part, orthogonal.T)
    return ZernikeFit(
        tuple(nolls[:count]), tuple(nolls[count:]), ratio, _condition(part), condition_all, inflation,
        basis[:, :count], matrix, groups,
    )  # fmt: skip


def smoothing_matrix(basis: Values, groups: Groups | None = None) -> Values:
    """Matrix [terms, samples] from values to coefficients of the terms ``basis`` [terms, samples], by least squares.

    It uses normal equations, for terms that are nearly orthogonal. Combinations of terms that the samples cannot
    separate are omitted. groups: [samples], from 0, of samples with an unknown piston of their own.
    """
    if groups is not None:
        members = np.equal.outer(np.arange(groups.max() + 1), groups)
        basis = basis - (basis @ members.T / members.sum(axis=1))[:, groups]
    fit: Values = pinvh(basis @ basis.T, rtol=1e-10) @ basis
    return fit


def large_smoothing_matrix(
    basis_of: Callable[[slice], Values], terms: int, samples: int, groups: Groups | None = None
) -> NDArray[np.float32]:
    """As smoothing_matrix, for more samples than memory should hold in float64: sums in float64, the matrix in float32.

    basis_of: the terms [terms, part] at a part of the samples. Apply it with `applied`.
    """
    basis, gram = np.empty((terms, samples), np.float32), np.zeros((terms, terms))
    sums = None if groups is None else np.zeros((terms, int(groups.max()) + 1))
    for part in _parts(samples):
        exact = basis_of(part)
        basis[:, part] = exact
        gram += exact @ exact.T
        if sums is not None and groups is not None:
            sums += exact @ np.equal.outer(groups[part], np.arange(sums.shape[1]))
    means = None
    if sums is not None and groups is not None:
        means = sums / np.bincount(groups, minlength=sums.shape[1])
        gram -= means @ sums.T  # of the basis without its mean over each group
    solving = pinvh(gram, rtol=1e-10)
    for part in _parts(samples):
        values = basis[:, part].astype(np.float64)
        if means is not None and groups is not None:
            values -= means[:, groups[part]]
        basis[:, part] = solving @ values
    return basis


def applied(fit: NDArray[np.floating], values: Values) -> Values:
    """fit @ values in float64, without a float64 copy of a float32 matrix."""
    if fit.dtype == np.float64:
        whole: Values = fit @ values
        return whole
    parts = [fit[:, part].astype(np.float64) @ values[part] for part in _parts(len(values))]
    total: Values = np.sum(parts, axis=0)
    return total


def _parts(samples: int) -> Iterator[slice]:
    return (slice(first, first + SAMPLES_OF_PART) for first in range(0, samples, SAMPLES_OF_PART))


def zernike_fit(
    x: ArrayLike,
    y: ArrayLike,
    values: ArrayLike,
    indices: Sequence[int],
    ordering: str = "noll",
    weights: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Least-squares coefficients [len(indices)] of Noll-normalised terms, in the order of ``indices``.

    Minimises sum weights (values - fit)^2 over the samples that are finite, lie on the unit disk and have a
    positive weight; weights are 1 by default (for noise use 1/variance). ``x``, ``y``, ``values`` and
    ``weights`` broadcast together. The coefficients have the unit of ``values``.

    Raises ValueError for no or invalid indices, negative or non-finite weights, fewer usable samples than
    terms, or samples that cannot separate the terms.
    """
    if len(indices) == 0:
        raise ValueError("a Zernike fit needs at least one index")
    weights = np.asarray(1.0 if weights is None else weights, dtype=np.float64)
    if not np.all(np.isfinite(weights) & (weights >= 0.0)):
        raise ValueError("the weights of a Zernike fit must be finite and not negative")
    samples = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x, y, values)), weights)
    x, y, values, weights = samples
    usable = np.isfinite(x) & np.isfinite(y) & np.isfinite(values) & (weights > 0.0)
    usable[usable] = np.hypot(x[usable], y[usable]) <= 1.0 + _RIM_TOLERANCE
    count = np.count_nonzero(usable)
    if count < len(indices):
        raise ValueError(f"{len(indices)} Zernike terms cannot be fitted to {count} samples")
    terms = [zernike(j, x[usable], y[usable], ordering) for j in indices]
    root = np.sqrt(weights[usable])
    solution: NDArray[np.float64]
    solution, _, rank, _ = np.linalg.lstsq(np.stack(terms, axis=1) * root[:, None], values[usable] * root)
    if rank < len(indices):
        raise ValueError(f"the samples tell only {rank} of the {len(indices)} Zernike terms apart")
    return solution


def _levelled(columns: Values, groups: Groups | None) -> Values:
    """Columns [samples, ...] without the mean of every group but the first: its piston fitted and removed."""
    if groups is None or not groups.any():
        return columns
    sums = np.stack([np.bincount(groups, column) for column in columns.T], axis=1)
    means = sums / np.maximum(np.bincount(groups), 1)[:, None]
    means[0] = 0.0
    levelled: Values = columns - means[groups]
    return levelled


def _inflation(triangle: Values, samples: int) -> Values:
    """Inflation [terms] from the triangular factor; infinite where a term is a sum of others."""
    if triangle.shape[0] < triangle.shape[1]:
        return np.full(triangle.shape[1], np.inf)
    diagonal = np.abs(np.diag(triangle))
    if diagonal.min() <= np.finfo(float).eps * diagonal.max() * samples:
        return np.full(triangle.shape[1], np.inf)
    inverse = solve_triangular(triangle, np.eye(len(triangle)))
    inflation: Values = np.sqrt(samples * np.sum(inverse**2, axis=1))
    return inflation


def _condition(triangle: Values) -> float:
    singular = np.linalg.svd(triangle, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 0 else float("inf")
