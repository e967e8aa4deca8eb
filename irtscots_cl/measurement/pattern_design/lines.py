"""Errors of places by line scans, before there are images: the maximum-likelihood fit of the measurement, predicted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.curve_fit import MIN_SAMPLES, CurveFits, SampleNoise, covariances
from irtscots_cl.measurement.curve_profiles import Profiles
from irtscots_cl.measurement.curve_windows import CurveWindows, line_pitch, place_windows
from irtscots_cl.measurement.pattern_design.camera import DesignCamera
from irtscots_cl.measurement.pattern_design.pixels import SeenPixels
from irtscots_cl.scene.screen_shape import ScanLines

CANDIDATES = ((1, 1), (2, 2), (3, 3), (4, 2), (5, 5), (8, 8), (12, 12), (20, 20))  # width, step [pixels]
LEAST_LINES = 3.0  # that the light of a typical pixel must cover: on fewer, gains of frames pass for shifts


@dataclass(frozen=True)
class LineErrors:
    """Of a line scan of both axes. error_mm, bound_mm: [2, n] standard errors of the places along x and y and their
    Cramer-Rao bounds, from every line once, exposed until the brightest sample has as many electrons as a white
    screen brings; exact_mm: the errors without rounding to counts. frames: number of lines. longer: that exposure over
    the one for a white screen."""

    width: int
    step: int
    error_mm: FloatArray
    bound_mm: FloatArray
    exact_mm: FloatArray
    frames: int
    longer: float

    @property
    def name(self) -> str:
        return f"lines of {self.width}, every {self.step}"


def line_candidates(seen: SeenPixels) -> list[tuple[int, int]]:
    """(width, step) of line scans in which the light of a typical pixel covers enough lines, and that have three."""
    screen = seen.scene.screen
    light = [2 * float(np.median(seen.reach_mm[k])) / screen.pitch_xy_mm[k] for k in range(2)]
    return [
        (width, step)
        for width, step in CANDIDATES
        if min(light) >= LEAST_LINES * step
        and min(ScanLines(step_px=step, width_px=width).count(n) for n in screen.pixels) >= MIN_SAMPLES
    ]


def line_errors(seen: SeenPixels, camera: DesignCamera, width: int, step: int) -> LineErrors:
    """Predicted errors of the scan with lines of `width` pixels, every `step` pixels."""
    scene = replace(seen.scene, screen=replace(seen.scene.screen, lines=ScanLines(step_px=step, width_px=width)))
    pattern = LineScan(scene)
    parts = [_shares(seen, pattern, axis) for axis in range(2)]
    electrons = camera.electrons * seen.bright[:, None]
    peak = max(float((seen.bright[:, None] * share).max()) for _, _, share, _ in parts)
    longer = 1.0 / peak
    errors, bounds, exact = [], [], []
    for windows, place, share, by_place in parts:
        light, derivative = (np.where(windows.allowed, longer * electrons * part, 0.0) for part in (share, by_place))
        nothing = np.zeros(len(place))
        fits = CurveFits(
            place, longer * electrons[:, 0], nothing, nothing, light, derivative, np.zeros_like(light), nothing, nothing
        )
        lit = (light > 0).sum(1) >= MIN_SAMPLES
        error, bound = covariances(windows, fits, _noise(camera, len(place)), False)
        errors.append(np.where(lit & (error > 0), error, np.inf))
        bounds.append(np.where(lit, bound, np.inf))
        error, _ = covariances(windows, fits, _noise(camera.without_rounding, len(place)), False)
        exact.append(np.where(lit & (error > 0), error, np.inf))
    frames = sum(len(pattern.positions_mm(axis)) for axis in "xy")
    return LineErrors(width, step, np.stack(errors), np.stack(bounds), np.stack(exact), frames, longer)


def _noise(camera: DesignCamera, pixels: int) -> SampleNoise:
    return SampleNoise(np.full(pixels, camera.noise.read), camera.noise.gain)


def _shares(seen: SeenPixels, pattern: LineScan, axis: int) -> tuple[CurveWindows, FloatArray, FloatArray, FloatArray]:
    """Windows, places [n], shares of the light on the windows' lines [n, W] and their derivatives by place [1/mm]."""
    scene, name = seen.scene, "xy"[axis]
    columns, rows = scene.camera.detector.pixels
    positions, n = pattern.positions_mm(name), len(seen.pixels)
    scan = Scan(name, positions, (rows, columns), seen.pixels, np.zeros(n, np.int64), np.zeros((1, n, 1)), np.ones(1),
                np.full(n, np.nan), line_width=pattern.line_width)  # fmt: skip
    place, reach = seen.place_mm[axis], seen.reach_mm[axis]
    at = (place - positions[0]) / line_pitch(scan)
    usable = np.ones(len(positions), bool)
    windows = place_windows(scan, np.zeros((n, 1)), at, reach, usable, float(reach.max()))
    profiles = Profiles(scan, seen.light)
    share, by_place = profiles.exact_shares(windows.first, windows.allowed.shape[1], place)
    return windows, place, share, by_place
