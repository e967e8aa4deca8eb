"""Line scans as pictures, and read back: lines of any width, step and start, in fractions of a pixel too.

A line that begins or ends within a pixel shows that pixel grey, by the part of it that it covers: the screen must show
values in proportion to its light. For a measurement such lines are those of a screen whose pixels are a whole number of
times as fine, which every part of the product knows already.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from irtscots_cl.imaging.shown_frames import LINE, ShownFrame
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.model import Scene

FINEST = 16  # parts of a pixel that lines may begin at
ROUNDING = 1e-6  # of a pixel
LEAST = 3  # lines of a scan


@dataclass(frozen=True)
class LineSet:
    """The lines of a scan: line k covers the pixels from first_px + k step_px to width_px further.

    Raises ValueError for numbers that are no multiples of a pixel's parts, of which there are at most FINEST.
    """

    width_px: float = 1.0
    step_px: float = 1.0
    first_px: float = 0.0

    def __post_init__(self) -> None:
        for name, least in (("width", 0.0), ("step", 0.0), ("first", -ROUNDING)):
            value = getattr(self, f"{name}_px")
            if not least < value < 1e6:
                raise ValueError(f"lines: {name} = {value:g} pixels: must be {'above' if least == 0 else 'from'} 0")
        _ = self.parts

    @property
    def parts(self) -> int:
        """Parts of a pixel that all lines are made of."""
        return parts_of((self.width_px, self.step_px, self.first_px))

    def count(self, pixels: int) -> int:
        """Lines that lie wholly on so many pixels."""
        return max(math.floor((pixels - self.first_px - self.width_px) / self.step_px + ROUNDING) + 1, 0)

    def series(self, axis: str, pixels: int) -> list[ShownFrame]:
        """The frames of a scan over so many pixels. Raises ValueError for fewer than three lines."""
        count = self.count(pixels)
        if count < LEAST:
            raise ValueError(
                f"lines: width {self.width_px:g}, step {self.step_px:g}, first {self.first_px:g}: {count} lines on the "
                f"{pixels} pixels of the {axis} scan; must be at least {LEAST}"
            )
        firsts = (round((self.first_px + k * self.step_px) * self.parts) / self.parts for k in range(count))
        return [ShownFrame(LINE, axis, first_px=(first, 0.0), width_px=self.width_px) for first in firsts]


def parts_of(lengths_px: Sequence[float]) -> int:
    """The least number of parts of a pixel that all lengths are multiples of. Raises ValueError above FINEST."""
    values = np.asarray(lengths_px, float)
    for parts in range(1, FINEST + 1):
        if np.abs(values * parts - np.rint(values * parts)).max() < ROUNDING * parts:
            return parts
    shown = ", ".join(f"{value:.6g}" for value in values[:3])
    raise ValueError(f"lines: {shown} pixels: must be multiples of 1/n of a pixel, n at most {FINEST}")


def line_values(first_px: float, width_px: float, pixels: int) -> FloatArray:
    """What the pixels of an axis show, from 0 to 1: the part of each that the line covers."""
    start = np.arange(pixels)
    covered = np.minimum(start + 1, first_px + width_px) - np.maximum(start, first_px)
    values: FloatArray = np.clip(covered, 0.0, 1.0)
    return values


def scene_of_lines(frames: Sequence[ShownFrame], scene: Scene) -> tuple[Scene, dict[str, list[int]]]:
    """The scene whose screen scans the lines of the frames; and by axis which of its lines each frame shows.

    Lines within pixels make the screen's pixels finer, of the same grid. Lines in between that were not shown are
    missing. Raises ValueError for lines that are no regular scan, or not the same in x and y.
    """
    from irtscots_cl.scene.screen_shape import ScanLines  # imported late: few scenes have a table of lines

    widths = {frame.width_px for frame in frames}
    if len(widths) > 1:
        raise ValueError(f"frames: lines {' and '.join(f'{w:g}' for w in sorted(widths)[:3])} pixels wide: must be one")
    width = widths.pop()
    firsts = {axis: np.array([f.first_px[0] for f in frames if f.axis == axis]) for axis in "xy"}
    parts = parts_of([width, *firsts["x"], *firsts["y"]])
    whole = {axis: np.rint(values * parts).astype(int) for axis, values in firsts.items()}
    for axis, starts in whole.items():
        if len(np.unique(starts)) < len(starts):
            raise ValueError(f"frames: a line of the {axis} scan is shown twice; must be shown once")
        end, pixels = starts.max() + round(width * parts), parts * scene.screen.pixels["xy".index(axis)]
        if starts.min() < 0 or end > pixels:
            raise ValueError(f"frames: a line of the {axis} scan lies beyond the screen's edge; must lie on the screen")
    steps = {axis: reduce(math.gcd, np.diff(np.sort(starts)).tolist(), 0) for axis, starts in whole.items()}
    step = math.gcd(*steps.values())
    if step == 0 or any(value != step for value in steps.values()):
        raise ValueError(
            f"frames: lines {steps['x'] / parts:g} and {steps['y'] / parts:g} pixels apart in x and y: must be equal"
        )
    first = int(whole["x"][0]) % step
    if (whole["y"][0] - first) % step:
        raise ValueError("frames: the lines of the y scan begin at other parts of a step than those of the x scan")
    lines = ScanLines(step_px=step, width_px=round(width * parts), first_px=first)
    screen = scene.screen
    pitch = (screen.pitch_xy_mm[0] / parts, screen.pitch_xy_mm[1] / parts)
    screen = replace(screen, pixels=(screen.pixels[0] * parts, screen.pixels[1] * parts), pitch_mm=pitch, lines=lines)
    numbers = {axis: ((starts - first) // step).tolist() for axis, starts in whole.items()}
    return replace(scene, screen=screen), numbers
