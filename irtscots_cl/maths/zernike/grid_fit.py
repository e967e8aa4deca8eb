"""Least-squares fit of Zernike terms to all pixels of an even grid, however many there are.

Every term is a polynomial of x and y, so a sum of products of Chebyshev polynomials of x and of y. The sums over pixels
that the normal equations need are then products of the map with two narrow matrices: exact, and without the values of
the terms at the pixels. The terms are nearly orthogonal, and the residual is fitted once more, so that the normal
equations lose nothing that counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander
from numpy.typing import NDArray

from irtscots_cl.maths.zernike.fit import MAX_INFLATION
from irtscots_cl.maths.zernike.indices import noll_to_nm
from irtscots_cl.maths.zernike.polynomials import zernike

Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GridFit:
    """Noll terms on the pixels of a grid. nolls: the terms of the fit, ascending. dropped: those that the pixels cannot
    separate (whole radial orders, the highest first, as in fit.separable_terms)."""

    nolls: tuple[int, ...]
    dropped: tuple[int, ...]
    used: NDArray[np.bool_] = field(repr=False)
    of_columns: Values = field(repr=False)  # [columns, degrees] Chebyshev polynomials of x
    of_rows: Values = field(repr=False)  # [rows, degrees] of y
    products: Values = field(repr=False)  # [terms, degrees of y, degrees of x]
    inverse: Values = field(repr=False)  # [terms, terms] of the normal equations

    def coefficients(self, heights: Values) -> Values:
        """Coefficients [terms] of heights [rows, columns], in their unit."""
        left = np.where(self.used, heights, 0.0)
        first = self._solved(left)
        second = self._solved(np.where(self.used, left - self.values(first), 0.0))
        found: Values = first + second
        return found

    def values(self, coefficients: Values) -> Values:
        """The sum of the terms at all pixels [rows, columns], used or not."""
        whole = np.einsum("j,jab->ab", coefficients, self.products)
        found: Values = self.of_rows @ whole @ self.of_columns.T
        return found

    def _solved(self, heights: Values) -> Values:
        sums = self.of_rows.T @ heights @ self.of_columns
        found: Values = self.inverse @ np.einsum("jab,ab->j", self.products, sums)
        return found


def grid_fit(
    u: Values, v: Values, used: NDArray[np.bool_], nolls: Sequence[int], most: float = MAX_INFLATION
) -> GridFit:
    """The fit of those of the Noll terms ``nolls`` that the used pixels [rows, columns] can separate.

    u: [columns], v: [rows], places in units of the disk's radius, within the disk where pixels are used.
    most: inflation (fit.py) that a term may have. Raises ValueError for no term or no pixel.
    """
    nolls = sorted(set(nolls))
    if not nolls or not used.any():
        raise ValueError("a Zernike fit needs at least one term and one pixel")
    degree = noll_to_nm(nolls[-1])[0]
    places = [np.where(used.any(axis=axis), at, 0.0).astype(np.float64) for axis, at in ((0, u), (1, v))]
    wide_u, wide_v = (np.asarray(chebvander(at, 2 * degree), np.float64) for at in places)
    products = _products(nolls, degree)
    gram = _gram(products, wide_v.T @ used.astype(float) @ wide_u) / used.sum()
    order = [noll_to_nm(j)[0] for j in nolls]
    ends = [k for k in range(1, len(nolls) + 1) if k == len(nolls) or order[k] > order[k - 1]]
    for count in reversed(ends):
        inverse = _inverse(gram[:count, :count])
        if np.sqrt(np.diag(inverse).max()) <= most or count == ends[0]:
            break
    few = slice(0, degree + 1)
    return GridFit(
        tuple(nolls[:count]), tuple(nolls[count:]), used, wide_u[:, few], wide_v[:, few], products[:count],
        inverse / used.sum(),
    )  # fmt: skip


def _products(nolls: Sequence[int], degree: int) -> Values:
    """Chebyshev coefficients [terms, degrees of y, degrees of x] of the terms."""
    nodes = chebpts1(degree + 1)
    from_values = np.linalg.inv(chebvander(nodes, degree))
    x, y = np.meshgrid(nodes, nodes)
    return np.stack([from_values @ zernike(j, x, y) @ from_values.T for j in nolls])


def _gram(products: Values, sums: Values) -> Values:
    """Sums over the pixels of the product of every two terms [terms, terms], from sums [degrees of y, degrees of x] of
    Chebyshev polynomials up to twice the degree: T_a T_b = (T_(a + b) + T_|a - b|) / 2."""
    a = np.arange(products.shape[1])
    above, below = np.add.outer(a, a), np.abs(np.subtract.outer(a, a))
    along_x = (sums[:, above] + sums[:, below]) / 2  # [degrees of y, c, d]
    both = (along_x[above] + along_x[below]) / 2  # [a, b, c, d]
    found: Values = np.einsum("jac,kbd,abcd->jk", products, products, both, optimize=True)
    return found


def _inverse(gram: Values) -> Values:
    """The inverse; infinite where terms are sums of others."""
    values, vectors = np.linalg.eigh(gram)
    if not values.min() > 1e3 * np.finfo(float).eps * values.max():
        return np.full_like(gram, np.inf)
    found: Values = (vectors / values) @ vectors.T
    return found
