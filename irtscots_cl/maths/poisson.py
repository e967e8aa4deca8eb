"""Poisson numbers by inversion: the quantile function, fast for whole images.

One uniform number gives one count, which grows with the mean: an image and the same image with more light differ by
the light, not by the luck of the draw. Means below SMALL_MEAN are searched from 0 upwards; larger ones follow from the
normal quantile by the asymptotic series of M. B. Giles, "Algorithm 955: approximation of the inverse Poisson cumulative
distribution function", ACM Trans. Math. Softw. 42 (2016), and are checked by the distribution itself where the series
comes near the step from one count to the next.
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaincc, ndtri

from irtscots_cl.maths.arrays import FloatArray

SMALL_MEAN = 16.0
MAX_COUNT = 200  # P(X > 200) for a mean of 16 is below 1e-100: a search that ends
SERIES_ERROR = 0.02  # of the first term left out; at most 0.008 was found for means from 16 on and |w| up to 7
EXACT_BELOW = 2.0**50  # larger counts are rounded by float64 anyway


def poisson_quantile(probability: FloatArray, mean: FloatArray) -> FloatArray:
    """The least count k with P(X <= k) >= probability for X ~ Poisson(mean), as float64; arrays [n].

    probability: in (0, 1). mean: at least 0; a mean of 0 gives 0.
    """
    counts = np.zeros(mean.shape)
    small = (mean > 0) & (mean < SMALL_MEAN)
    large = mean >= SMALL_MEAN
    if small.any():
        counts[small] = _searched(probability[small], mean[small])
    if large.any():
        counts[large] = _expanded(probability[large], mean[large])
    return counts


def _searched(probability: FloatArray, mean: FloatArray) -> FloatArray:
    """Adds up the probabilities of 0, 1, 2, ... until they reach the given one."""
    counts = np.zeros(mean.shape)
    at = np.arange(len(mean))  # samples that are still searched
    term = np.exp(-mean)
    left = probability - term
    for count in range(1, MAX_COUNT):
        going = left > 0
        if not going.any():
            break
        at, left, term = at[going], left[going], term[going]
        counts[at] = count
        term = term * (mean[at] / count)
        left = left - term
    return counts


def _expanded(probability: FloatArray, mean: FloatArray) -> FloatArray:
    """The whole part of x with Q(x, mean) = probability, Q the regularised upper incomplete gamma function.

    P(X <= k) = Q(k + 1, mean), so the least k with P(X <= k) >= probability is the whole part of x.
    """
    w, root = ndtri(probability), np.sqrt(mean)
    square = w * w
    x = mean + root * w + (2.0 + square) / 6.0 - w * (2.0 + square) / (72.0 * root)
    x += (square * (3.0 * square + 7.0) - 16.0) / (810.0 * mean)
    counts: FloatArray = np.maximum(np.floor(x), 0.0)
    doubt = SERIES_ERROR * (1.0 + np.abs(w) * square * square) / (mean * root)
    near = np.flatnonzero((np.abs(x - np.rint(x)) < doubt) & (x < EXACT_BELOW))
    if len(near):
        counts[near] = _stepped(counts[near], probability[near], mean[near])
    return counts


def _stepped(counts: FloatArray, probability: FloatArray, mean: FloatArray) -> FloatArray:
    """Counts that are off by at most a few, moved to the least one whose probability suffices."""
    for _ in range(MAX_COUNT):
        up = gammaincc(counts + 1.0, mean) < probability
        if not up.any():
            break
        counts = counts + up
    for _ in range(MAX_COUNT):
        down = counts > 0
        down[down] = gammaincc(counts[down], mean[down]) >= probability[down]
        if not down.any():
            break
        counts = counts - down
    return counts
