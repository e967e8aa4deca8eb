"""Gains of the frames from all pixels together: drift of the screen, jitter of the exposure, a dark frame.

A frame's gain cannot be told from one pixel: a drift over its few lines is a shift of its light. Two things tell them
apart. All pixels that a frame lights share its gain. And a pixel's light, summed over the lines of a whole scan, is the
same in the x scan and in the y scan, whatever the screen, the mirror and the lens do to it, while the gains of the two
scans are not. So the gains of both scans are fitted together, and each pixel's own flux and two places are eliminated:
only what those cannot explain is a gain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.curve_fit import CurveFits, SampleNoise
from irtscots_cl.measurement.curve_windows import CurveWindows
from irtscots_cl.system import interruption

PRIOR = 0.3  # standard deviation of a gain before the images say more: frames without light stay at 1
FALSE_ALARM = 1e-4  # chance that gains of equal frames are corrected
MODEL_ERROR = 0.001  # of a gain: what the design's profile, which is not quite the light's, may feign
LIT = 0.002  # of the median frame's light, squared: frames with less get their scan's typical gain
LIMITS = (0.2, 5.0)  # of one change of a gain
MAX_PIXELS = 20_000  # more do not make a gain better than its effect on a height needs


@dataclass(frozen=True)
class ScanFit:
    """What the gains are found from: a scan's pixels [n] (flat numbers), windows, noise, fits; lines: their number.

    whole: [n] pixels whose light lies on the screen altogether.
    """

    pixels: IntArray
    whole: BoolArray
    windows: CurveWindows
    noise: SampleNoise
    fits: CurveFits
    lines: int


@dataclass(frozen=True)
class FrameGains:
    """x, y: gains of the frames of each scan, relative to those of the fits. error_x, error_y: their standard errors.
    chance: that frames of equal gains deviate as much."""

    x: FloatArray
    y: FloatArray
    error_x: FloatArray
    error_y: FloatArray
    chance: float


def frame_gains(x: ScanFit, y: ScanFit) -> FrameGains:
    """The gains of the frames of both scans. Their mean is 1 within PRIOR: it belongs to the fluxes."""
    _, in_x, in_y = np.intersect1d(x.pixels, y.pixels, assume_unique=True, return_indices=True)
    good = np.isfinite(x.fits.place_mm[in_x]) & np.isfinite(y.fits.place_mm[in_y]) & x.whole[in_x] & y.whole[in_y]
    # a pixel whose fluxes differ by more than gains do is not one light in both scans
    with np.errstate(over="ignore"):
        ratio = np.where(good, x.fits.flux[in_x], 1.0) / np.where(good, y.fits.flux[in_y], 1.0)
    typical = float(np.median(ratio[good])) if good.any() else 1.0
    good &= (ratio > LIMITS[0] * typical) & (ratio < LIMITS[1] * typical)
    in_x, in_y = in_x[good], in_y[good]
    every = max(1, -(-len(in_x) // MAX_PIXELS))
    sides = ((x, in_x[::every]), (y, in_y[::every]))
    gained, residual, columns, lines = _stacked(sides)
    count = x.lines + y.lines
    normal, right = np.zeros((count, count)), np.zeros(count)
    # a batch's outer products [pixels, samples, samples] stay small
    for first in range(0, len(gained), 2048):
        interruption.check()
        part = slice(first, first + 2048)
        basis, _ = np.linalg.qr(columns[part])
        projected = gained[part, :, None] * basis
        outer = -np.einsum("nsk,ntk->nst", projected, projected)
        index = np.arange(outer.shape[1])
        outer[:, index, index] += gained[part] ** 2
        pairs = lines[part, :, None] * count + lines[part, None, :]
        normal += np.bincount(pairs.ravel(), outer.ravel(), count * count).reshape(count, count)
        free = residual[part] - np.einsum("nsk,ntk,nt->ns", basis, basis, residual[part], optimize=True)
        right += np.bincount(lines[part].ravel(), (gained[part] * free).ravel(), count)
    covariance = np.linalg.inv(normal + np.eye(count) / PRIOR**2)
    change = covariance @ right
    # a frame that lights only the tails of a few curves says more of the profile than of its gain
    lit = np.concatenate([_lit_frames(scan, index) for scan, index in sides])
    for scan in (slice(x.lines), slice(x.lines, count)):
        bright = change[scan][lit[scan]]
        change[scan][~lit[scan]] = np.median(bright) if bright.size else 0.0
    deviation = np.sqrt(np.diag(covariance))
    chance = 1.0
    if lit.any():
        spread = covariance[np.ix_(lit, lit)] + MODEL_ERROR**2 * np.eye(int(lit.sum()))
        chance = float(chdtrc(int(lit.sum()), change[lit] @ np.linalg.solve(spread, change[lit])))
    of_x, of_y = np.split(np.clip(1 + change, *LIMITS), [x.lines])
    error_x, error_y = np.split(deviation, [x.lines])
    return FrameGains(of_x, of_y, error_x, error_y, chance)


def _lit_frames(scan: ScanFit, index: IntArray) -> BoolArray:
    """Frames [lines] with enough light of some pixels to tell their gain from errors of the profile."""
    frame = np.clip(scan.windows.lines[index], 0, scan.lines - 1)
    light = np.bincount(frame.ravel(), (scan.fits.modelled[index] ** 2).ravel(), scan.lines)
    lit: BoolArray = light > LIT * (np.median(light[light > 0]) if light.any() else 0.0)
    return lit


def _stacked(sides: tuple[tuple[ScanFit, IntArray], ...]) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Of both scans' samples one after the other [pixels, S], in units of their noise: the change by the frame's gain,
    the residuals, the changes [pixels, S, 3] by the common flux and by both places, and the frames' numbers."""
    flux = np.mean([scan.fits.flux[index] for scan, index in sides], axis=0)[:, None]
    gained, residual, columns, lines = [], [], [], []
    before = 0
    for k, (scan, index) in enumerate(sides):
        fits, windows = scan.fits, scan.windows.part(index)
        own = fits.flux[index, None]
        light = fits.modelled[index] / own
        weight = windows.allowed * np.sqrt(scan.noise.part(index).weight(light * own))
        gained.append(flux * light * weight)
        residual.append((fits.residual[index] + (own - flux) * light) * weight)
        column = np.zeros((*light.shape, 3))
        column[..., 0], column[..., 1 + k] = gained[k], fits.derivative[index] * weight
        columns.append(column)
        lines.append(np.clip(windows.lines, 0, scan.lines - 1) + before)
        before += scan.lines
    stacked = np.concatenate(columns, 1)
    stacked /= np.maximum(np.linalg.norm(stacked, axis=1, keepdims=True), 1e-300)
    return np.concatenate(gained, 1), np.concatenate(residual, 1), stacked, np.concatenate(lines, 1)
