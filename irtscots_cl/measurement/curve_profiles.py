"""The design's profile of a pixel's light across the lines: the share of the light on each line, by place.

The profile is the light's closed form (optics/pixel), or traced light where that does not hold. A table makes the many
evaluations of a fit cheap; its last step does without.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.curve_windows import line_pitch
from irtscots_cl.measurement.line_edges import line_edges, on_lines
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.system import interruption

STEPS = 28  # of the table over a profile's extent, but at most 4 per line: the last step of a fit does without it
STEP = 0.05  # lines: for the derivative of a profile by differences
BEYOND = 1.1  # half-extents of a pixel's light that hold all of it


class Profiles:
    """The design's profiles of n pixels along one axis of the screen, by place: shares of the pixel's light.

    known: [n] pixels with a profile. The light below a grid of places around the centroid is tabulated once; a profile
    at any place is a difference of cubic interpolations, all at the same fraction of a step for one pixel.
    """

    def __init__(self, scan: Scan, light: PixelLight):
        output = "uv"["xy".index(scan.axis)]
        self.pitch, self.origin, self.line_width = line_pitch(scan), float(scan.positions_mm[0]), scan.line_width
        index = np.full(scan.shape[0] * scan.shape[1], -1)
        index[light.pixels] = np.arange(len(light.pixels))
        index = index[scan.pixels]
        centre = light.means(output)[0]
        middle, half = light.extent(output)
        usable = light.valid() & np.isfinite(centre) & np.isfinite(middle) & np.isfinite(half)
        self.known = (index >= 0) & usable[index]
        chosen = index[self.known]
        reach = float((half + np.abs(middle - centre))[chosen].max(initial=self.pitch)) * BEYOND / self.pitch
        # per line: wide profiles are smooth
        steps = int(np.clip(np.ceil(STEPS / (2 * reach)), 1, 4 if self.line_width == 1.0 else STEPS))
        count = int(np.ceil(reach * steps)) + 1
        self.steps, self.before = steps, count
        grid = np.arange(-count, count + 1) * self.pitch / steps
        edges = np.nan_to_num(centre)[:, None] + grid
        below = np.zeros((len(chosen), len(grid)))
        below[:, 1:] = np.cumsum(light.light(output, edges)[chosen], axis=1)
        total = below[:, -1].copy()
        with np.errstate(invalid="ignore", divide="ignore"):
            below /= below[:, -1:]
        lit = np.isfinite(below).all(1)
        self.known[np.flatnonzero(self.known)[~lit]] = False
        self.row = np.full(len(scan.pixels), -1)
        self.row[self.known] = np.arange(int(lit.sum()))
        self.below = below[lit]
        self.light, self.output, self.index = light, output, index
        self.centre = np.nan_to_num(centre)
        self.total = np.ones(len(light.pixels))
        self.total[index[self.known]] = total[lit]

    def exact_shares(self, first: IntArray, width: int, place_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As `shares`, of all n pixels, without the table; nothing for pixels that are not known."""
        count, known = len(self.light.pixels), self.known & np.isfinite(place_mm)
        own = self.origin + self.pitch * line_edges(first[known], width, self.line_width)
        edges = np.zeros((count, own.shape[1]))
        edges[self.index[known]] = own - (place_mm[known] - self.centre[self.index[known]])[:, None]
        step = STEP * self.pitch
        # one call: its column at the joint is of no line
        both = self.light.light(self.output, np.concatenate([edges + step, edges - step], axis=1)) / self.total[:, None]
        before, after = (np.zeros((len(first), width)) for _ in range(2))
        columns = both[self.index[known], : own.shape[1] - 1], both[self.index[known], own.shape[1] :]
        before[known], after[known] = (on_lines(part, self.line_width) for part in columns)
        return (before + after) / 2, (after - before) / (2 * step)

    def shares(
        self, chosen: IntArray, first: IntArray, width: int, place_mm: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Shares [m, width] on lines from first [m] on, of pixels chosen [m] whose light's centroid is at place_mm [m],
        and their derivative by place [1/mm]; all pixels must be known."""
        interruption.check()
        start = ((self.origin - place_mm) / self.pitch + first - self.line_width / 2) * self.steps + self.before
        if self.line_width == 1.0:
            edges, slopes = self._below(chosen, start, width + 1)
            share, slope = np.diff(edges, axis=1), np.diff(slopes, axis=1)
        else:
            low, by_low = self._below(chosen, start, width)
            high, by_high = self._below(chosen, start + self.line_width * self.steps, width)
            share, slope = high - low, by_high - by_low
        # a place further up moves the profile up: its edges move down in the table
        return share, slope * (-self.steps / self.pitch)

    def _below(self, chosen: IntArray, start: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
        """The light [m, count] below edges a line apart from place `start` [m] of the table on, and its slope there."""
        whole = np.floor(start).astype(np.int64)
        fraction = start - whole
        at = whole[:, None] + self.steps * np.arange(count)
        last = self.below.shape[1] - 1
        row = self.row[chosen, None]
        edges, slopes = np.zeros(at.shape), np.zeros(at.shape)
        for k, (weight, slope) in enumerate(zip(*_cubic(fraction), strict=True)):
            value = self.below[row, np.clip(at + k - 1, 0, last)]
            edges += weight[:, None] * value
            slopes += slope[:, None] * value
        return edges, slopes


def _cubic(t: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
    """Weights of the values at -1, 0, 1, 2 for the cubic through them at t [n] in 0..1, and their derivatives."""
    weights = [
        -t * (t - 1) * (t - 2) / 6,
        (t + 1) * (t - 1) * (t - 2) / 2,
        -(t + 1) * t * (t - 2) / 2,
        (t + 1) * t * (t - 1) / 6,
    ]
    slopes = [
        -(3 * t * t - 6 * t + 2) / 6,
        (3 * t * t - 4 * t - 1) / 2,
        -(3 * t * t - 2 * t - 2) / 2,
        (3 * t * t - 1) / 6,
    ]
    return weights, slopes
