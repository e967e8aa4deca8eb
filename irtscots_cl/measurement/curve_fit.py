"""The place of a pixel's light from its signed samples: maximum likelihood of the design's profile, or a centroid.

A sample of line k is  y_k = g_k (F P_k(d)) + b + s t_k + noise:  P_k(d) is the share of the pixel's light on line k
if the light's centroid lies at d, from the design (optics/pixel/response.py); F, b and s are the pixel's own flux,
background and its slope over the scan, g_k is the frame's gain. Samples that the light cannot reach determine b and s;
those it can reach, d and F. All are fitted together by weighted least squares, which is maximum likelihood for
Gaussian noise. The covariance of the fit then is the Cramer-Rao bound: no unbiased estimator has less noise.

The centroid of the same window needs no profile and is unbiased, but weighs far samples, which bring little light,
most.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.curve_profiles import Profiles
from irtscots_cl.measurement.curve_windows import CurveWindows, line_pitch

PROFILE_ERROR = 1e-3  # of a curve's peak: what the modelled profile may be wrong by, in its flanks too
CHUNK = 2**15  # curves fitted at a time, so that large images need little more memory than their own
NEAR = 0.02  # lines: a shorter step of the fit leaves an error below 1e-4 lines
ROUNDS = 4  # of moving the profile at most
DIM = 0.02  # of a curve's peak: noise that grows with the light is taken to be at least that of so much light
COVERED = 0.5  # least share of a pixel's light that its window must hold
SEEN = 0.02  # least share of it on samples that count: others are missing, saturated, or of a wrong frame
TINY = 1e-90  # of any unit: less light is none, and its square no number
MIN_SAMPLES = 3  # with light: for place and flux, and one more


@dataclass(frozen=True)
class SampleNoise:
    """Variance of a sample: floor [n], the pixels' own, plus per_light times the sample's light."""

    floor: FloatArray
    per_light: float

    def variance(self, light: FloatArray) -> FloatArray:
        """Variance [n, W] of samples with light [n, W]."""
        growing: FloatArray = self.per_light * np.maximum(light, DIM * _peak(light))
        return self.floor[:, None] + growing

    def weight(self, light: FloatArray) -> FloatArray:
        """Weights [n, W] of samples with light [n, W]: finite in images without noise too, and not too high in the
        flanks, where the profile is wrong by as much as at the peak."""
        peak = _peak(light)
        least = np.where(peak > TINY, (PROFILE_ERROR * peak) ** 2, 1.0)  # a curve without light: anything finite
        weight: FloatArray = 1 / (self.variance(light) + least)
        return weight

    def part(self, chosen: IntArray) -> SampleNoise:
        """The noise of some of the pixels."""
        return SampleNoise(self.floor[chosen], self.per_light)


def _peak(light: FloatArray) -> FloatArray:
    peak: FloatArray = np.abs(light).max(1, initial=0.0)[:, None]
    return peak


@dataclass(frozen=True)
class CurveFits:
    """Fits of n curves. place_mm: [n] the light's centroid; NaN where it has none.

    flux, level, slope: [n] of the light and of the background. modelled: [n, W] light of the window's samples without
    background; residual: [n, W] samples minus the whole model, 0 where none is allowed. chi_square, freedom: [n] of the
    residuals. derivative: [n, W] of the modelled light by place [1/mm].
    """

    place_mm: FloatArray
    flux: FloatArray
    level: FloatArray
    slope: FloatArray
    modelled: FloatArray
    derivative: FloatArray
    residual: FloatArray
    chi_square: FloatArray
    freedom: FloatArray


def fit_profiles(
    windows: CurveWindows,
    profiles: Profiles,
    noise: SampleNoise,
    gain: FloatArray,
    start_mm: FloatArray,
    tilted: bool,
    exact: bool = False,
) -> tuple[CurveFits, FloatArray]:
    """Maximum likelihood of the profiles: the fits, and the matrix of the last step for `relinearised`.

    gain: [n, W] of the frames of the windows' samples. start_mm: [n] first estimate of the places. tilted: fit a slope
    of the background too. exact: one last step from places near the solution, with profiles that are not interpolated.
    A curve without a profile, or with fewer than MIN_SAMPLES samples, gets NaN.
    """
    place = np.where(profiles.known & (windows.allowed.sum(1) >= MIN_SAMPLES), start_mm, np.nan)
    shape = windows.allowed.shape
    share, by_place = np.zeros(shape), np.zeros(shape)
    solved = np.full((len(place), 4), np.nan)
    inverse = np.full((len(place), 4, 4), np.nan)
    moving = np.flatnonzero(np.isfinite(place))
    near = shape[1] * profiles.pitch / 2
    for _ in range(1 if exact else ROUNDS):
        if not moving.size:
            break
        if exact:
            share, by_place = profiles.exact_shares(windows.first, shape[1], place)
        for some in _chunks(moving):
            part, of_gain = windows.part(some), gain[some]
            if not exact:
                share[some], by_place[some] = profiles.shares(some, part.first, shape[1], place[some])
            columns = _columns(part, share[some] * of_gain, by_place[some] * of_gain)
            weight = _weights(part, noise.part(some), share[some] * of_gain)
            solved[some], inverse[some] = _solve(part, columns, weight, noise.floor[some], tilted)
        with np.errstate(invalid="ignore", divide="ignore"):
            step = np.clip(solved[moving, 1] / solved[moving, 0], -near, near)
        place[moving] += step
        with np.errstate(invalid="ignore"):
            moving = moving[np.abs(step) > NEAR * profiles.pitch]
    return _fits(windows, noise, gain, place, share, by_place, solved, profiles.line_width), inverse


def _chunks(index: IntArray) -> Iterator[IntArray]:
    """Parts of an index array, of CHUNK curves at most."""
    for first in range(0, len(index), CHUNK):
        yield index[first : first + CHUNK]


def _columns(part: CurveWindows, light: FloatArray, by_place: FloatArray) -> FloatArray:
    """The model's columns [m, W, 4]: flux, flux times shift, level, slope; 0 for samples that are not allowed."""
    t = part.lines - part.middle
    return np.stack([light, by_place, np.ones(t.shape), t], -1) * part.allowed[..., None]


