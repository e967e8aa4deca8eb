"""Everything at once, many times: the height errors of all trials of a budget.

Trials are worked on in blocks of fixed size, so that sums have the same bits however often they are made; memory does
not grow with the number of trials. A trial that cannot be measured has failed: it counts as worse than all others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.budget.measured_design import NOLLS
from irtscots_cl.budget.sensitivity import NM, zernike_coefficients
from irtscots_cl.budget.trials import NotMeasuredError, Trials
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system import interruption

BLOCK = 16  # trials measured together


@dataclass(frozen=True)
class MonteCarlo:
    """rms_nm: [trials, 4] of each trial's height error, with LEFT_AFTER removed. zernike_nm: [trials, terms] of NOLLS.

    lost: [trials] share of the pixels that have the mirror or the screen no longer in view: their heights are those of
    chief rays that go on. failed: why, by number, of trials that cannot be measured; their rms is infinite, their terms
    and lost are NaN. mean_mm, deviation_mm: [n] over the other trials of each pixel's height, piston and tilt removed.
    """

    rms_nm: FloatArray = field(repr=False)
    zernike_nm: FloatArray = field(repr=False)
    lost: FloatArray = field(repr=False)
    mean_mm: FloatArray = field(repr=False)
    deviation_mm: FloatArray = field(repr=False)
    failed: dict[int, str] = field(default_factory=dict)

    def percentile_nm(self, share: float) -> FloatArray:
        """[4] below which that share of all trials' rms lies; infinite where too many failed."""
        method = "higher" if self.failed else "linear"  # nothing lies between a number and infinity
        found: FloatArray = np.quantile(self.rms_nm, share, axis=0, method=method)
        return found

    @property
    def root_mean_square_nm(self) -> FloatArray:
        """[4], of the trials that did not fail."""
        found: FloatArray = np.sqrt(np.mean(self.rms_nm[self._measured] ** 2, axis=0))
        return found

    @property
    def zernike_covariance_nm2(self) -> FloatArray:
        """[terms, terms], of the trials that did not fail."""
        found: FloatArray = np.cov(self.zernike_nm[self._measured].T)
        return found

    @property
    def _measured(self) -> BoolArray:
        return np.isfinite(self.rms_nm).all(-1)


def monte_carlo(trials: Trials, done: Callable[[int], None] = lambda count: None) -> MonteCarlo:
    """All trials of a budget. done: called with the number of finished trials.

    Raises SceneError if fewer than two trials can be measured.
    """
    design, count = trials.design, trials.budget.trials
    rms, terms = np.full((count, len(LEFT_AFTER)), np.inf), np.full((count, len(NOLLS)), np.nan)
    lost = np.full(count, np.nan)
    total, squares = np.zeros(design.count), np.zeros(design.count)
    failed: dict[int, str] = {}
    for first in range(0, count, BLOCK):
        interruption.check()
        numbers, heights, lost_of = _measured(trials, range(first, min(first + BLOCK, count)), failed)
        if numbers:
            lost[numbers] = lost_of
            rms[numbers] = design.response.left(heights) * NM
            terms[numbers] = zernike_coefficients(design, heights) * NM
            without = design.response.without(heights, LEFT_AFTER[0])
            total += without.sum(0)
            squares += (without**2).sum(0)
        done(min(first + BLOCK, count))
    measured = count - len(failed)
    if measured < 2:
        first, why = next(iter(failed.items()))
        raise SceneError(
            f"{design.setup.scene.name}: budget.sources: {len(failed)} of {count} trials cannot be measured; must "
            f"leave at least 2. Trial {first}: {why}"
        )
    mean = total / measured
    variance = np.maximum(squares - measured * mean**2, 0.0) / (measured - 1)
    return MonteCarlo(rms, terms, lost, mean, np.sqrt(variance), failed)


def _measured(
    trials: Trials, numbers: Sequence[int], failed: dict[int, str]
) -> tuple[list[int], FloatArray, FloatArray]:
    """The trials of some numbers that can be measured, their heights [trials, n] and lost shares; the others go to
    ``failed``."""
    try:
        return list(numbers), *trials.heights_and_lost([(number, None) for number in numbers])
    except NotMeasuredError as error:
        if len(numbers) == 1:
            failed[numbers[0]] = str(error)
            return [], np.zeros((0, trials.design.count)), np.zeros(0)
    alone = [_measured(trials, [number], failed) for number in numbers]
    measured, heights, lost = zip(*alone, strict=True)
    return [number for one in measured for number in one], np.concatenate(heights), np.concatenate(lost)
