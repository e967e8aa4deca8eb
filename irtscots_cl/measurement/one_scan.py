"""One scan on its way to the light's centroids: windows, noise, fits, wrong frames, flags (see scan_estimates.py)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import gammaincinv

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.curve_fit import (
    SampleNoise,
    centroid_fits,
    covariances,
    fit_profiles,
    relinearised,
)
from irtscots_cl.measurement.curve_profiles import Profiles
from irtscots_cl.measurement.curve_windows import CurveWindows, find_light, light_box, line_pitch, place_windows
from irtscots_cl.measurement.frame_checks import FrameChecks, check_frames
from irtscots_cl.measurement.frame_factors import ScanFit
from irtscots_cl.measurement.light_curves import EDGE_TOLERANCE, STRAY_SHARE, Flag, whole_range
from irtscots_cl.measurement.sample_noise import dark_noise, noise_with_light
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup

CHUNK = 2**16  # curves handled at a time, so that large images need little more memory than their own
FEIGNED = 0.2  # of the largest offset of a frame: it moves the levels that the others are counted from
DARK = 1e-3  # of a typical peak: light outside the windows that is none, in images without noise
STRAY_SIGMAS = 6.0  # light outside a window that noise makes once in 1e9 curves
BINS = 4  # per line, of distances from the centroid
BIN_SAMPLES = 50  # least number for a mean
MEDIAN_OF_SQUARE = float(2 * gammaincinv(0.5, 0.5))  # of a normal number; scipy.stats is slow to import
DETECTED = 5.0  # standard errors of a curve's light: less is none


@dataclass(frozen=True)
class ScanEstimate:
    """What one scan says of n pixels (flat numbers `pixels`); lines of the scan: L.

    centroid_mm: [1 + replicates, n] of the light: all exposures, then each left out in turn. error_mm: [n] standard
    error of the first, bound_mm: [n] the Cramer-Rao bound of the samples. flags: [n] light_curves.Flag. flux: [n];
    level: [n] background. chi_square: [n] reduced, of the curve against the design's profile. modelled: [n] whether the
    design's profile was used. profile_error: largest mean difference of the curves from the modelled profile, in peaks;
    NaN where too few tell. gain, offset: [L] of the frames. frames: what each shows. tilted: whether the background
    has a slope over the scan.
    """

    scan: Scan = field(repr=False)
    centroid_mm: FloatArray = field(repr=False)
    error_mm: FloatArray = field(repr=False)
    bound_mm: FloatArray = field(repr=False)
    flags: IntArray = field(repr=False)
    flux: FloatArray = field(repr=False)
    level: FloatArray = field(repr=False)
    chi_square: FloatArray = field(repr=False)
    modelled: BoolArray = field(repr=False)
    noise: SampleNoise = field(repr=False)
    gain: FloatArray = field(repr=False)
    offset: FloatArray = field(repr=False)
    frames: FrameChecks = field(repr=False)
    tilted: bool
    profile_error: float


class OneScan:
    """One scan on the way to its estimate."""

    def __init__(self, scan: Scan, setup: Setup, light: PixelLight):
        half_width, box_row, box_column = setup.chief_rays.light_shape("xy".index(scan.axis))
        reach = (half_width + (box_row + box_column) / 2).ravel()[scan.pixels]
        seen = setup.chief_rays.sees_mirror.ravel()[scan.pixels] & np.isfinite(reach)
        if not seen.all():
            scan = scan.part(seen)
        self.scan, self.reach = scan, reach[seen]
        self.curves = self.bright = scan.flux_w[0] if len(scan.weights) == 1 else scan.mean_w()
        self.saturated = np.zeros(len(self.curves), bool)
        if np.isfinite(scan.saturation_w):
            full = np.any(scan.flux_w >= scan.saturation_w, axis=0)
            self.saturated = np.asarray(full.any(1))
            self.curves = np.where(full, np.nan, self.curves)
        self.profiles = Profiles(scan, light)
        count = len(scan.positions_mm)
        self.usable, self.gain, self.offset = np.ones(count, bool), np.ones(count), np.zeros(count)
        self.shows = np.arange(count)
        self.tilted = False
        self.exposures: FloatArray | None = None
        self.place_mm = self._place(self._windows())

    def _chunks(self) -> Iterator[slice]:
        for first in range(0, max(len(self.curves), 1), CHUNK):
            yield slice(first, first + CHUNK)

    def _part(self, chosen: slice, curves: FloatArray) -> tuple[Scan, FloatArray]:
        scan, values = self.scan.part(chosen), curves[chosen]
        if self.offset.any():
            lines = np.minimum(scan.lines, len(self.offset) - 1)
            values = values - self.offset[lines]
        return scan, values

    def _windows(self, curves: FloatArray | None = None) -> CurveWindows:
        """Windows of all curves, placed by the mean of all exposures; the samples are of `curves`, if given."""
        parts = []
        if curves is None:
            self.places = np.full(len(self.curves), np.nan)
        widest = self.reach.max(initial=0.0)
        for chosen in self._chunks():
            reach = self.reach[chosen]
            if curves is None:
                scan, values = self._part(chosen, self.bright)  # also of saturated samples: they are where the light is
                self.places[chosen] = find_light(scan, values, reach, self.usable)
            scan, values = self._part(chosen, self.curves if curves is None else curves)
            parts.append(place_windows(scan, values, self.places[chosen], reach, self.usable, widest))
        windows = CurveWindows(
            first=np.concatenate([p.first for p in parts]),
            allowed=np.concatenate([p.allowed for p in parts]),
            samples=np.concatenate([p.samples for p in parts]),
            outside=np.concatenate([p.outside for p in parts], axis=1),
            middle=parts[0].middle,
        )
        if curves is None:
            self.windows = windows
        return windows

    def _place(self, windows: CurveWindows) -> FloatArray:
        """First estimate [n] in mm, and the noise of the dark samples, with or without a slope of the background."""
        self.noise = SampleNoise(dark_noise(windows, False), 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            z2 = windows.outside_trend / self.noise.floor
        z2 = np.where((self.noise.floor > 0) & (windows.outside[0] > 3), z2, np.nan)
        z2 = z2[np.isfinite(z2)]
        # slopes that are noise have squares of mean 1; a common slope shows in all
        self.tilted = bool(z2.size) and float(np.median(z2)) > MEDIAN_OF_SQUARE * (1 + 8 / np.sqrt(z2.size))
        if self.tilted:
            self.noise = SampleNoise(dark_noise(windows, True), 0.0)
        return self._centroids(windows)[0]

    def _gain_of(self, windows: CurveWindows) -> FloatArray:
        gain: FloatArray = self.gain[np.clip(windows.lines, 0, len(self.gain) - 1)]
        return gain

    def _centroids(self, windows: CurveWindows) -> tuple[FloatArray, FloatArray, FloatArray]:
        return centroid_fits(windows, self.noise, self._gain_of(windows), self.scan, self.tilted)

    def fit(self) -> None:
        """Fit all curves, with the noise that their residuals or the exposures' scatter show."""
        start = np.where(np.isfinite(self.place_mm), self.place_mm, self._first_place())
        for _ in range(2):
            self.fits, self.inverse = fit_profiles(
                self.windows, self.profiles, self.noise, self._gain_of(self.windows), start, self.tilted
            )
            start = np.where(np.isfinite(self.fits.place_mm), self.fits.place_mm, start)
            before = self.noise
            self.noise = noise_with_light(self.windows, self.fits, before, self._scatter())
            if abs(self.noise.per_light - before.per_light) <= 0.1 * self.noise.per_light:
                break
        self.place_mm = start

    def _first_place(self) -> FloatArray:
        first: FloatArray = self.scan.positions_mm[0] + line_pitch(self.scan) * self.places
        return first

    def _scatter(self) -> FloatArray | None:
        """Variance [n, W] of the mean of the exposures' samples, from their scatter; None for a single exposure."""
        count = len(self.scan.weights)
        if count == 1:
            return None
        if self.exposures is None:
            samples = np.stack([self._windows(flux).samples for flux in self.scan.flux_w])
            self.exposures = samples.var(0, ddof=1) / count
        return self.exposures

    def leave_out_wrong_frames(self) -> bool:
        """Subtract the offsets of the frames, and leave out those that show another line. Whether there were any."""
        offset, bright = self._dark_light_of_frames()
        self.frames = check_frames(self.scan, self.windows, self.fits, self.noise, bright)
        wrong = self.frames.worst(self.usable)
        # a scan of which most frames look wrong is something else: its own checks say what
        if (wrong | ~self.usable).sum() > len(wrong) / 4:
            self.shows = np.where(self.usable, self.frames.shows, self.shows)
            wrong[:] = False
        self.shows[wrong] = self.frames.shows[wrong]
        self.usable &= ~wrong
        # a wrong frame was in the levels that the offsets are counted from: they are found again without it
        offset[~self.usable | wrong.any()] = 0.0
        if not wrong.any() and not offset.any():
            return False
        self.offset += offset
        self.place_mm = self._place(self._windows())
        self.exposures = None
        return True

    def _dark_light_of_frames(self) -> tuple[FloatArray, IntArray]:
        """Of each frame's samples outside all windows: their mean [L], where noise does not explain it, and how many
        of them [L] are as bright as light."""
        count = len(self.scan.positions_mm)
        sums = np.zeros((3, count))
        peaks = self.fits.modelled.max(1, initial=0.0)
        typical = float(np.median(peaks[peaks > 0])) if peaks.any() else 0.0
        floor = max(float(np.median(self.noise.floor)) if len(peaks) else 0.0, (DARK * typical) ** 2)
        for _, lines, away, over in self._away():
            bright = over > max(STRAY_SIGMAS * np.sqrt(floor), STRAY_SHARE * typical)
            for total, part in zip(sums, (away, np.where(bright, 0.0, over), bright), strict=True):
                total += np.bincount(lines.ravel(), part.ravel(), count)
        number = np.maximum(sums[0], 1)
        mean = sums[1] / number
        # an offset of all frames belongs to the pixels' levels, and one of a single frame has moved those of all
        mean -= np.median(mean[self.usable])
        # the largest come first: what they feign in the other frames goes with them
        least = np.maximum(STRAY_SIGMAS * np.sqrt(floor / number), FEIGNED * np.abs(mean).max())
        return np.where(np.abs(mean) > least, mean, 0.0), sums[2].astype(np.int64)

    def _away(self) -> Iterator[tuple[slice, IntArray, BoolArray, FloatArray]]:
        """For each chunk of the curves: it, its samples' line numbers, which samples lie away from the curve's window,
        and by how much those exceed the background; 0 for the others."""
        count = len(self.scan.positions_mm)
        level, slope = self._dark_level()
        half = self.windows.allowed.shape[1] // 2 + 1
        for chosen in self._chunks():
            scan, values = self._part(chosen, self.curves)
            away = np.abs(scan.lines - self.places[chosen, None]) > half
            away &= np.isfinite(values) & (scan.lines < count)
            dark = level[chosen, None] + slope[chosen, None] * (scan.lines - self.windows.middle)
            over = np.where(away, values - dark, 0.0)
            yield chosen, np.minimum(scan.lines, count - 1), away, over

    def _dark_level(self) -> tuple[FloatArray, FloatArray]:
        """Level and slope [n] of each curve's background: of the fit, or of the samples outside."""
        fitted = np.isfinite(self.fits.place_mm)
        return np.where(fitted, self.fits.level, self.windows.outside_level), np.where(fitted, self.fits.slope, 0.0)

    def for_gains(self) -> ScanFit:
        """What the gains of the frames are found from."""
        scan = self.scan
        with np.errstate(invalid="ignore"):
            whole = self._beyond() <= 0
        whole &= ~self.saturated
        return ScanFit(scan.pixels, whole, self.windows, self.noise, self.fits, len(scan.positions_mm))

    def _beyond(self) -> FloatArray:
        """How far [n] each pixel's light extends past the first or last line, in lines; negative inside."""
        scan, pitch = self.scan, line_pitch(self.scan)
        first, last = whole_range(scan, pitch)
        beyond: FloatArray = np.maximum(first - (self.place_mm - self.reach), self.place_mm + self.reach - last) / pitch
        return beyond

    def result(self, way: str) -> ScanEstimate:
        """The estimate by "likelihood" or "windowed", with the flags."""
        windows = self.windows
        self.fits, self.inverse = fit_profiles(
            windows, self.profiles, self.noise, self._gain_of(windows), self.place_mm, self.tilted, exact=True
        )
        fits = self.fits
        windowed, error, flux = self._centroids(windows)
        use = np.isfinite(fits.place_mm) if way == "likelihood" else np.zeros(len(windowed), bool)
        place = np.where(use, fits.place_mm, windowed)
        replicates = []
        for left in self._left_out():
            other = self._windows(left)
            change = relinearised(fits, windows, self.noise, self.inverse, other)
            replicates.append(np.where(use, change, self._centroids(other)[0]))
        fitted, bound = covariances(windows, fits, self.noise, self.tilted)
        error = np.where(use, fitted, error)
        place = np.where(np.isfinite(error), place, np.nan)  # too few samples are left for an error: for a place, too
        flux = np.where(use, fits.flux, flux)
        return ScanEstimate(
            scan=self.scan,
            centroid_mm=np.stack([place, *replicates]),
            error_mm=error,
            bound_mm=bound,
            flags=self._flags(place, flux),
            flux=flux,
            level=fits.level,
            chi_square=fits.chi_square / fits.freedom,
            modelled=use,
            noise=self.noise,
            gain=self.gain,
            offset=self.offset,
            frames=replace(self.frames, shows=self.shows),
            tilted=self.tilted,
            profile_error=self._profile_error(),
        )

    def _profile_error(self) -> float:
        """Largest mean residual of the curves by distance from their centroid, in their peaks: noise averages away."""
        fits, pitch = self.fits, line_pitch(self.scan)
        peak = fits.modelled.max(1, initial=0.0)[:, None]
        used = self.windows.allowed & np.isfinite(fits.place_mm)[:, None] & (peak > 0)
        at = (self.scan.positions_mm[0] - np.nan_to_num(fits.place_mm))[:, None] / pitch + self.windows.lines
        width = self.windows.allowed.shape[1]
        bins = np.clip(np.rint((at + width / 2) * BINS), 0, width * BINS).astype(np.int64)
        number = np.bincount(bins.ravel(), used.ravel(), width * BINS + 1)
        with np.errstate(invalid="ignore", divide="ignore"):
            relative = np.where(used, fits.residual / peak, 0.0)
            mean = np.bincount(bins.ravel(), relative.ravel(), width * BINS + 1) / number
            square = np.bincount(bins.ravel(), (relative**2).ravel(), width * BINS + 1) / number
        known = number >= BIN_SAMPLES
        if not known.any():
            return float("nan")
        # what noise alone would leave of a mean is no error of the profile
        error = np.abs(mean[known]) - STRAY_SIGMAS * np.sqrt(square[known] / number[known])
        return float(max(error.max(), 0.0))

    def _left_out(self) -> Iterator[FloatArray]:
        """Mean curves [n, window] with each exposure left out in turn."""
        scan = self.scan
        if len(scan.weights) == 1:
            return
        for left in scan.jackknife_w()[1:]:
            yield np.where(np.isnan(self.curves), np.nan, left)

    def _flags(self, place: FloatArray, flux: FloatArray) -> IntArray:
        """A light_curves.Flag [n] for each curve."""
        inside = np.maximum(self.windows.allowed.sum(1), 1)
        with np.errstate(invalid="ignore"):
            lit = flux * self.scan.line_width > DETECTED * np.sqrt(self.noise.floor * inside)
        flags = np.where(self._stray(flux), Flag.STRAY, Flag.GOOD)
        with np.errstate(invalid="ignore"):
            flags = np.where(self._beyond() > EDGE_TOLERANCE, Flag.CLIPPED, flags)
        flags = np.where(self.saturated & ~np.isfinite(place), Flag.SATURATED, flags)
        flags = np.where(lit & np.isfinite(place) | (flags == Flag.SATURATED), flags, Flag.EMPTY)
        return np.where(np.isnan(self.curves).any(1) & ~self.saturated & ~np.isfinite(place), Flag.MASKED, flags)

    def _stray(self, flux: FloatArray) -> BoolArray:
        """Curves [n] with a second light: a box of the light's width outside the window that is bright beyond noise.

        Level and noise are those of the samples beside the box: a second light raises both of all samples together.
        """
        wider = (self.scan.line_width - 1) / 2
        box = light_box(float(np.median(self.reach)) / line_pitch(self.scan) + wider) if len(self.reach) else 1
        on_lines = flux * self.scan.line_width
        found = np.zeros(len(self.curves), bool)
        common = float(np.median(self.noise.floor)) if len(found) else 0.0
        for chosen, lines, away, over in self._away():
            away = away & self.usable[lines]
            over = np.where(away, over, 0.0)
            summed = (away.astype(np.float64), over, over**2)
            number, total, square = (np.cumsum(np.pad(v, ((0, 0), (1, 0))), axis=1) for v in summed)
            inside = [v[:, box:] - v[:, :-box] for v in (number, total, square)]
            if not inside[0].shape[1]:
                continue
            at = np.argmax(inside[1], axis=1)[:, None]
            n_box, in_box, squares = (np.take_along_axis(v, at, 1)[:, 0] for v in inside)
            beside = np.maximum(number[:, -1] - n_box, 1)
            mean = (total[:, -1] - in_box) / beside
            variance = np.maximum((square[:, -1] - squares) / beside - mean**2, common)
            excess = in_box - n_box * mean
            # the brightest of many boxes: noise alone reaches some standard errors
            found[chosen] = (excess > STRAY_SHARE * on_lines[chosen]) & (
                excess > STRAY_SIGMAS * np.sqrt(n_box * variance)
            )
        return found
