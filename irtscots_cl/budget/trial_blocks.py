"""Trials in blocks of fixed size: what of a block is kept, a pure function of the trials and the block's number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.budget.measured_design import NOLLS
from irtscots_cl.budget.sensitivity import NM, zernike_coefficients
from irtscots_cl.budget.trials import NotMeasuredError, Trials
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import FloatArray

BLOCK = 16  # trials measured together


@dataclass(frozen=True)
class TrialBlock:
    """numbers: of the k trials of a block that can be measured. rms_nm: [k, 4], with LEFT_AFTER removed.
    zernike_nm: [k, terms] of NOLLS. lost: [k] shares of the pixels that are out of view. sum_mm, squares_mm2: [n]
    sums over them of heights, piston and tilt removed, and of squares. failed: why, by number, the others cannot be
    measured.
    """

    numbers: list[int]
    rms_nm: FloatArray = field(repr=False)
    zernike_nm: FloatArray = field(repr=False)
    lost: FloatArray = field(repr=False)
    sum_mm: FloatArray = field(repr=False)
    squares_mm2: FloatArray = field(repr=False)
    failed: dict[int, str] = field(default_factory=dict)


def block_count(trials: Trials) -> int:
    return -(-trials.budget.trials // BLOCK)


def trials_to(trials: Trials, block: int) -> int:
    """How many trials there are up to the end of a block."""
    return min((block + 1) * BLOCK, trials.budget.trials)


def block_of(trials: Trials, block: int) -> TrialBlock:
    """The block of that number, from 0 on."""
    design, failed = trials.design, dict[int, str]()
    numbers, heights, lost = _measured(trials, range(block * BLOCK, trials_to(trials, block)), failed)
    if not numbers:
        nothing = np.zeros(design.count)
        none = np.zeros((0, len(LEFT_AFTER))), np.zeros((0, len(NOLLS))), np.zeros(0)
        return TrialBlock([], *none, nothing, nothing, failed)
    without = design.response.without(heights, LEFT_AFTER[0])
    return TrialBlock(
        numbers,
        design.response.left(heights) * NM,
        zernike_coefficients(design, heights) * NM,
        lost,
        without.sum(0),
        (without**2).sum(0),
        failed,
    )


def _measured(
    trials: Trials, numbers: Sequence[int], failed: dict[int, str]
) -> tuple[list[int], FloatArray, FloatArray]:
    """The trials of some numbers that can be measured, their heights [trials, n] and lost shares [trials]; the others
    go to ``failed``."""
    try:
        return list(numbers), *trials.heights_and_lost([(number, None) for number in numbers])
    except NotMeasuredError as error:
        if len(numbers) == 1:
            failed[numbers[0]] = str(error)
            return [], np.zeros((0, trials.design.count)), np.zeros(0)
    alone = [_measured(trials, [number], failed) for number in numbers]
    measured, heights, lost = zip(*alone, strict=True)
    return [number for one in measured for number in one], np.concatenate(heights), np.concatenate(lost)
