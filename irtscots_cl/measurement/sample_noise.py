"""The noise of the samples, from the images themselves.

Samples that no light can reach give the noise of the dark pixel; what the light adds (shot noise, or the noise of the
rays of a simulation) shows in the exposures' scatter, or with a single one in the residuals of the fitted curves. The
latter hold errors of the model too, so that a wrong model makes the stated errors larger.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.curve_fit import CurveFits, SampleNoise
from irtscots_cl.measurement.curve_windows import CurveWindows

OWN_NOISE = 1e-5  # chance at which a pixel of the common noise is given its own instead
SIGNIFICANT = 3.0  # standard errors of the growth with light: less is left out


def dark_noise(windows: CurveWindows, tilted: bool) -> FloatArray:
    """Variance [n] of dark samples: one value for all pixels, or a pixel's own where it is clearly larger."""
    count, t, t2, y, ty, y2 = windows.outside
    freedom = count - (2 if tilted else 1)
    known = freedom > 0
    if not known.any():
        return np.zeros(len(count))
    some = np.maximum(count, 1)
    squares = y2 - y * y / some
    if tilted:
        spread = t2 - t * t / some
        squares = squares - np.where(spread > 0, (ty - t * y / some) ** 2 / np.where(spread > 0, spread, 1), 0.0)
    # rounding of the sums: y2 and y * y / count are equal in noise-free images
    squares = np.where(squares > 1e-12 * y2, squares, 0.0)
    own = squares / np.maximum(freedom, 1)
    of_median = freedom[known] / chi2.median(freedom[known])
    common = float(np.median(own[known] * of_median))
    limit = chi2.isf(OWN_NOISE, np.maximum(freedom, 1)) / np.maximum(freedom, 1)
    return np.where(known & (own > limit * common) & (common > 0), own, common)


def noise_with_light(
    windows: CurveWindows, fits: CurveFits, floor: FloatArray, scatter: FloatArray | None = None
) -> SampleNoise:
    """The noise with its growth by light. scatter: [n, W] variance of the mean of several exposures; None for one."""
    light = np.maximum(fits.modelled, 0.0)
    if scatter is None:
        inside = windows.allowed.sum(1)
        squares = fits.residual**2 * (inside / np.maximum(inside - 2, 1))[:, None]
    else:
        squares = scatter
    used = windows.allowed & (light > 0) & np.isfinite(fits.place_mm)[:, None]
    if not used.any():
        return SampleNoise(floor, 0.0)
    light = np.where(used, light, 0.0)
    excess = np.where(used, squares - floor[:, None], 0.0)
    growth, error = _typical_growth(windows.lines, light, excess)
    return SampleNoise(floor, growth if growth > SIGNIFICANT * error else 0.0)


def _typical_growth(lines: IntArray, light: FloatArray, excess: FloatArray) -> tuple[float, float]:
    """Variance by light, and its standard error: the weighted median over the frames, so that a wrong frame does not
    look like noise."""
    frame = lines - lines.min()
    power, along = (np.bincount(frame.ravel(), values.ravel()) for values in (light**2, light * excess))
    lit = np.flatnonzero(power > 0)
    of_frame = along[lit] / power[lit]
    order = np.argsort(of_frame)
    growth = float(of_frame[order][np.searchsorted(np.cumsum(power[lit][order]), power.sum() / 2)])
    spread = excess - growth * light
    return growth, float(np.sqrt((light**2 * spread**2).sum()) / power.sum())
