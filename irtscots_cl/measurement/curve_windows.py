"""Where each pixel's light lies on the screen's lines: the samples that the geometry allows, and the others.

The design gives the width of a pixel's light; its place is found in the images, since a deviation or a misaligned
mirror moves it. Samples are signed: noise and an imperfect background are as often negative as positive, and a sum over
a fixed window keeps them unbiased. A window is placed in whole lines around a first estimate, with a margin, so that
its place hardly depends on the noise of the samples in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray

MARGIN = 0.5  # lines on each side: for the noise of the first estimate, and for light wider than the design's
GUARD = 1  # lines beyond the window that count neither as light nor as background
FULL_WIDTH = 0.6  # of a light's extent: about its width at half its height, which a box finds with least noise
ROUNDS = 2  # of placing a window around the centroid in it


@dataclass(frozen=True)
class CurveWindows:
    """Windows of W lines on n light curves of a scan of L lines.

    first: [n] first line of each window; it may be negative, or reach past the last line. allowed: [n, W] samples that
    the pixel's light can reach, that were recorded and are numbers. samples: [n, W] values there, 0 elsewhere.
    outside: [6, n] sums over the other recorded samples, without the window's own within the guard, of 1, t, t^2, y, t
    y and y^2; t: the line number minus `middle`, y: the sample.
    """

    first: IntArray
    allowed: BoolArray
    samples: FloatArray
    outside: FloatArray
    middle: float

    @property
    def lines(self) -> IntArray:
        """Line numbers [n, W] of the windows' samples; some may lie beyond the scan."""
        width: int = self.allowed.shape[1]
        return self.first[:, None] + np.arange(width)

    @property
    def outside_level(self) -> FloatArray:
        """Mean [n] of the samples outside; 0 where there is none."""
        level: FloatArray = self.outside[3] / np.maximum(self.outside[0], 1)
        return level

    @property
    def outside_trend(self) -> FloatArray:
        """What a slope takes [n] off the sum of squares of the samples outside: noise alone makes its variance."""
        count, t, t2, y, ty, _ = self.outside
        some = np.maximum(count, 1)
        spread = t2 - t * t / some
        return np.where(spread > 0, (ty - t * y / some) ** 2 / np.where(spread > 0, spread, 1), 0.0)

    def part(self, chosen: slice | IntArray | BoolArray) -> CurveWindows:
        """The windows of some of the curves."""
        return replace(
            self,
            first=self.first[chosen],
            allowed=self.allowed[chosen],
            samples=self.samples[chosen],
            outside=self.outside[:, chosen],
        )


def line_pitch(scan: Scan) -> float:
    """Mean distance of a scan's lines in mm; 1 for a single line, whose curves are all clipped."""
    return float(np.diff(scan.positions_mm).mean()) if len(scan.positions_mm) > 1 else 1.0


def light_box(reach: float) -> int:
    """Lines of a box of the width, at half its height, of light with a half-extent of `reach` lines."""
    return max(1, round(2 * reach * FULL_WIDTH))


