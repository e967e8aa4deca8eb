"""Error bars: the jackknife over replicates, and a value with its standard error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray


def jackknife_error(estimates: FloatArray) -> FloatArray:
    """Standard error of estimates[0] from the leave-one-out estimates [1:] (Efron 1982); NaN with fewer than two."""
    replicates = len(estimates) - 1
    if replicates < 2:
        return np.full(np.shape(estimates)[1:], np.nan)
    left = estimates[1:]
    error: FloatArray = np.sqrt((replicates - 1) / replicates * np.sum((left - left.mean(0)) ** 2, axis=0))
    return error


@dataclass(frozen=True)
class Estimate:
    """A number and its standard error (NaN where there are no replicates)."""

    value: float
    standard_error: float

    def __str__(self) -> str:
        return f"{self.value:.4g}" + (f" +- {self.standard_error:.1g}" if np.isfinite(self.standard_error) else "")
