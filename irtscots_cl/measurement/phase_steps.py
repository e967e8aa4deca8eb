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
from scipy.stats import siegelslopes

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.harmonics import wrapped
from irtscots_cl.measurement.phase import fit_sinusoid

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


def find_steps(
    samples: NDArray[Any], nominal_rad: FloatArray, saturation: float = np.inf, start_rad: FloatArray | None = None
) -> FoundSteps | None:
    """Steps of the frames of samples [N, n], n pixels of different phases.

    Samples at or above `saturation`, and those that are no numbers, are left out. start_rad: steps [N] to begin with;
    None: the nominal ones. None where the images cannot tell: with fewer than MIN_STEPS steps, or where pixels or
    frames are too much alike.
    """
    nominal = np.asarray(nominal_rad, float)
    count = len(samples)
    values = np.array(samples, float)
    values[~(values < saturation)] = np.nan
    used = np.isfinite(values)
    enough = used.sum(0) >= MIN_STEPS
    values, used = values[:, enough], used[:, enough]
    pixels = values.shape[1]
    if count < MIN_STEPS or pixels < 4 * count:
        return None
    steps = nominal.copy() if start_rad is None else start_rad
    for _ in range(ROUNDS):
        if np.linalg.cond(_model(steps)) > MAX_CONDITION:
            return None
        fit = fit_sinusoid(values, steps)
        shapes = np.stack([fit.cosine, fit.sine])
        good = used & np.isfinite(fit.offset)
        products = np.where(np.isfinite(fit.offset), shapes[:, None] * shapes[None], 0.0)
        across = np.einsum("np,abp->nab", good, products, optimize=True)  # [N, 2, 2]
        if not np.linalg.cond(across).max() < MAX_CONDITION:
            return None
        right = np.where(good, values - fit.offset, 0.0) @ np.where(np.isfinite(shapes), shapes, 0.0).T
        frames = np.linalg.solve(across, right[..., None])[..., 0]  # [N, 2]
        new = _fixed(np.arctan2(frames[:, 1], frames[:, 0]), nominal)
        moved, steps = np.abs(new - steps).max(), new
        if moved < MOVED_RAD:
            break
    variance = np.nansum(fit.square) / max(int(fit.freedom.sum()) - count, 1)
    return FoundSteps(nominal, steps, np.sqrt(variance * np.diag(_covariance(steps, nominal, across.mean(0)))))


def _model(steps: FloatArray) -> FloatArray:
    return np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)


def _covariance(steps: FloatArray, nominal: FloatArray, across: FloatArray) -> FloatArray:
    """Covariance [N, N] of the steps for samples of unit variance; across: [2, 2] sums of cosine and sine products.

    The pixels' parameters are fitted to the same samples: what they leave of a change of the steps is what tells it.
    """
    model = _model(steps)
    rest = np.eye(len(steps)) - model @ np.linalg.pinv(model)
    turn = np.stack([-np.sin(steps), np.cos(steps)], -1)
    known = np.linalg.pinv(rest * (turn @ across @ turn.T), rcond=1e-9, hermitian=True)
    fixing = np.stack([_fixed(nominal + 1e-3 * row, nominal) - nominal for row in np.eye(len(steps))], -1) / 1e-3
    covariance: FloatArray = fixing @ known @ fixing.T
    return covariance


def _fixed(found: FloatArray, nominal: FloatArray) -> FloatArray:
    """The steps without the common one that no image can tell: the line through their differences starts at 0.

    Single frames that are far from it do not count: the others are where they were said to be.
    """
    difference = wrapped(found - nominal)
    near = np.ones(len(nominal), bool)
    slope, start = _line(nominal, difference)
    if np.abs(difference - start - slope * nominal).max() > WRONG_RAD:
        slope, start = siegelslopes(difference, nominal)[:2]
        near = np.abs(difference - start - slope * nominal) < WRONG_RAD
        if 2 * np.count_nonzero(near) <= len(near):
            near[:] = True
        slope, start = _line(nominal[near], difference[near])
    fixed: FloatArray = nominal + difference - start
    return fixed


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Slope and start, at 0, of the line through points by least squares."""
    centred = x - x.mean()
    slope = float((centred * y).sum() / np.square(centred).sum())
    return slope, float(y.mean() - slope * x.mean())
