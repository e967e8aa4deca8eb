"""The phase steps that images were really taken at, found from the images alone.

Alternating fits (the advanced iterative algorithm; Wang and Han, Opt. Lett. 29, 1671 (2004)): the steps give each
pixel's offset, cosine and sine; these give each frame's brightness and step. What stays unknown is a step common to all
frames; it is chosen so that the steps found are the nominal ones times a factor, as far as they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.harmonics import wrapped

MIN_STEPS = 5  # with fewer, errors of the steps and of the brightness cannot be told apart
ROUNDS = 500
MOVED_RAD = 1e-7  # by a round, where the search ends
WRONG_RAD = 0.1  # of a step: a difference that no harmonic of a usual screen explains
WRONG_SIGMA = 6.0


@dataclass(frozen=True)
class FoundSteps:
    """Steps [N] of the frames: as said, as found, and the latter's standard errors; brightness: [N] relative."""

    nominal_rad: FloatArray
    found_rad: FloatArray
    standard_error_rad: FloatArray
    brightness: FloatArray

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
    steps, bright = nominal.copy(), np.ones(count)
    for _ in range(ROUNDS):
        model = bright[:, None] * np.stack([np.ones(count), np.cos(steps), np.sin(steps)], -1)
        normal = model.T @ model
        if np.linalg.cond(normal) > 1e6:
            return None
        shapes = np.linalg.solve(normal, model.T @ values)  # [3, n]: offset, cosine, sine
        gram = shapes @ shapes.T
        if np.linalg.cond(gram) > 1e9:
            return None
        frames = values @ shapes.T @ np.linalg.inv(gram)  # [N, 3]
        new = np.unwrap(np.stack([steps, np.arctan2(frames[:, 2], frames[:, 1])]), axis=0)[1]
        new = _fixed(new, nominal)
        moved, steps = np.abs(new - steps).max(), new
        bright = frames[:, 0] / frames[:, 0].mean()
        if moved < MOVED_RAD:
            break
    left = values - frames @ shapes
    variance = np.square(left).sum() / max((count - 3) * pixels, 1)
    across = np.stack([np.zeros(count), -np.sin(steps), np.cos(steps)], -1)
    error = np.sqrt(variance * np.einsum("na,ab,nb->n", across, np.linalg.inv(gram), across))
    return FoundSteps(nominal, steps, error, bright)


def _fixed(found: FloatArray, nominal: FloatArray) -> FloatArray:
    """The steps without the common one that no image can tell: the line through their differences starts at 0."""
    difference = wrapped(found - nominal)
    centred = nominal - nominal.mean()
    slope = (centred * difference).sum() / np.square(centred).sum()
    common = difference.mean() - slope * nominal.mean()
    fixed: FloatArray = nominal + difference - common
    return fixed
