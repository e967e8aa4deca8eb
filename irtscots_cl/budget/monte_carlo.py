"""Everything at once, many times: the height errors of all trials of a budget.

Trials are worked on in blocks of fixed size (trial_blocks.py), here or by other processes, so that sums have the same
bits however often they are made; memory grows by some numbers for each trial, not by its map. A trial that cannot be
measured has failed: it counts as worse than all others.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from irtscots_cl.budget.measured_design import NOLLS
from irtscots_cl.budget.trial_blocks import TrialBlock, block_count, block_of, trials_to
from irtscots_cl.budget.trials import Trials
from irtscots_cl.budget.trials_text import block_of_text, trials_text
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system import interruption


class Workers(Protocol):
    """Other processes that work on tasks."""

    def in_order(self, function: Callable[..., Any], items: Iterable[Any], *arguments: Any) -> Generator[Any]:
        """Results of function(*arguments, item) of all items, in their order."""


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


def monte_carlo(
    trials: Trials, done: Callable[[int], None] = lambda count: None, workers: Workers | None = None
) -> MonteCarlo:
    """All trials of a budget. done: called with the number of finished trials.

    workers: who work on the blocks, such as irtscots_cl.execution.dask.workers.Workers; this process by default. Sums
    are added up here, in the order of the blocks, so that on equal machines the bits do not depend on the workers.
    Raises SceneError if fewer than two trials can be measured, and the errors of the workers.
    """
    design, count = trials.design, trials.budget.trials
    rms, terms = np.full((count, len(LEFT_AFTER)), np.inf), np.full((count, len(NOLLS)), np.nan)
    lost = np.full(count, np.nan)
    total, squares = np.zeros(design.count), np.zeros(design.count)
    failed: dict[int, str] = {}
    with closing(_blocks(trials, workers)) as blocks:
        for k, block in enumerate(blocks):
            rms[block.numbers], terms[block.numbers] = block.rms_nm, block.zernike_nm
            lost[block.numbers] = block.lost
            total += block.sum_mm
            squares += block.squares_mm2
            failed |= block.failed
            done(trials_to(trials, k))
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


def _blocks(trials: Trials, workers: Workers | None) -> Generator[TrialBlock]:
    """All blocks, in order."""
    numbers = range(block_count(trials))
    if workers is not None:
        yield from workers.in_order(block_of_text, numbers, trials_text(trials))
        return
    for number in numbers:
        interruption.check()
        yield block_of(trials, number)
