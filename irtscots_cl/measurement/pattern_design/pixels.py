"""What pixels see of the screen, for a choice of patterns: their light, its place, and what fringes become in it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.fringe_light import phases_of_light
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene

SAMPLE = 500  # pixels: what they see varies smoothly over the mirror
COVERAGE = 0.5  # least share of a pixel's footprint on the mirror, as in measuring
LEAST_PERIODS, LEAST_PIXELS = 0.5, 6  # of the tables: fewest periods over the screen; fewest pixels of a period
PERIODS = 64  # numbers of periods in the tables


@dataclass(frozen=True)
class SeenPixels:
    """A sample of n pixels whose light lies on the screen, and on the mirror for COVERAGE at least.

    light: of these pixels. bright: [n] light under a white screen over that of the brightest. place_mm, reach_mm:
    [2, n] centroids of the light along the screen's x and y, and its half-extents. white_share: of the brightest, as a
    share (optics/pixel). usable: [rows, columns] of all such pixels.
    periods: [m]; modulation: [2, m, n] what the light leaves of sinusoids of so many periods along x and y;
    inverted: [2, m, n] whether it turns them by more than a quarter of a period.
    """

    scene: Scene
    light: PixelLight = field(repr=False)
    bright: FloatArray = field(repr=False)
    place_mm: FloatArray = field(repr=False)
    reach_mm: FloatArray = field(repr=False)
    white_share: float
    usable: BoolArray = field(repr=False)
    periods: FloatArray = field(repr=False)
    modulation: FloatArray = field(repr=False)
    inverted: BoolArray = field(repr=False)

    @property
    def pixels(self) -> IntArray:
        """Flat numbers [n]."""
        numbers: IntArray = self.light.pixels
        return numbers

    def width_mm(self, axis: int) -> float:
        """Of the screen along x (0) or y (1)."""
        screen = self.scene.screen
        return screen.pixels[axis] * screen.pitch_xy_mm[axis]

    def fraction(self, axis: int) -> FloatArray:
        """Places [n] as fractions of the screen."""
        place: FloatArray = (self.place_mm[axis] - self.scene.screen.centre_offset_mm[axis]) / self.width_mm(axis) + 0.5
        return place

    def modulation_at(self, axis: int, periods: float) -> FloatArray:
        """Modulation [n] at a number of periods, between those of the table by a straight line in p."""
        return self._between(self.modulation[axis], periods)

    def least_modulation_at(self, axis: int, periods: float) -> FloatArray:
        """The least modulation [n] of all fewer periods, negative beyond a zero of it: the fringes are inverted there
        and, a little before and after, gone."""
        return self._between(self._least[axis], periods)

    @cached_property
    def _least(self) -> FloatArray:
        least: FloatArray = np.minimum.accumulate(np.where(self.inverted, -self.modulation, self.modulation), axis=1)
        return least

    def _between(self, table: FloatArray, periods: float) -> FloatArray:
        k = int(np.clip(np.searchsorted(self.periods, periods) - 1, 0, len(self.periods) - 2))
        share = (periods - self.periods[k]) / (self.periods[k + 1] - self.periods[k])
        between: FloatArray = (1 - share) * table[k] + share * table[k + 1]
        return between

    @property
    def most_periods(self) -> float:
        return float(self.periods[-1])


def seen_pixels(setup: Setup) -> SeenPixels:
    """The pixels of a design's set-up. Raises ValueError where no pixel's light lies on the screen."""
    chief, scene = setup.chief_rays, setup.scene
    on_mirror = (chief.footprint.coverage >= COVERAGE) & _on_screen(setup)
    numbers = np.flatnonzero(on_mirror)
    if not numbers.size:
        raise ValueError(
            f"scene {scene.name}: no detector pixel sees a part of the screen that all its light comes from; must have "
            "a larger screen, or camera and screen aimed at the mirror"
        )
    light = PixelLight.of(chief, numbers[_spread(len(numbers))])
    means, (_, reach_u), (_, reach_v) = light.means("uv"), light.extent("u"), light.extent("v")
    half = scene.screen.pixels[0] * scene.screen.pitch_xy_mm[0] / 2
    ends = scene.screen.centre_offset_mm[0] + np.array([-half, half])
    white = light.light("u", np.broadcast_to(ends, (len(light.pixels), 2)))[:, 0]
    known = light.valid() & np.isfinite(means).all(0) & np.isfinite(reach_u + reach_v) & (white > 0)
    if not known.any():
        raise ValueError(f"scene {scene.name}: the light of no detector pixel on the screen is known")
    if not known.all():
        light = PixelLight.of(chief, light.pixels[known])
    most = max(float(min(scene.screen.pixels)) / LEAST_PIXELS, 1.0)
    periods = np.geomspace(LEAST_PERIODS, most, PERIODS)
    tables = [_modulation(light, scene, axis, means[axis, known], periods) for axis in range(2)]
    return SeenPixels(
        scene, light, white[known] / white[known].max(), means[:, known], np.stack([reach_u, reach_v])[:, known],
        float(white[known].max()), on_mirror, periods, *map(np.stack, zip(*tables, strict=True)),
    )  # fmt: skip


def _modulation(
    light: PixelLight, scene: Scene, axis: int, place_mm: FloatArray, periods: FloatArray
) -> tuple[FloatArray, BoolArray]:
    fringes = FringeSet.equal("xy"[axis], tuple(periods), 3)
    found = phases_of_light(light, scene.screen, fringes, place_mm)
    return np.nan_to_num(found.modulation), np.cos(np.nan_to_num(found.difference_rad)) < 0


def _on_screen(setup: Setup) -> BoolArray:
    """Pixels [rows, columns] all of whose light lies within the screen, by their chief rays."""
    chief, screen = setup.chief_rays, setup.scene.screen
    inside: BoolArray = chief.sees_mirror.copy()
    for k, centre in enumerate((chief.footprint.u_mm, chief.footprint.v_mm)):
        half_width, row, column = chief.light_shape(k)
        half = screen.pixels[k] * screen.pitch_xy_mm[k] / 2
        with np.errstate(invalid="ignore"):
            inside &= np.abs(centre - screen.centre_offset_mm[k]) + half_width + (row + column) / 2 <= half
    return inside


def _spread(count: int) -> IntArray:
    """Indices of SAMPLE of so many things: by the golden ratio, so that no row or column repeats in them."""
    if count <= SAMPLE:
        return np.arange(count)
    found: IntArray = np.unique((np.arange(SAMPLE) * (math.sqrt(5) - 1) / 2 % 1.0 * count).astype(np.int64))
    return found
