"""Significance of differences between counts, and limits that hold for many tests at once."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats


def sidak_z(tests: int, failure_chance: float) -> float:
    """Two-sided limit for |z| that `tests` independent standard normals all keep but with that chance."""
    single = -math.expm1(math.log1p(-failure_chance) / tests)  # 1 - (1 - chance)^(1 / tests), without cancellation
    return float(stats.norm.isf(single / 2))


def sidak_p(tests: int, failure_chance: float) -> float:
    """The p-value that `tests` independent tests all exceed but with that chance."""
    return -math.expm1(math.log1p(-failure_chance) / tests)


def poisson_ratio_p(first: np.ndarray, second: np.ndarray, first_share: np.ndarray) -> np.ndarray:
    """Two-sided p-values for pairs of Poisson counts whose means stand as first_share to 1 - first_share.

    Given its total, the first count of a pair is binomial: exact at any count. The two-sided value is twice
    the smaller tail, at most 1; a pair of zeros gives 1. Counts are discrete: they keep the chance or less.
    """
    total = first + second
    lower = stats.binom.cdf(first, total, first_share)
    upper = stats.binom.sf(first - 1, total, first_share)
    return np.minimum(2 * np.minimum(lower, upper), 1.0)


def pooled(observed: np.ndarray, expected: np.ndarray, least: float = 10.0) -> tuple[np.ndarray, np.ndarray]:
    """Neighbouring bins [n] joined until each expects at least `least`: (observed, expected) of those.

    What is left over at the end joins the last bin. Raises ValueError if all together expect less.
    """
    if expected.sum() < least:
        raise ValueError(f"all bins together expect {expected.sum():g}, less than {least:g}")
    starts, held = [0], 0.0
    for k, value in enumerate(expected):
        if held >= least:
            starts.append(k)
            held = 0.0
        held += value
    if held < least:
        starts.pop()
    return np.add.reduceat(observed, starts), np.add.reduceat(expected, starts)


def chi_square_p(observed: np.ndarray, expected: np.ndarray, fitted: int = 0) -> float:
    """Upper-tail p-value of Pearson's chi-square over pooled bins.

    fitted: the number of constraints that tie expected to observed.
    """
    observed, expected = pooled(np.ravel(observed), np.ravel(expected))
    return float(stats.chi2.sf(((observed - expected) ** 2 / expected).sum(), len(observed) - fitted))
