"""What each frame shows, from the images alone: another line than its own, nothing, or light where none can be.

A frame's light is compared with that of the neighbouring lines, which the other frames of the pixels' curves give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.curve_fit import CurveFits, SampleNoise
from irtscots_cl.measurement.curve_windows import CurveWindows

SHIFTS = 2  # lines to each side that are tried
BETTER = 0.5  # a frame shows another line if that one leaves at most this part of the misfit
SIGMAS = 6.0  # misfits that noise alone makes once in 1e9 frames are none
MANY = 0.01  # of all pixels with light where none can be: that is a wrong frame
MIN_PIXELS = 5  # lit by a frame, for a judgement
DIM_CURVE = 0.2  # of the median flux: curves with less tell nothing of the frames
WORST = 0.3  # of the worst frame's misfit: frames with less may be wrong only because that one has moved the fits
BLACK = 0.2  # of the expected light: a frame with less shows no line


@dataclass(frozen=True)
class FrameChecks:
    """Of L frames. shows: [L] line that each shows; its own number, unless another fits clearly better; -1: no line
    (black), -2: light far from any pixel's light. ratio: [L] its light over the expected light, NaN where too few
    pixels tell. chi_square: [L] reduced, of its light. bright: [L] samples as bright as light outside all windows.
    differs: [L] mean square difference from its own line's light, whatever the noise. light: [L] the expected light,
    squared and in units of its noise."""

    shows: IntArray
    ratio: FloatArray
    chi_square: FloatArray
    bright: IntArray
    differs: FloatArray
    light: FloatArray

    @property
    def wrong(self) -> BoolArray:
        """Frames [L] that must not be used."""
        wrong: BoolArray = self.shows != np.arange(len(self.shows))
        return wrong

    def worst(self, usable: BoolArray) -> BoolArray:
        """The wrong frames [L] among the usable ones that are wrong whatever the others have done to the fits: those
        with light where none can be, else black ones, else the ones that fit worst."""
        wrong = self.wrong & usable
        for kind, measure in ((-2, self.bright), (-1, None), (None, self.differs)):
            of_kind = wrong if kind is None else wrong & (self.shows == kind)
            if of_kind.any():
                if measure is None:
                    return of_kind
                value = np.where(of_kind, measure, 0.0)
                worst: BoolArray = of_kind & (value >= WORST * value.max())
                return worst
        return wrong


def check_frames(
    scan: Scan, windows: CurveWindows, fits: CurveFits, noise: SampleNoise, bright: IntArray
) -> FrameChecks:
    """Compare every frame with the light of its own line and of the neighbouring ones.

    bright: [L] samples outside all windows that are as bright as light.
    """
    count = len(scan.positions_mm)
    found = np.isfinite(fits.place_mm)
    # a curve of noise has its light in frames that light nothing
    known = found & (fits.flux > DIM_CURVE * np.median(fits.flux[found])) if found.any() else found
    lines = windows.lines[known]
    background = fits.level[known, None] + fits.slope[known, None] * (lines - windows.middle)
    light = np.where(windows.allowed[known], windows.samples[known] - background, 0.0)
    model = fits.modelled[known]
    # every hypothesis is judged on the same samples: those with a model for all of them
    width = model.shape[1]
    inner = windows.allowed[known].copy()
    inner[:, :SHIFTS] = inner[:, width - SHIFTS :] = False
    frame = np.clip(lines, 0, count - 1)
    weight = inner * noise.part(np.flatnonzero(known)).weight(model)
    own = _sums(frame, weight * light * light, count)
    pixels = _sums(frame, inner, count)
    expected = _sums(frame, weight * model * model, count)
    misfit = np.full((2 * SHIFTS + 1, count), np.inf)
    ratio = np.full(count, np.nan)
    for k, shift in enumerate(range(-SHIFTS, SHIFTS + 1)):
        shown = np.roll(model, -shift, axis=1)
        power = _sums(frame, weight * shown * shown, count)
        along = _sums(frame, weight * shown * light, count)
        with np.errstate(invalid="ignore", divide="ignore"):
            gain = np.where(power > 0, along / power, 0.0)
        misfit[k] = own - 2 * np.maximum(gain, 0.0) * along + np.maximum(gain, 0.0) ** 2 * power
        if shift == 0:
            ratio = np.where(expected > SIGMAS**2, gain, np.nan)
    best = np.argmin(misfit, axis=0)
    here = misfit[SHIFTS]
    with np.errstate(invalid="ignore"):
        there = misfit[best, np.arange(count)]
        other = (there < BETTER * here) & (here - there > SIGMAS**2) & (pixels >= MIN_PIXELS)
    shows = np.arange(count) + np.where(other, best - SHIFTS, 0)
    with np.errstate(invalid="ignore"):
        black = (ratio < BLACK) & ((1 - ratio) * np.sqrt(expected) > SIGMAS) & (pixels >= MIN_PIXELS)
        shows[~other & black] = -1
        chi_square = here / np.maximum(pixels - 1, 1)
    many = np.maximum(MIN_PIXELS, MANY * len(windows.first))
    shows[(bright >= many) & (shows == np.arange(count))] = -2
    chi_square = np.where(pixels > 1, chi_square, np.nan)
    differs = _sums(frame, inner * (light - model) ** 2, count) / np.maximum(pixels, 1)
    return FrameChecks(shows.astype(np.int64), ratio, chi_square, bright, differs, expected)


def _sums(frame: IntArray, values: FloatArray | BoolArray, count: int) -> FloatArray:
    return np.bincount(frame.ravel(), np.asarray(values, float).ravel(), count).astype(np.float64)
