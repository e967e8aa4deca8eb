"""Products with long rows whose bits do not depend on how many threads BLAS has.

BLAS shares a large product among its threads and adds up in another order with each number of them. Here NumPy's own
loops add up, which takes two to four times as long for a few rows.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray


def dots_of_rows(left: FloatArray, right: FloatArray) -> FloatArray:
    """Dots [..., k] of rows [..., n] with each of the rows [k, n]; fast where both are contiguous."""
    found: FloatArray = np.einsum("...n,kn->...k", left, right)
    return found


def sums_of_rows(weights: FloatArray, rows: FloatArray) -> FloatArray:
    """Sums [..., n] of rows [k, n], each times its weight [..., k]."""
    found: FloatArray = np.einsum("...k,kn->...n", weights, rows)
    return found


def without_rows(values: FloatArray, rows: FloatArray) -> FloatArray:
    """Values [..., n] less their parts along orthonormal rows [k, n]."""
    found: FloatArray = values - sums_of_rows(dots_of_rows(values, rows), rows)
    return found


def dual_rows(rows: FloatArray) -> FloatArray:
    """The dual basis [k, n] of independent rows [k, n]: its dots with values are their least-squares coefficients.

    By Gram-Schmidt with every row made orthogonal twice, which is as stable as Householder's way.
    """
    count = len(rows)
    own, parts = np.empty_like(rows), np.zeros((count, count))  # rows = parts @ own, own orthonormal
    for k, row in enumerate(rows):
        for _ in range(2):
            along = dots_of_rows(row, own[:k])
            parts[k, :k] += along
            row = row - sums_of_rows(along, own[:k])
        parts[k, k] = np.sqrt(np.einsum("n,n->", row, row))
        own[k] = row / parts[k, k]
    dual = np.empty_like(rows)
    for k in reversed(range(count)):
        dual[k] = (own[k] - sums_of_rows(parts[k + 1 :, k], dual[k + 1 :])) / parts[k, k]
    return dual
