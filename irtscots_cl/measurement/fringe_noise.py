"""Noise of fringe images from the residuals of their own fits."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.phase import FrameNoise

GROUPS = 16  # of pixels with nearly the same brightness
UNEVEN = 9.0  # variance of a series over the least of all, from which on it is no noise
SEEN = 0.01  # root of that variance over the fringes' amplitude
TRIMMED = 0.1  # share of the pixels, those with the largest residuals


def estimate_noise(square: FloatArray, freedom: FloatArray, signal: FloatArray) -> FrameNoise | None:
    """Noise from sums of squared residuals [n] of so many degrees of freedom [n] at the mean signals [n].

    Means over pixels of nearly equal brightness without the highest tenth, so that a few pixels with another cause,
    such as motion or an edge, count little. None where no pixel has a degree of freedom.
    """
    useful = (freedom > 0) & np.isfinite(square + signal)
    if not useful.any():
        return None
    level, variance, weight = [], [], []
    for kind in np.unique(freedom[useful]):
        of_kind = np.flatnonzero(useful & (freedom == kind))
        by_level = of_kind[np.argsort(signal[of_kind], kind="stable")]
        for part in np.array_split(by_level, min(GROUPS, max(1, len(by_level) // 8))):
            level.append(signal[part].mean())
            variance.append(_trimmed_mean(square[part], float(kind)))
            weight.append(np.sqrt(len(part) * kind))
    x, y = np.array(level), np.array(variance)
    if len(x) == 1 or np.ptp(x) < 1e-3 * abs(x).max() or not y.any():
        return FrameNoise(float(np.average(y, weights=np.square(weight))))
    factor = np.array(weight) / np.maximum(y, 1e-3 * y.max())  # a variance's own error is in proportion to it
    columns = np.stack([np.ones_like(x), np.maximum(x, 0.0)], -1)
    (read, gain), _ = nnls(columns * factor[:, None], y * factor)
    return FrameNoise(float(read), float(gain))


def uneven_series(variance: FloatArray, amplitude: FloatArray) -> BoolArray:
    """Series whose residuals are no noise: their variance [series] is far above the least, and seen beside the fringes'
    amplitude [series]. NaN: not known."""
    known = np.isfinite(variance)
    if np.count_nonzero(known) < 2:
        return np.zeros(len(variance), bool)
    with np.errstate(invalid="ignore"):
        seen = np.sqrt(variance) > SEEN * np.nanmax(amplitude)
        uneven: BoolArray = (variance > UNEVEN * variance[known].min()) & seen
    return uneven


def series_variance(square: FloatArray, freedom: FloatArray) -> float:
    """Variance of a sample of one series, from sums of squared residuals [n] of so many degrees of freedom [n]; NaN
    where there are none."""
    useful = (freedom > 0) & np.isfinite(square)
    return float(np.median(square[useful] / chi2.median(freedom[useful]))) if useful.any() else np.nan


def _trimmed_mean(square: FloatArray, freedom: float) -> float:
    """Variance from sums of squares [n]: the mean without the highest, which are too high by chance alone as well."""
    kept = np.sort(square)[: max(1, round(len(square) * (1 - TRIMMED)))]
    share = len(kept) / len(square)
    # the mean of a chi-square below its quantile `share`
    expected = freedom * chi2.cdf(chi2.ppf(share, freedom), freedom + 2) / share if share < 1 else freedom
    return float(kept.mean() / expected)
