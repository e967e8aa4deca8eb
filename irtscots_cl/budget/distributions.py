"""Values of the sources: shares of their distributions by a Sobol sequence, and the quantiles there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from irtscots_cl.budget.joint import Joint
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.error_sources import Distribution

CENTRE = 2.0**-31  # of Sobol's cells: the numbers are multiples of 2^-30, and 0 has no inverse


def even_shares(dimensions: int, points: int, seed: int) -> FloatArray:
    """The first points of a scrambled Sobol sequence [points, dimensions], each number within (0, 1)."""
    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    found: FloatArray = sequence.random_base2(math.ceil(math.log2(points)))[:points] + CENTRE
    return found


def quantile(distribution: Distribution, share: FloatArray) -> FloatArray:
    """Values below which a share (0 to 1) of a distribution lies."""
    size = distribution.size
    if distribution.kind == "normal":
        values: FloatArray = size * ndtri(share)
        return values
    if distribution.kind == "uniform":
        return size * (2 * share - 1)
    low = np.sqrt(2 * np.minimum(share, 1 - share))  # triangular
    return size * np.where(share < 0.5, low - 1, 1 - low)


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
