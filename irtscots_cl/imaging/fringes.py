"""Fringes on the screen and their images: N-step sinusoids of any periods and steps, along the screen's x or y.

The screen shows 1/2 + 1/2 cos(2 pi p s - step) of its full range, p the number of periods over the screen and s the
place along the axis as a fraction of the screen. A camera pixel that sees the place s records

    offset + amplitude cos(phase - step),    phase = 2 pi p s,

so that its samples at three or more steps give the phase, and phases of several p give s. A pixel sees a patch of the
screen: its phase is that of the light's Fourier component at p, not 2 pi p times the light's centroid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.scene.model import Scene

STEPS = (3, 64)  # of one series: least and most
MAX_PERIODS = 1e5  # over the screen
ENDS = ("edges", "centres")


def equal_steps(count: int) -> tuple[float, ...]:
    """The phase steps 2 pi k / count, k = 0, ..., count - 1."""
    return tuple(2 * math.pi * k / count for k in range(count))


@dataclass(frozen=True)
class FringeSet:
    """Sinusoids along one axis of the screen: a series of steps for each number of periods.

    axis: "x" or "y" of the screen's own frame. periods: numbers of periods over the screen. steps_rad: for each number
    of periods the phase steps of its frames, in their order. reverse: the phase grows with 1 - fraction, not with the
    fraction. ends: where fractions are 0 and 1: at the outer "edges" of the pixel grid, or at the "centres" of its
    first and last pixel.

    Raises ValueError for what is not allowed.
    """

    axis: str
    periods: tuple[float, ...]
    steps_rad: tuple[tuple[float, ...], ...]
    reverse: bool = False
    ends: str = "edges"

    def __post_init__(self) -> None:
        if self.axis not in ("x", "y"):
            raise ValueError(f'fringes: axis = {self.axis!r}: must be "x" or "y"')
        if self.ends not in ENDS:
            raise ValueError(f'fringes: ends = {self.ends!r}: must be "edges" or "centres"')
        what = f"{self.axis} fringes"
        if not self.periods or not all(0 < p <= MAX_PERIODS for p in self.periods):
            raise ValueError(
                f"{what}: periods = {list(self.periods)}: must be numbers above 0, at most {MAX_PERIODS:g}"
            )
        if len(self.steps_rad) != len(self.periods):
            raise ValueError(
                f"{what}: {len(self.steps_rad)} series of steps for {len(self.periods)} numbers of periods"
            )
        for steps in self.steps_rad:
            if not STEPS[0] <= len(steps) <= STEPS[1] or not all(math.isfinite(s) for s in steps):
                raise ValueError(f"{what}: {len(steps)} steps; must be {STEPS[0]} to {STEPS[1]} finite numbers [rad]")
            if len({round(s % (2 * math.pi), 6) % round(2 * math.pi, 6) for s in steps}) < 3:
                raise ValueError(f"{what}: steps = {list(steps)} rad: at least three must differ, modulo 2 pi")

    @classmethod
    def equal(
        cls, axis: str, periods: Sequence[float], steps: int = 4, *, reverse: bool = False, ends: str = "edges"
    ) -> FringeSet:
        """Series of equal steps 2 pi / steps."""
        return cls(axis, tuple(map(float, periods)), (equal_steps(steps),) * len(periods), reverse, ends)

    @property
    def count(self) -> int:
        """Frames of all series."""
        return sum(map(len, self.steps_rad))

    def values(self, fraction: FloatArray) -> FloatArray:
        """What the frames show at the fractions [n], from 0 to 1: [frames, n]."""
        place = 1 - fraction if self.reverse else np.asarray(fraction)
        rows = [
            0.5 + 0.5 * np.cos(2 * np.pi * periods * place - step)
            for periods, steps in zip(self.periods, self.steps_rad, strict=True)
            for step in steps
        ]
        return np.stack(rows)

    def pixel_fractions(self, pixels: int) -> FloatArray:
        """Fractions [pixels] of the screen pixels' centres."""
        k = np.arange(pixels, dtype=float)
        return k / max(pixels - 1, 1) if self.ends == "centres" else (k + 0.5) / pixels

    def edge_fraction(self, fraction: FloatArray, pixels: int) -> FloatArray:
        """The fractions as fractions of the way between the outer edges of a grid of so many pixels."""
        return (fraction * (pixels - 1) + 0.5) / pixels if self.ends == "centres" else fraction

    def position_mm(self, fraction: FloatArray, pixels: int, pitch_mm: float, offset_mm: float = 0.0) -> FloatArray:
        """Screen coordinate u (or v) [mm] of the fractions, for a grid with its middle at offset_mm."""
        return (self.edge_fraction(fraction, pixels) - 0.5) * pixels * pitch_mm + offset_mm

    def fraction(self, position_mm: FloatArray, pixels: int, pitch_mm: float, offset_mm: float = 0.0) -> FloatArray:
        """Fractions of screen coordinates [mm]: what position_mm undoes."""
        edges = (position_mm - offset_mm) / (pixels * pitch_mm) + 0.5
        return (edges * pixels - 0.5) / (pixels - 1) if self.ends == "centres" else edges


