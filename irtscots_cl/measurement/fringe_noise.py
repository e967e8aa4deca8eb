"""Noise of fringe images from the residuals of their own fits."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.phase import FrameNoise
from irtscots_cl.measurement.unwrapping import unwrap

GROUPS = 16  # of pixels with nearly the same brightness
LIKE_FRINGES = 0.3  # the same, from which on its phases say nothing
FINE_RAD = 1e-3  # an error of phases that leaves no order in doubt
SAMPLE = 8000  # pixels
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


def excess_errors(variance: FloatArray, amplitude: FloatArray) -> FloatArray:
    """Factors [series] of the errors of phases, above 1 for series whose residuals are no noise, infinite for those to
    leave out: without fringes, or with residuals like them.

    variance: of the residuals [series], NaN where not known. amplitude: of the fringes [series].
    """
    factor = np.ones(len(variance))
    shown = amplitude > SEEN * np.nanmax(amplitude)
    factor[~shown] = np.inf
    known = np.isfinite(variance) & shown
    if known.any():
        least = variance[known].min()
        with np.errstate(divide="ignore", invalid="ignore"):
            seen = np.sqrt(variance) / amplitude
            uneven = known & (variance > UNEVEN * least) & (seen > SEEN)
            factor[uneven] = np.where(seen > LIKE_FRINGES, np.inf, np.sqrt(variance / least))[uneven]
    return factor


def errors_of_agreement(phase_rad: FloatArray, amplitude: FloatArray, periods: tuple[float, ...]) -> FloatArray:
    """Errors [series, n] of phases [series, n] from how well the series agree, for noise that is the same in all
    samples: in proportion to 1 / amplitude [series, n]. 0 for a single series."""
    with np.errstate(divide="ignore", invalid="ignore"):
        shape = FINE_RAD * np.nanmedian(amplitude) / amplitude
    some = slice(None, None, max(1, phase_rad.shape[1] // SAMPLE))
    found = unwrap(phase_rad[:, some], shape[:, some], periods)
    useful = np.isfinite(found.fraction) & (found.freedom > 0)
    if not useful.any():
        return np.zeros_like(shape)
    scale = np.sqrt(np.median(found.misfit[useful] / chi2.median(found.freedom[useful])))
    errors: FloatArray = scale * shape
    return errors


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
