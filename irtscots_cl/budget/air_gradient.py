"""Error sources: air that is warmer at one side. Its refractive index has a gradient, in which rays are arcs.

The curvature of a ray is the gradient's part across it, towards the cold. On a way of length L it is off by half the
curvature times L^2 at its end. The index follows the density: n - 1 goes with 1 over
the temperature at constant pressure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray

AXES = "xyz"
INDEX_PER_K = -2.72e-4 / 293.15  # n - 1 of air at 633 nm, 20 C and 101.3 kPa is 2.72e-4, over the temperature
MM_PER_M = 1e3


@dataclass(frozen=True)
class TemperatureGradient:
    """Gradient of the air's temperature along an axis of the world."""

    axis: str
    unit: str = "K/m"
    usual: float = 0.5
    kind: Kind = Kind.PARAMETER

    @property
    def name(self) -> str:
        return f"air.gradient_{self.axis}_k_per_m"

    @property
    def text(self) -> str:
        return f"gradient of the air's temperature along the world's {self.axis}, on the whole way"

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places, to first order in the gradient."""
        return value * design.once(self.name, lambda: self._derivative(design))

    def _derivative(self, design: MeasuredDesign) -> FloatArray:
        bends = design.bends
        vector = np.eye(3)[AXES.index(self.axis)]
        camera, screen = bends.lengths_mm
        by_mm, by_rad = bends.camera_leg(vector)
        # the integrals of (by_rad - z by_mm) dz to the mirror, and of t dt from there to the screen
        found = camera * by_rad - camera**2 / 2 * by_mm + screen**2 / 2 * bends.screen_leg(vector)
        derivative: FloatArray = INDEX_PER_K / MM_PER_M * found
        return derivative