@dataclass(frozen=True)
class FringeScan:
    """Fringe patterns on a scene's screen: `run.images(FringeScan(scene, sets))` gives their FringeStack.

    gamma: of the screen: it emits value^gamma of its full radiance. levels: number of equal steps of the values that
    it can show (255 for 8 bits); 0: any value.
    """

    scene: Scene
    sets: tuple[FringeSet, ...]
    gamma: float = 1.0
    levels: int = 0

    def __post_init__(self) -> None:
        if not self.sets:
            raise ValueError("fringes: no set of fringes")
        if not 0 < self.gamma <= 10:
            raise ValueError(f"fringes: gamma = {self.gamma}: must be above 0, at most 10")
        if not 0 <= self.levels < 2**16:
            raise ValueError(f"fringes: levels = {self.levels}: must be 0 (any value) or up to 65535")

    def radiance(self, fringes: FringeSet) -> FloatArray:
        """Relative radiance [frames, pixels along the axis] of the screen's columns or rows."""
        values = fringes.values(fringes.pixel_fractions(self.scene.screen.pixels["xy".index(fringes.axis)]))
        if self.levels:
            values = np.rint(values * self.levels) / self.levels
        return values if self.gamma == 1 else values**self.gamma


@dataclass(frozen=True)
class FringeStack:
    """Images of fringes. frames: [rows, columns] each, of any real type: set by set, series by series, step by step.

    An array [frames, rows, columns] will do, and so will any sequence that reads a frame when it is asked for. A value
    that is not a number marks a sample as missing. dark, white: [rows, columns] with a black and with a white screen,
    None where there are none. saturation: value at which the camera's pixels saturate; samples there are left out.
    """

    sets: tuple[FringeSet, ...]
    frames: Sequence[NDArray[Any]] | NDArray[Any] = field(repr=False)
    dark: NDArray[Any] | None = field(default=None, repr=False)
    white: NDArray[Any] | None = field(default=None, repr=False)
    saturation: float = math.inf
    unit: str = "DN"

    def __post_init__(self) -> None:
        wanted = sum(one.count for one in self.sets)
        if len(self.frames) != wanted or not wanted:
            parts = ", ".join(f"{one.axis}: {' + '.join(str(len(s)) for s in one.steps_rad)}" for one in self.sets)
            raise ValueError(f"{len(self.frames)} fringe images; the fringes need {wanted} ({parts or 'none'})")
        if len({one.axis for one in self.sets}) != len(self.sets):
            raise ValueError(f"fringes: axes {[one.axis for one in self.sets]}: must be one set for each axis")
        if not self.saturation > 0:
            raise ValueError(f"saturation = {self.saturation}: must be above 0")
        shape = np.shape(self.frames[0])
        if len(shape) != 2 or 0 in shape:
            raise ValueError(f"fringe images have shape {shape}; must be [rows, columns]")
        for name, image in (("dark", self.dark), ("white", self.white)):
            if image is not None and np.shape(image) != shape:
                raise ValueError(f"the {name} image has shape {np.shape(image)}, the fringe images {shape}")

    @cached_property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the images."""
        rows, columns = np.shape(self.frames[0])
        return rows, columns

    def series(self, number: int) -> Iterator[tuple[float, tuple[float, ...], NDArray[Any]]]:
        """Of a set: (periods, steps [rad], images [steps, rows, columns]) of its series, one after the other."""
        for periods, steps, numbers in self._numbers(number):
            yield periods, steps, self._joined(numbers.start, len(numbers))

    def lines(self, number: int, which: int) -> list[NDArray[Any]]:
        """Images [rows * columns] of one series of a set, by its place in the set: not copied into one array."""
        _, _, numbers = self._numbers(number)[which]
        return [image.ravel() for image in self._read(numbers)]

    def samples(self, number: int, pixels: IntArray) -> Iterator[tuple[float, tuple[float, ...], NDArray[Any]]]:
        """As series, of some pixels [n] alone, by their flat numbers: samples [steps, n]."""
        for periods, steps, numbers in self._numbers(number):
            yield periods, steps, np.stack([image.ravel()[pixels] for image in self._read(numbers)])

    def _numbers(self, number: int) -> list[tuple[float, tuple[float, ...], range]]:
        """(periods, steps [rad], numbers of the images) of a set's series."""
        first = sum(one.count for one in self.sets[:number])
        found = []
        for periods, steps in zip(self.sets[number].periods, self.sets[number].steps_rad, strict=True):
            found.append((periods, steps, range(first, first + len(steps))))
            first += len(steps)
        return found

    def _read(self, numbers: range) -> Iterator[NDArray[Any]]:
        for k in numbers:
            image = np.asarray(self.frames[k])
            if image.shape != self.shape:
                raise ValueError(f"fringe image {k} has shape {image.shape}, the first one {self.shape}")
            yield image

    def _joined(self, first: int, count: int) -> NDArray[Any]:
        """Images [count, rows, columns]: a view where the frames are one array."""
        if isinstance(self.frames, np.ndarray):
            return self.frames[first : first + count]
        return np.stack(list(self._read(range(first, first + count))))