def _unit_columns(part: CurveWindows, light: FloatArray, derivative: FloatArray, flux: FloatArray) -> FloatArray:
    """As _columns, of fitted light and its derivative [m, W] by place; 0 for a curve without a flux [m]."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(_columns(part, light / flux[:, None], derivative / flux[:, None]))


def _weights(part: CurveWindows, noise: SampleNoise, light: FloatArray) -> FloatArray:
    """Weights [m, W] of the samples, from the light that a fit with equal weights finds."""
    bright = np.einsum("nw,nw->n", light * part.allowed, part.samples - part.outside_level[:, None])
    with np.errstate(invalid="ignore", divide="ignore"):
        flux = np.nan_to_num(bright / (light**2 * part.allowed).sum(1))
    return part.allowed * noise.weight(flux[:, None] * light)


def _solve(
    part: CurveWindows, columns: FloatArray, weight: FloatArray, floor: FloatArray, tilted: bool
) -> tuple[FloatArray, FloatArray]:
    """Solutions [m, 4] and inverse normal matrices [m, 4, 4] of the samples inside and outside together."""
    normal, right = _normal(part, columns, weight, floor)
    if not tilted:
        right[:, 3] = 0.0
    inverse = _inverse(normal, tilted)
    return np.einsum("nij,nj->ni", inverse, right), inverse


def _normal(
    part: CurveWindows, columns: FloatArray, weight: FloatArray, floor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    weighted = columns * weight[..., None]
    normal = np.einsum("nwi,nwj->nij", weighted, columns, optimize=True)
    right = np.einsum("nwi,nw->ni", weighted, part.samples, optimize=True)
    y, ty = part.outside[3:5]
    outside = _outside_weight(weight, floor)
    normal[:, 2:, 2:] += _outside_moments(part) * outside[:, None, None]
    right[:, 2:] += np.stack([y, ty], -1) * outside[:, None]
    return normal, right


def _outside_weight(weight: FloatArray, floor: FloatArray) -> FloatArray:
    """Weight [m] of the samples outside: in images without dark noise as high as the highest inside."""
    outside: FloatArray = np.where(floor > 0, 1 / np.where(floor > 0, floor, 1.0), _highest(weight))
    return outside


def _highest(weight: FloatArray) -> FloatArray:
    highest: FloatArray = np.maximum(weight.max(1, initial=0.0), 1e-200)
    return highest


def _outside_moments(part: CurveWindows) -> FloatArray:
    count, t, t2, *_ = part.outside
    return np.stack([np.stack([count, t], -1), np.stack([t, t2], -1)], -1)


def covariances(
    windows: CurveWindows, fits: CurveFits, noise: SampleNoise, tilted: bool
) -> tuple[FloatArray, FloatArray]:
    """Standard errors [n] in mm of the fitted places, and their Cramer-Rao bounds.

    The weights differ from the noise's own where PROFILE_ERROR limits them, so the error is that of the weighted fit;
    the bound is that of the best weights.
    """
    error, bound = np.empty(len(fits.flux)), np.empty(len(fits.flux))
    for some in _chunks(np.arange(len(fits.flux))):
        of_some = fits.modelled[some], fits.derivative[some], fits.flux[some]
        error[some], bound[some] = _covariances(windows.part(some), *of_some, noise.part(some), tilted)
    return error, bound


def _covariances(
    windows: CurveWindows,
    light: FloatArray,
    derivative: FloatArray,
    flux: FloatArray,
    noise: SampleNoise,
    tilted: bool,
) -> tuple[FloatArray, FloatArray]:
    """As covariances, of curves with that light and its derivative [m, W] and flux [m]."""
    columns = _unit_columns(windows, light, derivative, flux)
    variance, weight = noise.variance(light), windows.allowed * noise.weight(light)
    normal, _ = _normal(windows, columns, weight, noise.floor)
    row = _inverse(normal, tilted)[:, 1]
    weighted = columns * (weight**2 * variance)[..., None]
    spread = np.einsum("nwi,nwj->nij", weighted, columns, optimize=True)
    of_outside = _outside_weight(weight, noise.floor) ** 2 * noise.floor
    spread[:, 2:, 2:] += _outside_moments(windows) * of_outside[:, None, None]
    known = variance > 0
    best = windows.allowed / np.where(known, variance, np.inf)
    # a dark sample without noise tells the background exactly
    normal, _ = _normal(windows, columns, best, np.where(noise.floor > 0, noise.floor, 1e-6 / _highest(best)))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        error = np.sqrt(np.einsum("ni,nij,nj->n", row, spread, row)) / flux
        bound = np.sqrt(_inverse(normal, tilted)[:, 1, 1]) / flux
    return error, np.where(np.asarray(best.any(1)), bound, 0.0)


def _inverse(normal: FloatArray, tilted: bool) -> FloatArray:
    """Inverses [n, 4, 4] of normal matrices; without a slope of the background unless it is tilted."""
    if not tilted:
        normal = normal.copy()
        normal[:, 3, :] = normal[:, :, 3] = 0.0
        normal[:, 3, 3] = 1.0
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", normal), 1e-200))
    scales = scale[:, :, None] * scale[:, None, :]
    # a curve with too few samples must not stop the others
    inverse: FloatArray = np.linalg.inv(normal / scales + 1e-13 * np.eye(4)) / scales
    return inverse


def _fits(
    windows: CurveWindows,
    noise: SampleNoise,
    gain: FloatArray,
    place: FloatArray,
    share: FloatArray,
    by_place: FloatArray,
    solved: FloatArray,
    line_width: float,
) -> CurveFits:
    flux, _, level, slope = solved.T
    light = np.where(windows.allowed, flux[:, None] * share * gain, 0.0)
    moved = np.where(windows.allowed, solved[:, 1, None] * by_place * gain, 0.0)
    background = level[:, None] + slope[:, None] * (windows.lines - windows.middle)
    residual = np.where(windows.allowed, windows.samples - light - moved - background, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        chi_square = (residual**2 * noise.weight(light)).sum(1)
    # a fit that has left the samples fits noise; the shares of all lines add up to line_width
    found = np.isfinite(place) & (flux > 0) & (share.sum(1) >= COVERED * line_width)
    found &= (share * windows.allowed).sum(1) >= SEEN * line_width
    light, by_place = np.where(found[:, None], light, 0.0), np.where(found[:, None], by_place, 0.0)
    residual = np.where(found[:, None], residual, 0.0)
    return CurveFits(
        place_mm=np.where(found, place, np.nan),
        flux=np.where(found, flux, np.nan),
        level=np.where(found, level, np.nan),
        slope=np.where(found, slope, np.nan),
        modelled=np.nan_to_num(light),
        derivative=np.nan_to_num(flux[:, None] * by_place * gain) * windows.allowed,
        residual=np.nan_to_num(residual),
        chi_square=np.where(found, chi_square, np.nan),
        freedom=np.maximum(windows.allowed.sum(1) - 2.0, 1.0),
    )


def relinearised(
    fits: CurveFits, windows: CurveWindows, noise: SampleNoise, inverse: FloatArray, other: CurveWindows
) -> FloatArray:
    """Places [n] of other samples in the same windows, such as those of some exposures, by one linear step."""
    columns = _unit_columns(windows, fits.modelled, fits.derivative, fits.flux)
    weight = windows.allowed * noise.weight(fits.modelled)
    _, here = _normal(windows, columns, weight, noise.floor)
    _, there = _normal(other, columns, weight, noise.floor)
    change = np.einsum("nij,nj->ni", inverse, there - here)
    with np.errstate(invalid="ignore", divide="ignore"):
        place: FloatArray = fits.place_mm + change[:, 1] / (fits.flux + change[:, 0])
        return place


def centroid_fits(
    windows: CurveWindows, noise: SampleNoise, gain: FloatArray, scan: Scan, tilted: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centroids [n] in mm of the signed samples in the windows, their standard errors, and the flux [n] of
    the light, which falls on line_width lines in the mean.

    The background comes from the samples outside alone. A curve that misses a sample in its window gets NaN: its
    centroid would be wrong.
    """
    level, slope, level_variance, slope_variance, covariance = _background(windows, tilted)
    lines = windows.lines - windows.middle
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        light = np.where(windows.allowed, windows.samples - level[:, None] - slope[:, None] * lines, 0.0) / gain
        flux = light.sum(1)
        at = np.where(windows.allowed, scan.positions_mm[0] + line_pitch(scan) * windows.lines, 0.0)
        start = np.take_along_axis(at, np.argmax(windows.allowed, 1)[:, None], 1)
        place = (light * (at - start)).sum(1) / flux + start[:, 0]
        lever = np.where(windows.allowed, (at - place[:, None]) / flux[:, None], 0.0) / gain
        variance = (lever**2 * noise.variance(np.maximum(light, 0.0))).sum(1)
        by_level, by_slope = lever.sum(1), (lever * lines).sum(1)
        variance += noise.floor * (
            by_level**2 * level_variance + by_slope**2 * slope_variance + 2 * by_level * by_slope * covariance
        )
    # of a flux that is nearly zero neither is finite
    found = (flux > 0) & np.isfinite(place) & np.isfinite(variance) & ~_missing(windows)
    error = np.sqrt(np.where(found, variance, np.nan))
    return np.where(found, place, np.nan), error, np.where(found, flux / scan.line_width, np.nan)


def _missing(windows: CurveWindows) -> BoolArray:
    """Curves [n] with a gap between the allowed samples of their windows."""
    width = windows.allowed.shape[1]
    first, last = np.argmax(windows.allowed, 1), width - 1 - np.argmax(windows.allowed[:, ::-1], 1)
    gap: BoolArray = windows.allowed.sum(1) != last - first + 1
    return gap


def _background(windows: CurveWindows, tilted: bool) -> tuple[FloatArray, ...]:
    """Level and slope [n] of the samples outside, and the variances of both and their covariance for unit noise."""
    count, t, t2, y, ty, _ = windows.outside
    some = np.maximum(count, 1)
    if not tilted:
        none = np.zeros(len(y))
        return windows.outside_level, none, np.where(count > 0, 1 / some, 0.0), none, none
    determinant = np.where(count * t2 - t * t > 0, count * t2 - t * t, np.inf)
    level, slope = (t2 * y - t * ty) / determinant, (count * ty - t * y) / determinant
    return level, slope, t2 / determinant, count / determinant, -t / determinant
