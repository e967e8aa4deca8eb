"""Error sources: parts that move while the frames are taken, in every frame anew or little by little.

A part's shift in one frame moves the light by as much as if it had always been there, in that frame alone; the place
takes over the frame's weight of it (budget/frames.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.geometry import Geometry, geometry_derivative
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray

VIBRATION, DRIFT = "vibration.", "drift."


@dataclass(frozen=True)
class Vibration:
    """A number of the geometry that is another one in each frame: independent, normal, about 0."""

    of: Geometry
    kind: Kind = Kind.PROCESS

    @property
    def name(self) -> str:
        return VIBRATION + self.of.name

    @property
    def unit(self) -> str:
        return self.of.unit

    @property
    def text(self) -> str:
        return f"rms from frame to frame: {self.of.text}"

    @property
    def usual(self) -> float:
        return 1e-2 * self.of.usual

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial."""
        return _moved(design, self.of, value * draw.normal(self.name, sum(design.frames.counts)))


@dataclass(frozen=True)
class Drift:
    """A number of the geometry that changes linearly by its value from the first to the last frame, 0 in the middle."""

    of: Geometry
    kind: Kind = Kind.PARAMETER

    @property
    def name(self) -> str:
        return DRIFT + self.of.name

    @property
    def unit(self) -> str:
        return self.of.unit

    @property
    def text(self) -> str:
        return f"drift over all frames: {self.of.text}"

    @property
    def usual(self) -> float:
        return 0.1 * self.of.usual

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places."""
        return _moved(design, self.of, value * times(design))


def times(design: MeasuredDesign) -> FloatArray:
    """Times [frames] of all frames, from -1/2 for the first to 1/2 for the last."""
    found: FloatArray = np.linspace(-0.5, 0.5, sum(design.frames.counts))
    return found


def of_frames(design: MeasuredDesign, values: FloatArray, shift: bool) -> FloatArray:
    """Sums [2, n] of values [frames] by the frames' weights: of shifts, or of brightness in mm."""
    frames, found = design.frames, np.zeros((2, design.count))
    for axis, part in enumerate(np.split(values, [frames.counts[0]])):
        weights = (frames.of_shift if shift else frames.of_brightness)[axis]
        found[axis] = np.einsum("nk,nk->n", weights, part[frames.numbers(axis)])
    return found


def _moved(design: MeasuredDesign, of: Geometry, shifts: FloatArray) -> FloatArray:
    """Changes [2, n] of the places by a number of the geometry that has a value [frames] in each frame."""
    found: FloatArray = geometry_derivative(design, of.name) * of_frames(design, shifts, shift=True)
    return found
