"""The phase steps that images were really taken at, found from the images alone.

Alternating fits (the advanced iterative algorithm; Wang and Han, Opt. Lett. 29, 1671 (2004)): the steps give each
pixel's offset, cosine and sine; these give each frame's step. What stays unknown is a step common to all frames; it is
chosen so that the steps found are the nominal ones times a factor, as far as they are. All frames are taken for equally
bright: brightness that varies as a cosine of the steps cannot be told from other steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.harmonics import wrapped

MIN_STEPS = 5  # with fewer, the samples of a pixel leave too little to tell errors of the steps by
ROUNDS = 500
MAX_CONDITION = 1e5  # of the fits: beyond, steps or phases are too much alike
MOVED_RAD = 1e-6  # by a round, where the search ends
WRONG_RAD = 0.1  # of a step: a difference that no harmonic of a usual screen explains
WRONG_SIGMA = 6.0


@dataclass(frozen=True)
class FoundSteps:
    """Steps [N] of the frames: as said, as found, and the standard errors of their differences."""

    nominal_rad: FloatArray
    found_rad: FloatArray
    standard_error_rad: FloatArray

    @property
    def difference_rad(self) -> FloatArray:
        return wrapped(self.found_rad - self.nominal_rad)

    @property
    def wrong(self) -> IntArray:
        """Numbers of the frames whose step is not the nominal one."""
        size = np.abs(self.difference_rad)
        return np.flatnonzero((size > WRONG_RAD) & (size > WRONG_SIGMA * self.standard_error_rad))


def find_steps(samples: NDArray[Any], nominal_rad: FloatArray) -> FoundSteps | None:
    """Steps of the frames of samples [N, n], n pixels of different phases without missing samples.

    None where the images cannot tell: with fewer than MIN_STEPS steps, or where the search does not settle.
    """
    nominal = np.asarray(nominal_rad, float)
    count, pixels = samples.shape
    if count < MIN_STEPS or pixels < 4 * count:
        return None
    values = np.asarray(samples, float)
    steps = nominal.copy()
    for _ in range(ROUNDS):
        model = np.stack([np.ones(count), np.cos(steps), np.sin(steps)], -1)
        if np.linalg.cond(model) > MAX_CONDITION:
            return None
        shapes = np.linalg.pinv(model) @ values  # [3, n]: offset, cosine, sine
        across = shapes[1:] @ shapes[1:].T
        if np.linalg.cond(across) > MAX_CONDITION:
            return None
        frames = (values - shapes[0]) @ shapes[1:].T @ np.linalg.inv(across)  # [N, 2]
        new = _fixed(np.arctan2(frames[:, 1], frames[:, 0]), nominal)
        moved, steps = np.abs(new - steps).max(), new
        if moved < MOVED_RAD:
            break
    left = values - model @ shapes
    variance = np.square(left).sum() / max((count - 3) * pixels - count, 1)
    return FoundSteps(nominal, steps, np.sqrt(variance * np.diag(_covariance(steps, nominal, across))))


def _covariance(steps: FloatArray, nominal: FloatArray, across: FloatArray) -> FloatArray:
    """Covariance [N, N] of the steps for samples of unit variance; across: [2, 2] sums of cosine and sine products.

    The pixels' parameters are fitted to the same samples: what they leave of a change of the steps is what tells it.
    """
    model = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)
    rest = np.eye(len(steps)) - model @ np.linalg.pinv(model)
    turn = np.stack([-np.sin(steps), np.cos(steps)], -1)
    known = np.linalg.pinv(rest * (turn @ across @ turn.T), rcond=1e-9, hermitian=True)
    fixing = np.stack([_fixed(nominal + 1e-3 * row, nominal) - nominal for row in np.eye(len(steps))], -1) / 1e-3
    covariance: FloatArray = fixing @ known @ fixing.T
    return covariance


def _fixed(found: FloatArray, nominal: FloatArray) -> FloatArray:
    """The steps without the common one that no image can tell: the line through their differences starts at 0."""
    difference = wrapped(found - nominal)
    centred = nominal - nominal.mean()
    slope = (centred * difference).sum() / np.square(centred).sum()
    common = difference.mean() - slope * nominal.mean()
    fixed: FloatArray = nominal + difference - common
    return fixed
