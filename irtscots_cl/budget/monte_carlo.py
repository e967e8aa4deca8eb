"""Everything at once, many times: the height errors of all trials of a budget.

Trials are worked on in blocks of fixed size, so that sums have the same bits however often they are made; memory does
not grow with the number of trials.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.budget.sensitivity import NM, zernike_coefficients
from irtscots_cl.budget.trials import Trials
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system import interruption

BLOCK = 16  # trials measured together


@dataclass(frozen=True)
class MonteCarlo:
    """rms_nm: [trials, 4] of each trial's height error, with LEFT_AFTER removed. zernike_nm: [trials, terms] of NOLLS.

    mean_mm, deviation_mm: [n] over the trials of each pixel's height, piston and tilt removed.
    """

    rms_nm: FloatArray = field(repr=False)
    zernike_nm: FloatArray = field(repr=False)
    mean_mm: FloatArray = field(repr=False)
    deviation_mm: FloatArray = field(repr=False)

    def percentile_nm(self, share: float) -> FloatArray:
        """[4] below which that share of the trials' rms lies."""
        found: FloatArray = np.quantile(self.rms_nm, share, axis=0)
        return found

    @property
    def zernike_covariance_nm2(self) -> FloatArray:
        """[terms, terms]."""
        found: FloatArray = np.cov(self.zernike_nm.T)
        return found


def monte_carlo(trials: Trials, done: Callable[[int], None] = lambda count: None) -> MonteCarlo:
    """All trials of a budget. done: called with the number of finished trials."""
    design, count = trials.design, trials.budget.trials
    rms, terms = [], []
    total, squares = np.zeros(design.count), np.zeros(design.count)
    for first in range(0, count, BLOCK):
        interruption.check()
        numbers = range(first, min(first + BLOCK, count))
        heights = trials.heights_mm([(k, None) for k in numbers])
        rms.append(design.response.left(heights) * NM)
        terms.append(zernike_coefficients(design, heights) * NM)
        without = design.response.without(heights, "piston_tilt")
        total += without.sum(0)
        squares += (without**2).sum(0)
        done(numbers[-1] + 1)
    mean = total / count
    variance = np.maximum(squares - count * mean**2, 0.0) / (count - 1)
    return MonteCarlo(np.concatenate(rms), np.concatenate(terms), mean, np.sqrt(variance))
