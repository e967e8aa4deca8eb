"""Error sources: light of the screen that differs from pixel to pixel, or from frame to frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.motion import of_frames, times
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray


@dataclass(frozen=True)
class PixelBrightness:
    """Brightness of every pixel of the screen: an independent factor, uniform within 1 +- value."""

    name: str = "screen.brightness_random"
    unit: str = ""
    text: str = "factor on each pixel of the screen, uniform within 1 +- value"
    usual: float = 0.1
    kind: Kind = Kind.FIXED_PATTERN

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial: of the mean of what a pixel sees, weighted; NaN for a
        value above 1."""
        columns, rows = design.setup.scene.screen.pixels
        factor = 1 + value * (2 * draw.uniform(self.name, rows, columns) - 1)
        if value > 1:  # less than no light
            return np.full((2, design.count), np.nan)
        return weighted(design, factor)


@dataclass(frozen=True)
class DeadPixels:
    """Pixels of the screen that are dark, each with the same chance. value: root of their share, which effects grow
    with."""

    name: str = "screen.dead_pixels"
    unit: str = "sqrt(share)"
    text: str = "dead pixels of the screen: root of their share"
    usual: float = 0.03
    kind: Kind = Kind.FIXED_PATTERN

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial; NaN for a pixel that sees dead ones alone."""
        columns, rows = design.setup.scene.screen.pixels
        even = draw.uniform(self.name, rows, columns)
        return weighted(design, np.where(even < value**2, 0.0, 1.0))


def weighted(design: MeasuredDesign, factor: FloatArray) -> FloatArray:
    """Changes (du, dv) [2, n] of the places by a factor [rows, columns] on the light of the screen's pixels.

    NaN for a pixel all of whose light has a factor of 0.
    """
    shares, screen = design.light.of_pixels, design.setup.scene.screen
    total = shares @ factor.ravel()
    found = np.empty((2, design.count))
    for axis, number in enumerate(np.meshgrid(*(np.arange(k) for k in screen.pixels))):
        place = number * screen.pitch_xy_mm[axis]
        with np.errstate(invalid="ignore", divide="ignore"):
            found[axis] = shares @ (factor * place).ravel() / total - shares @ place.ravel()
    return found


@dataclass(frozen=True)
class FrameBrightness:
    """Brightness of the whole screen: independent in every frame, normal."""

    name: str = "screen.brightness_jitter"
    unit: str = ""
    text: str = "relative rms of the screen's brightness from frame to frame"
    usual: float = 1e-2
    kind: Kind = Kind.PROCESS

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial."""
        factors = value * draw.normal(self.name, sum(design.frames.counts))
        return of_frames(design, factors, shift=False)


@dataclass(frozen=True)
class BrightnessDrift:
    """Brightness of the whole screen: linear over all frames."""

    name: str = "screen.brightness_drift"
    unit: str = ""
    text: str = "relative change of the screen's brightness from the first to the last frame"
    usual: float = 1e-2
    kind: Kind = Kind.PARAMETER

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places."""
        return of_frames(design, value * times(design), shift=False)
