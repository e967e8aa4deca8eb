"""Polynomials in x and y as departures of a surface from its quadric. Unit: mm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.xy_polynomials import ChebyshevSeries, series_of, sum_of
from irtscots_cl.optics.departure import polar_points

if TYPE_CHECKING:
    from irtscots_cl.scene.mirror import Mirror


@dataclass(frozen=True)
class PolynomialDeparture:
    """A Chebyshev series in mm over a rectangle that covers the mirror."""

    series: ChebyshevSeries

    @property
    def radius_mm(self) -> float:
        """Radius [mm] of the disk about the origin that the rectangle holds."""
        return min(h - abs(c) for c, h in zip(self.series.centre_mm, self.series.half_size_mm, strict=True))

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        return self.series.at(x_mm, y_mm)

    def spread(self, aperture_radius_mm: float) -> tuple[FloatArray, FloatArray]:
        """Points (x, y) [n] of the mirror, close enough to find the extremes of the slopes; many on the rim."""
        return polar_points(aperture_radius_mm, 2 * sum(self.series.coefficient.shape) + 16)


def polynomials(mirror: Mirror, part: str) -> tuple[PolynomialDeparture, ...]:
    """The sum of the mirror's polynomial tables of one part, "design" or "deviation", if it is not 0."""
    rim_mm = mirror.diameter_mm / 2
    found = [
        series_of(table.basis, table.terms_mm(rim_mm), table.centre_mm, table.rectangle_mm(rim_mm))
        for table in mirror.polynomial
        if table.part == part
    ]
    total = sum_of(found) if found else None
    return () if total is None or not np.any(total.coefficient) else (PolynomialDeparture(total),)
