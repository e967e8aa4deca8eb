"""The frames of a measurement: what an error of single frames does to the places that they tell.

A *weight* [n, k] is what a pixel's place takes over from its k-th frame: of the shift of the light in that frame, or of
the frame's relative brightness. Frames of line scans light one line each, and a pixel sees few of them; frames of
fringes are N steps of each series, and a pixel sees all. The x frames come before the y frames. What is added to a
frame is stated in units of the brightest sample of all frames.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from irtscots_cl.budget.light_sample import LightSample, LineShares
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.scene.instrument import Screen

TAU = 2 * np.pi
NEAR = 0.02  # of a line's width: around its edges, where the density of light is found


class Frames(Protocol):
    """The frames of both axes."""

    @property
    def counts(self) -> tuple[int, int]:
        """Of the x and the y frames."""

    def numbers(self, axis: int) -> IntArray:
        """Numbers [n, k] of the frames of an axis that the weights are of."""

    @property
    def of_shift(self) -> tuple[FloatArray, FloatArray]:
        """Of each axis [n, k] change of the place for each unit by which the light is shifted in one frame; the sum
        over k is 1."""

    @property
    def of_brightness(self) -> tuple[FloatArray, FloatArray]:
        """Of each axis [n, k] change of the place in mm for each relative change of a frame's brightness."""

    @property
    def of_addition(self) -> tuple[FloatArray, FloatArray]:
        """Of each axis [n, k] change of the place in mm for what is added to each frame, over the brightest sample."""

    @property
    def signal(self) -> tuple[FloatArray, FloatArray]:
        """Of each axis [n, k] light of the frames, over the brightest sample."""


@dataclass(frozen=True)
class LineFrames:
    """Scans of single lines, one after the other. The place is the light curve's centroid.

    A shift moves light over the lines' edges; its density there is that of the light in closed form.
    """

    chief: ChiefRays = field(repr=False)
    sample: LightSample = field(repr=False)

    @property
    def counts(self) -> tuple[int, int]:
        columns, rows = self.sample.screen.pixels
        return columns, rows

    def numbers(self, axis: int) -> IntArray:
        return np.clip(self._shares(axis).lines, 0, self.counts[axis] - 1)

    @cached_property
    def of_shift(self) -> tuple[FloatArray, FloatArray]:
        return self._shift(0), self._shift(1)

    @cached_property
    def of_brightness(self) -> tuple[FloatArray, FloatArray]:
        x, y = (shares.away_mm * shares.share for shares in self.sample.shares)
        return x, y

    @cached_property
    def of_addition(self) -> tuple[FloatArray, FloatArray]:
        """Nothing is added outside the window of the lines that the light reaches and one more on either side."""
        return self._addition(0), self._addition(1)

    @cached_property
    def signal(self) -> tuple[FloatArray, FloatArray]:
        x, y = (shares.share * shares.on_screen[:, None] / self.brightest for shares in self.sample.shares)
        return x, y

    @cached_property
    def brightest(self) -> float:
        """The largest share of a pixel's light in a single line."""
        return float(max((shares.share * shares.on_screen[:, None]).max() for shares in self.sample.shares))

    def _addition(self, axis: int) -> FloatArray:
        shares = self._shares(axis)
        with np.errstate(divide="ignore"):
            scale = np.where(shares.on_screen > 0, self.brightest / shares.on_screen, 0.0)
        return np.where(self.window(axis), shares.away_mm * scale[:, None], 0.0)

    def window(self, axis: int) -> BoolArray:
        """The frames [n, k] of an axis that a pixel's place is found from."""
        shares = self._shares(axis)
        lit = shares.share > 0
        reached = lit.copy()
        reached[:, 1:] |= lit[:, :-1]
        reached[:, :-1] |= lit[:, 1:]
        return reached & (shares.lines >= 0) & (shares.lines < self.counts[axis])

    @cached_property
    def curves(self) -> tuple[FloatArray, FloatArray]:
        """Of each axis [n, k] light curves in closed form, with any unit."""
        return self._curve(0), self._curve(1)

    def _curve(self, axis: int) -> FloatArray:
        shares, screen = self._shares(axis), self.sample.screen
        numbers = shares.first[:, None] + np.arange(shares.share.shape[1] + 1)
        numbers = np.clip(numbers, 0, screen.pixels[axis])  # no light comes from beyond
        edges = (numbers - screen.pixels[axis] / 2) * screen.pitch_xy_mm[axis] + screen.centre_offset_mm[axis]
        found: FloatArray = np.maximum(self._light.light("uv"[axis], edges), 0.0)
        return found

    @cached_property
    def _light(self) -> PixelLight:
        row, column = self.sample.maps.row, self.sample.maps.column
        return PixelLight.of(self.chief, (row * self.chief.shape[1] + column).astype(np.intp))

    def _shift(self, axis: int) -> FloatArray:
        shares, pitch = self._shares(axis), self.sample.screen.pitch_xy_mm[axis]
        numbers = shares.first[:, None] + np.arange(shares.share.shape[1] + 1)
        edges = (numbers - self.sample.screen.pixels[axis] / 2) * pitch + self.sample.screen.centre_offset_mm[axis]
        near = NEAR * pitch * np.array([-1.0, 1.0])
        light = self._light.light("uv"[axis], (edges[..., None] + near).reshape(len(edges), -1))[:, ::2]
        inside = (numbers >= 0) & (numbers <= self.sample.screen.pixels[axis])
        found: FloatArray = -shares.away_mm * np.diff(np.where(inside, light, 0.0))
        with np.errstate(invalid="ignore", divide="ignore"):  # a pixel of the rim without light of its own
            return np.nan_to_num(found / found.sum(-1, keepdims=True), posinf=0.0, neginf=0.0)

    def _shares(self, axis: int) -> LineShares:
        return self.sample.shares[axis]


