"""Values of the sources: shares of their distributions by a Sobol sequence, and the quantiles there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline, CubicSpline
from scipy.special import ndtri
from scipy.stats import qmc

from irtscots_cl.budget.joint import Joint
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.error_sources import Distribution

KURTOSIS = {"normal": 0.0, "uniform": -1.2, "triangular": -0.6}  # excess
NODES = 2000  # in either part of the table of a mean, near its end and beyond
LEAST_SHARE = 1e-100  # beyond which no number is asked for
CENTRE = 2.0**-31  # of Sobol's cells: the numbers are multiples of 2^-30, and 0 has no inverse


def even_shares(dimensions: int, points: int, seed: int) -> FloatArray:
    """The first points of a scrambled Sobol sequence [points, dimensions], each number within (0, 1)."""
    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    found: FloatArray = sequence.random_base2(math.ceil(math.log2(points)))[:points] + CENTRE
    return found


def quantile(distribution: Distribution, share: FloatArray) -> FloatArray:
    """Values below which a share (0 to 1) of a distribution lies; of the mean of its values, where it has several."""
    size, count = distribution.size, distribution.values
    if distribution.kind == "normal":
        values: FloatArray = size / math.sqrt(count) * ndtri(share)
        return values
    if distribution.kind == "triangular":  # the mean of two uniform values
        count *= 2
    return size * _mean_of_uniform(share, count)


def excess(distribution: Distribution) -> float:
    """Variance of the square of the value over the square of its variance: 2 plus the excess kurtosis."""
    return 2.0 + KURTOSIS[distribution.kind] / distribution.values


def _mean_of_uniform(share: FloatArray, count: int) -> FloatArray:
    """Quantiles of the mean of so many values that are uniform within (-1, 1)."""
    if count == 1:
        return 2 * share - 1
    if count == 2:
        low = np.sqrt(2 * np.minimum(share, 1 - share))
        found: FloatArray = np.where(share < 0.5, low - 1, 1 - low)
        return found
    lower = _normal_to_lower_half(count)(ndtri(np.minimum(share, 1 - share)))
    return np.where(share < 0.5, lower, -lower)


@lru_cache
def _normal_to_lower_half(count: int) -> CubicSpline:
    """The mean of so many values, uniform within (-1, 1), by the normal number below which the same share lies.

    For means up to 0. The density of a sum of values within (0, 1) is a basis spline.
    """
    below = BSpline.basis_element(np.arange(count + 1), extrapolate=False).antiderivative()
    near_end = np.geomspace(1e-5, 1e-2, NODES)
    total = count / 2 * np.concatenate([near_end, np.linspace(near_end[-1], 1.0, NODES)[1:]])
    share = below(total)
    use = share > LEAST_SHARE
    return CubicSpline(ndtri(share[use]), 2 * total[use] / count - 1)


def drawn(
    given: Mapping[str, Distribution], joint: Joint, names: Sequence[str], shares: FloatArray
) -> dict[str, FloatArray]:
    """Values [points] by name, of shares [points, names] of the distributions; of joint sources, together."""
    together = [names.index(name) for name in joint.names if name in names]
    if together:
        found = joint.values(ndtri(shares[:, together])).T
        values = dict(zip(joint.names, found, strict=True))
    else:
        values = {}
    return {name: values[name] if name in values else quantile(given[name], shares[:, k])
            for k, name in enumerate(names)}  # fmt: skip
