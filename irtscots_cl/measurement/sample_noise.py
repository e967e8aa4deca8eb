"""The noise of the samples, from the images themselves.

Samples that no light can reach give the noise of the dark pixel; what the light adds (shot noise, or the noise of the
rays of a simulation) shows in the exposures' scatter, or with a single one in the residuals of the fitted curves. The
latter hold errors of the model too, so that a wrong model makes the stated errors larger.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri, gammaincinv  # of chi-squared; scipy.stats is slow to import

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.curve_fit import CurveFits, SampleNoise
from irtscots_cl.measurement.curve_windows import CurveWindows

OWN_NOISE = 1e-5  # chance at which a pixel of the common noise is given its own instead
LEAST_LEFT = 0.2  # of a sample's variance in its residual: a sample that a fit nearly goes through tells no noise
TINY = 1e-12  # of sums of numbers near 1: less is none
SIGNIFICANT = 3.0  # standard errors of the growth with light: less is left out


def dark_noise(windows: CurveWindows, tilted: bool) -> FloatArray:
    """Variance [n] of dark samples: one value for all pixels, or a pixel's own where it is clearly larger."""
    count, _, _, y, _, y2 = windows.outside
    freedom = count - (2 if tilted else 1)
    known = freedom > 0
    if not known.any():
        return np.zeros(len(count))
    some = np.maximum(count, 1)
    squares = y2 - y * y / some
    if tilted:
        squares = squares - windows.outside_trend
    # rounding of the sums: y2 and y * y / count are equal in noise-free images
    squares = np.where(squares > 1e-12 * y2, squares, 0.0)
    own = squares / np.maximum(freedom, 1)
    of_median = freedom[known] / (2 * gammaincinv(freedom[known] / 2, 0.5))
    common = float(np.median(own[known] * of_median))
    limit = chdtri(np.maximum(freedom, 1), OWN_NOISE) / np.maximum(freedom, 1)
    return np.where(known & (own > limit * common) & (common > 0), own, common)


def noise_with_light(
    windows: CurveWindows, fits: CurveFits, noise: SampleNoise, scatter: FloatArray | None = None
) -> SampleNoise:
    """The noise with its growth by light. noise: that of the fits' weights. scatter: [n, W] variance of the mean of
    several exposures; None for one."""
    light, floor = np.maximum(fits.modelled, 0.0), noise.floor
    used = windows.allowed & (light > 0) & np.isfinite(fits.place_mm)[:, None]
    if scatter is None:
        left = 1 - _leverage(windows, fits, noise)
        used &= left > LEAST_LEFT
        squares = fits.residual**2 / np.where(used, left, 1.0)
    else:
        squares = scatter
    if not used.any():
        return SampleNoise(floor, 0.0)
    light = np.where(used, light, 0.0)
    excess = np.where(used, squares - floor[:, None], 0.0)
    growth, error = _typical_growth(windows.lines, light, excess)
    return SampleNoise(floor, growth if growth > SIGNIFICANT * error else 0.0)


def _leverage(windows: CurveWindows, fits: CurveFits, noise: SampleNoise) -> FloatArray:
    """Leverage [n, W] of each sample on its own fitted value, of flux and place: 1 minus it is the part of its variance
    that its residual keeps. The brightest samples have most."""
    weight = windows.allowed * noise.weight(fits.modelled)
    peak = np.maximum(fits.modelled.max(1, initial=0.0), TINY)[:, None]
    by_flux, by_place = fits.modelled / peak, fits.derivative / peak
    by_place = by_place / np.maximum(np.abs(by_place).max(1, initial=0.0), TINY)[:, None]
    weight = weight / np.maximum(weight.max(1, initial=0.0), TINY)[:, None]
    both = (weight * by_flux * by_place).sum(1)[:, None]
    flux, place = ((weight * column**2).sum(1)[:, None] for column in (by_flux, by_place))
    determinant = flux * place - both**2
    leverage = weight * (place * by_flux**2 - 2 * both * by_flux * by_place + flux * by_place**2)
    known = determinant > TINY
    return np.where(known, leverage / np.where(known, determinant, 1.0), 1.0)


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
