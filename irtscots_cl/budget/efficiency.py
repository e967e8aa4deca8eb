"""Error sources: a detector whose efficiency differs from place to place within one pixel.

Shading by the lens and the detector's response make the light of one side of a pixel count more than that of the other.
A factor 1 + a x on it, x from -1 to 1 over the detector, moves the mean of the places that the pixel sees by
a cov(u, x) over its light. What a pixel's factor is as a whole does nothing: it is the same in all frames and cancels,
by the centroid as by the phase. So do factors that differ at random from pixel to pixel (prnu).
"""

from __future__ import annotations

from dataclasses import dataclass

from irtscots_cl.budget.brightness import moved_by_factor
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray


@dataclass(frozen=True)
class Efficiency:
    """Slope of the detector's efficiency along its columns, "x", or rows, "y"."""

    axis: str
    unit: str = ""
    usual: float = 0.1
    kind: Kind = Kind.PARAMETER

    @property
    def name(self) -> str:
        return f"detector.efficiency_{self.axis}"

    @property
    def text(self) -> str:
        return f"efficiency of the detector as 1 + value {self.axis}, {self.axis} from -1 to 1 over it"

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places; NaN where the efficiency is not above 0."""
        axis = "xy".index(self.axis)
        half = design.setup.scene.camera.detector.pixels[axis] / 2
        row, column = design.seen.pixels
        mean = ((column, row)[axis] + 0.5) / half - 1
        return moved_by_factor(design.light.covariance_with_pixel_mm[:, axis] / half, mean, value)
