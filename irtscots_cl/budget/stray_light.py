"""Error source: light that is there in all frames, in all of them the same, and is not subtracted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.frames import LineFrames
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray


@dataclass(frozen=True)
class UniformLight:
    """value: light of every frame over the brightest sample of all. Phases of fringes do not see it."""

    name: str = "stray.uniform"
    unit: str = "of the peak"
    text: str = "the same light in all frames, that is not subtracted, over the brightest sample"
    usual: float = 1e-3
    kind: Kind = Kind.PARAMETER

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places: towards the middle of the window of their lines, by the share of what
        is added in the window's light."""
        frames = design.frames
        if not isinstance(frames, LineFrames):
            return np.zeros((2, design.count))
        found = np.empty((2, design.count))
        for axis in range(2):
            added = value * np.count_nonzero(frames.window(axis), axis=-1)
            found[axis] = value * frames.of_addition[axis].sum(-1) / (1 + added / frames.signal[axis].sum(-1))
        return found
