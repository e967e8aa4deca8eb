"""Noise against light (photon transfer): counts and electrons, and whether both go together as in raw images."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2

from irtscots_cl.maths.arrays import FloatArray

LEVELS = 12  # groups of nearly equal light
LEAST = 50  # samples of a group
CLEAR = 5.0  # standard errors of a gain that is told


@dataclass(frozen=True)
class PhotonTransfer:
    """Variance of a sample = read + gain * light, in counts squared and counts above dark.

    gain: in counts per electron, for light whose noise is that of its electrons. light, variance, standard_error:
    [levels]. chance: that samples which follow the line depart from it as much.
    """

    read: float
    gain: float
    gain_error: float
    light: FloatArray = field(repr=False)
    variance: FloatArray = field(repr=False)
    standard_error: FloatArray = field(repr=False)
    chance: float

    @property
    def electrons_per_count(self) -> float:
        """NaN where the gain is not clear of zero."""
        return 1 / self.gain if self.gain > CLEAR * self.gain_error else math.nan

    @property
    def read_noise(self) -> float:
        """In counts, of samples without light."""
        return math.sqrt(self.read)

    def departs(self) -> float:
        """The largest departure of the variance from the line, over the line."""
        line = self.read + self.gain * self.light
        return float(np.max(np.abs(self.variance - line) / np.maximum(line, 1e-300)))


def photon_transfer(variance: FloatArray, light: FloatArray, independent: float = 1.0) -> PhotonTransfer | None:
    """From squared residuals [m], each of the mean of its sample's variance, at light [m] above dark.

    independent: share of them that are. None for too few.
    """
    known = np.isfinite(variance + light)
    variance, light = variance[known], light[known]
    if len(variance) < 3 * LEAST:
        return None
    groups = np.array_split(np.argsort(light, kind="stable"), min(LEVELS, len(variance) // LEAST))
    level = np.array([light[group].mean() for group in groups])
    mean = np.array([variance[group].mean() for group in groups])
    # of a mean of squares of normal numbers, with the line's variance, which noise moves least
    count = np.array([len(group) * independent for group in groups])
    line = mean
    for _ in range(3):
        error = np.maximum(line, 1e-12 * max(mean.max(), 1e-300)) * np.sqrt(2 / count)
        columns = np.stack([np.ones_like(level), np.maximum(level, 0.0)], -1) / error[:, None]
        (read, gain), _ = nnls(columns, mean / error)
        line = read + gain * np.maximum(level, 0.0)
    covariance = np.linalg.pinv(columns.T @ columns)
    left = float(np.square((mean - line) / error).sum())
    chance = float(chi2.sf(left, max(len(groups) - 2, 1)))
    return PhotonTransfer(float(read), float(gain), math.sqrt(covariance[1, 1]), level, mean, error, chance)