def find_light(scan: Scan, curves: FloatArray, reach_mm: FloatArray, usable: BoolArray) -> FloatArray:
    """First estimate of the light's place [n], as a fractional line number; NaN for a curve without samples.

    curves: [n, window] samples of the scan. reach_mm: [n] half-extent of the light. usable: [L] lines whose images
    count. The box of the light's width at half its height that holds most light, then the centroid in a window.
    """
    reach = np.nan_to_num(reach_mm / line_pitch(scan), nan=1.0, posinf=1.0)
    typical = float(np.median(reach[reach > 0])) if (reach > 0).any() else 1.0
    typical += (scan.line_width - 1) / 2  # wide lines widen the curves
    box = min(light_box(typical), curves.shape[1])
    on_scan = _recorded(scan, curves, usable)
    values = np.where(on_scan, curves, 0.0)
    total = np.cumsum(np.pad(values, ((0, 0), (1, 0))), axis=1)
    place = np.argmax(total[:, box:] - total[:, :-box], axis=1) + (box - 1) / 2
    level = _level_elsewhere(values, on_scan, place, typical)
    offset = np.arange(values.shape[1])
    for _ in range(ROUNDS):
        near = on_scan & (np.abs(offset - np.rint(place)[:, None]) <= np.ceil(typical + MARGIN))
        light = np.where(near, values - level[:, None], 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            moved = (light * offset).sum(1) / light.sum(1)
        # a curve of noise has no centroid: its place stays where the box found most
        place = np.where(np.abs(moved - place) <= typical + 1, moved, place)
    return np.where(on_scan.any(1), scan.first_line + place, np.nan)


def place_windows(
    scan: Scan, curves: FloatArray, place: FloatArray, reach_mm: FloatArray, usable: BoolArray, widest_mm: float
) -> CurveWindows:
    """Windows around the places [n] (fractional line numbers) of the light of curves [n, window].

    widest_mm: largest reach of all curves of the scan, so that the windows of each part are equally wide. A simulated
    scan stores few lines of each curve: all other lines are recorded, and dark.
    """
    half_line = scan.line_width / 2
    half = np.nan_to_num(reach_mm / line_pitch(scan), nan=1.0, posinf=1.0) + half_line + MARGIN
    width = 2 * int(np.ceil(widest_mm / line_pitch(scan) + half_line + MARGIN)) + 1
    centre = np.rint(np.nan_to_num(place)).astype(np.int64)
    first = centre - width // 2
    lines = first[:, None] + np.arange(width)
    index = lines - scan.first_line[:, None]
    count = len(scan.positions_mm)
    stored = (index >= 0) & (index < curves.shape[1])
    values = np.where(stored, np.take_along_axis(curves, np.clip(index, 0, curves.shape[1] - 1), 1), 0.0)
    recorded = (lines >= 0) & (lines < count) & np.isfinite(values)
    recorded &= usable[np.clip(lines, 0, count - 1)]
    near = np.abs(lines - np.nan_to_num(place)[:, None]) <= half[:, None]
    guarded = np.abs(lines - np.nan_to_num(place)[:, None]) <= half[:, None] + GUARD
    middle = (count - 1) / 2
    outside = _sums(scan, curves, usable, middle) - _window_sums(lines, values, recorded & guarded, middle)
    allowed = recorded & near & np.isfinite(place)[:, None]
    return CurveWindows(first, allowed, np.where(allowed, values, 0.0), outside, middle)


def _recorded(scan: Scan, curves: FloatArray, usable: BoolArray) -> BoolArray:
    """Samples [n, window] that are numbers, of lines on the scan whose images count."""
    lines = scan.lines
    found: BoolArray = np.isfinite(curves) & (lines < len(usable)) & usable[np.minimum(lines, len(usable) - 1)]
    return found


def _level_elsewhere(values: FloatArray, on_scan: BoolArray, place: FloatArray, reach: float) -> FloatArray:
    """Mean [n] of the samples away from the light: the background of the first estimate."""
    away = on_scan & (np.abs(np.arange(values.shape[1]) - place[:, None]) > reach + 1 + GUARD)
    level: FloatArray = np.where(away, values, 0.0).sum(1) / np.maximum(away.sum(1), 1)
    return level


def _sums(scan: Scan, curves: FloatArray, usable: BoolArray, middle: float) -> FloatArray:
    """Sums [6, n] over whole curves of 1, t, t^2, y, t y, y^2; lines that are not stored are dark."""
    t = np.flatnonzero(usable) - middle
    fixed = np.array([len(t), t.sum(), (t * t).sum()])
    if curves.shape[1] == len(usable) and not scan.first_line.any() and usable.all() and np.isfinite(curves).all():
        t = np.arange(len(usable)) - middle
        of_curves = [curves.sum(1), curves @ t, np.einsum("ij,ij->i", curves, curves)]
        return np.stack([*(np.full(len(curves), f) for f in fixed), *of_curves])
    recorded = _recorded(scan, curves, usable)
    missing = ~recorded & (scan.lines < len(usable)) & usable[np.minimum(scan.lines, len(usable) - 1)]
    t = scan.lines - middle
    y = np.where(recorded, curves, 0.0)
    of_missing = np.stack([missing.sum(1), (t * missing).sum(1), (t * t * missing).sum(1)])
    return np.concatenate([fixed[:, None] - of_missing, np.stack([y.sum(1), (t * y).sum(1), (y * y).sum(1)])])


def _window_sums(lines: IntArray, values: FloatArray, counted: BoolArray, middle: float) -> FloatArray:
    t, y = np.where(counted, lines - middle, 0.0), np.where(counted, values, 0.0)
    return np.stack([counted.sum(1), t.sum(1), (t * t).sum(1), y.sum(1), (t * y).sum(1), (y * y).sum(1)])
