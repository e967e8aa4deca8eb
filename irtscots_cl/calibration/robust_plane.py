"""A plane through values with outliers."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray

BISQUARE = 4.685  # standard deviations at which a value loses all weight: 95 % efficient for normal noise
NORMAL = 0.6745  # median absolute deviation of a normal distribution, in standard deviations
MAX_ROUNDS = 100
SAME = 1e-12  # of the scatter: coefficients that move less are final


def robust_plane(x: FloatArray, y: FloatArray, values: FloatArray) -> FloatArray:
    """Coefficients [3] of a + b x + c y through values [n] at (x, y), with little weight for outliers.

    Iterated least squares with Tukey's bisquare weights, of the median absolute deviation (Holland and Welsch, Commun.
    Stat. Theory Methods 6 (1977) 813).
    """
    scale = max(float(np.abs(x).max()), float(np.abs(y).max()), 1e-300)
    terms = np.stack([np.ones_like(x), x / scale, y / scale], -1)
    weight = np.ones_like(values)
    found = np.zeros(3)
    for _ in range(MAX_ROUNDS):
        root = np.sqrt(weight)
        before, solution = found, np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)[0]
        found = solution.astype(float, copy=False)
        left = values - terms @ found
        scatter = float(np.median(np.abs(left - np.median(left)))) / NORMAL
        if scatter <= 1e-14 * max(float(np.abs(values).max()), 1e-300):  # rounding: nothing is an outlier
            break
        weight = np.clip(1 - (left / (BISQUARE * scatter)) ** 2, 0, None) ** 2
        if np.abs(found - before).max() < SAME * scatter:
            break
    return found / [1.0, scale, scale]
