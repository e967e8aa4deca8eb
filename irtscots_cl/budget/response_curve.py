"""Error sources: screens and detectors that are not linear, as a power of the light.

Of fringes the power makes harmonics, which move phases where the number of steps cannot tell them apart
(measurement/harmonics.py has the closed form). Lines that are full on stay full on, so that the screen's power does
nothing to them; the detector's makes light curves narrower or wider, which moves centroids where they are lopsided.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.frames import FringeFrames, LineFrames
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.harmonics import gamma_harmonics, phase_bias

LEAST = 0.05  # power: below, light hardly differs from none


@dataclass(frozen=True)
class ResponsePower:
    """value: by how much the power differs from 1, after any correction. of: "screen" or "detector"."""

    of: str
    unit: str = ""
    kind: Kind = Kind.PARAMETER

    @property
    def name(self) -> str:
        return f"{self.of}.gamma"

    @property
    def text(self) -> str:
        return f"gamma of the {self.of} less 1, as left by corrections; of a screen without effect on lines"

    @property
    def usual(self) -> float:
        return 0.1 if self.of == "screen" else 0.01

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places; of fringes without blur, the most that there is. NaN for a power below
        LEAST."""
        power, frames = 1.0 + value, design.frames
        if self.of == "screen" and isinstance(frames, LineFrames):
            return np.zeros((2, design.count))
        if power < LEAST:
            return np.full((2, design.count), np.nan)
        if isinstance(frames, FringeFrames):
            return np.stack([_of_phases(frames, axis, power) for axis in range(2)])
        assert isinstance(frames, LineFrames)
        return np.stack([_of_curves(frames, axis, power) for axis in range(2)])


def _of_curves(frames: LineFrames, axis: int, power: float) -> FloatArray:
    curve, place = frames.curves[axis], frames.sample.shares[axis].away_mm
    with np.errstate(invalid="ignore", divide="ignore"):  # a pixel of the rim without light of its own
        before, after = (np.sum(place * c, -1) / c.sum(-1) for c in (curve, curve**power))
    return np.nan_to_num(after - before)


def _of_phases(frames: FringeFrames, axis: int, power: float) -> FloatArray:
    steps = 2 * np.pi * np.arange(frames.steps) / frames.steps
    phases = frames.phases(axis)
    bias = phase_bias(phases.ravel(), steps, gamma_harmonics(power)).reshape(phases.shape)
    found: FloatArray = bias @ frames.per_radian(axis)
    return found