@dataclass(frozen=True)
class FringeFrames:
    """N equal steps of sinusoids of some numbers of periods over the screen. The place is that of least squares.

    places_mm: [2, n] of the pixels. contrast: amplitude over mean of the recorded fringes.
    """

    screen: Screen
    places_mm: FloatArray = field(repr=False)
    periods: tuple[float, ...]
    steps: int
    contrast: float = 1.0

    @property
    def counts(self) -> tuple[int, int]:
        each = len(self.periods) * self.steps
        return each, each

    def numbers(self, axis: int) -> IntArray:
        each = self.counts[axis]
        return np.broadcast_to(np.arange(each), (self.places_mm.shape[1], each))

    @cached_property
    def of_shift(self) -> tuple[FloatArray, FloatArray]:
        x, y = (2 / self.steps * np.sin(self._angle(axis)) ** 2 * self._weights for axis in range(2))
        return x, y

    @cached_property
    def of_brightness(self) -> tuple[FloatArray, FloatArray]:
        return self._brightness(0), self._brightness(1)

    @cached_property
    def of_addition(self) -> tuple[FloatArray, FloatArray]:
        brightest = 1 / self.contrast + 1  # over the amplitude
        x, y = (brightest * np.sin(self._angle(axis)) * self._per_sample(axis) for axis in range(2))
        return x, y

    @cached_property
    def signal(self) -> tuple[FloatArray, FloatArray]:
        x, y = ((1 + self.contrast * np.cos(self._angle(axis))) / (1 + self.contrast) for axis in range(2))
        return x, y

    def phases(self, axis: int) -> FloatArray:
        """Phases [n, series] in rad at the places."""
        share = (self.places_mm[axis] - self.screen.centre_offset_mm[axis]) / self._width_mm(axis) + 0.5
        found: FloatArray = TAU * np.array(self.periods) * share[:, None]
        return found

    def per_radian(self, axis: int) -> FloatArray:
        """Changes [series] of the place in mm per rad by which the phase of one series alone is off."""
        squares = np.square(self.periods)
        found: FloatArray = self._width_mm(axis) / (TAU * np.array(self.periods)) * squares / squares.sum()
        return found

    def _brightness(self, axis: int) -> FloatArray:
        angle = self._angle(axis)
        found: FloatArray = (1 / self.contrast + np.cos(angle)) * np.sin(angle) * self._per_sample(axis)
        return found

    def _per_sample(self, axis: int) -> FloatArray:
        """[frames] change of the place in mm for each sample, in amplitudes, times the sine of its angle."""
        found: FloatArray = 2 / self.steps * np.repeat(self.per_radian(axis), self.steps)
        return found

    @cached_property
    def _weights(self) -> FloatArray:
        """[frames] of the series in the place: equal errors of phases make place errors of 1 over the periods."""
        squares = np.square(self.periods)
        found: FloatArray = np.repeat(squares / squares.sum(), self.steps)
        return found

    def _angle(self, axis: int) -> FloatArray:
        """[n, frames] step less phase."""
        step = TAU * np.arange(self.steps) / self.steps
        phase = self.phases(axis)
        found: FloatArray = (step - phase[..., None]).reshape(len(phase), -1)
        return found

    def _width_mm(self, axis: int) -> float:
        return self.screen.pixels[axis] * self.screen.pitch_xy_mm[axis]
