"""Error sources: a screen whose brightness differs from place to place within what one pixel sees of it.

The light of a pixel has its centroid where its mean lies. A factor 1 + a x on the brightness, x from -1 to 1 over the
screen, moves it by a cov(u, x) over the pixel's light, whatever is shown, lines or fringes: factors that are the same
for all of a pixel's light cancel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray

TERMS = ("x", "y", "xx", "xy", "yy")


def moved_by_factor(covariance_mm: FloatArray, mean: FloatArray, value: float) -> FloatArray:
    """Changes (du, dv) [2, n] of the mean places of pixels' light by a factor 1 + value x on it; NaN where the factor's
    mean is not above 0.

    covariance_mm: [2, n] of places and x over a pixel's light. mean: [n] of x.
    """
    light = 1 + value * mean
    found: FloatArray = covariance_mm * value / np.where(light > 0, light, np.nan)
    return found


@dataclass(frozen=True)
class Brightness:
    """Coefficient of one term of the brightness over the screen: see scene.screen_response.brightness_polynomial."""

    term: str
    unit: str = ""
    usual: float = 0.1
    kind: Kind = Kind.PARAMETER

    @property
    def name(self) -> str:
        return f"screen.brightness_{self.term}"

    @property
    def text(self) -> str:
        return f"brightness of the screen as 1 + value {' '.join(self.term)}, x and y from -1 to 1 over it"

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places: covariance with the factor over its mean; NaN where that is not
        above 0."""
        slope, mean = self._gradient(design)
        return moved_by_factor(np.einsum("ijn,jn->in", design.light.covariance_mm2, slope), mean, value)

    def derivative(self, design: MeasuredDesign) -> FloatArray:
        """Changes [2, n] per unit."""
        slope, _ = self._gradient(design)
        found: FloatArray = np.einsum("ijn,jn->in", design.light.covariance_mm2, slope)
        return found

    def _gradient(self, design: MeasuredDesign) -> tuple[FloatArray, FloatArray]:
        """Gradient [2, n] of the term in 1/mm and its value [n], at the places."""
        screen = design.setup.scene.screen
        half = np.array(screen.pixels) * screen.pitch_xy_mm / 2
        x, y = (design.places_mm - np.array(screen.centre_offset_mm)[:, None]) / half[:, None]
        one, none = np.ones_like(x), np.zeros_like(x)
        value, by_x, by_y = {
            "x": (x, one, none),
            "y": (y, none, one),
            "xx": (x * x, 2 * x, none),
            "xy": (x * y, y, x),
            "yy": (y * y, none, 2 * y),
        }[self.term]
        return np.stack([by_x / half[0], by_y / half[1]]), value
