"""How far a surface lies above its quadric, along z: what each kind of departure gives, and Zernike terms. Unit: mm."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.zernike.evaluation import SeriesEvaluation
from irtscots_cl.maths.zernike.indices import index_to_nm
from irtscots_cl.maths.zernike.series import RadialSeries, joined_series, radial_series

if TYPE_CHECKING:
    from irtscots_cl.scene.mirror import Mirror

RINGS = 16  # of the points that find a departure's extremes


class Departure(Protocol):
    """Heights along z that are added to a quadric.

    radius_mm: the mirror's points lie within it; from 2 % outside, rays take a deviation's height for 0.
    """

    @property
    def radius_mm(self) -> float: ...

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape."""

    def spread(self, aperture_radius_mm: float) -> tuple[FloatArray, FloatArray]:
        """Points (x, y) [n] of the mirror, close enough to find the extremes of the slopes; many on the rim."""


@dataclass(frozen=True)
class ZernikeDeparture:
    """Zernike terms in mm over the disk of radius_mm."""

    series: RadialSeries = field(repr=False)
    radius_mm: float

    @cached_property
    def _evaluation(self) -> SeriesEvaluation:
        return SeriesEvaluation(self.series)

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        scale = 1.0 / self.radius_mm
        height, slope_x, slope_y = self._evaluation.at(x_mm * scale, y_mm * scale)
        return height, slope_x * scale, slope_y * scale

    def spread(self, aperture_radius_mm: float) -> tuple[FloatArray, FloatArray]:
        """Points (x, y) [n] of the mirror, close enough to find the extremes of the slopes; many on the rim."""
        return polar_points(aperture_radius_mm, 2 * int(self.series.m.max()) + 16)


def polar_points(radius_mm: float, angles: int) -> tuple[FloatArray, FloatArray]:
    """Points (x, y) [n] on rings of equal areas, the largest of radius_mm."""
    radius = radius_mm * np.sqrt((np.arange(RINGS) + 1) / RINGS)
    angle = np.arange(angles) * (2 * np.pi / angles)
    return np.outer(radius, np.cos(angle)).ravel(), np.outer(radius, np.sin(angle)).ravel()


def design_departures(mirror: Mirror) -> tuple[Departure, ...]:
    """What the design of a scene's mirror adds to its conic."""
    if mirror.asphere is None:
        return _polynomials(mirror, "design")
    from irtscots_cl.optics.asphere import asphere_departure  # imported late: few mirrors have such terms

    return (asphere_departure(mirror), *_polynomials(mirror, "design"))


def deviations(mirror: Mirror) -> tuple[Departure, ...]:
    """How a scene's mirror as made deviates from its design."""
    return (*_zernike(mirror), *_polynomials(mirror, "deviation"), *_maps(mirror))


def _polynomials(mirror: Mirror, part: str) -> tuple[Departure, ...]:
    """The polynomials of one part, "design" or "deviation"."""
    if not mirror.polynomial:
        return ()
    from irtscots_cl.optics.polynomial import polynomials  # imported late: few scenes have any

    return polynomials(mirror, part)


def _maps(mirror: Mirror) -> tuple[Departure, ...]:
    """The sum of the mirror's height maps, if it has any."""
    if not mirror.map:
        return ()
    from irtscots_cl.optics.height_map import map_departure  # imported late: few mirrors have a map

    return (map_departure(mirror),)


def _zernike(mirror: Mirror) -> tuple[Departure, ...]:
    """The sum of the mirror's Zernike tables, if it is not 0, on the smallest of their disks."""
    sets: dict[tuple[float, float], dict[tuple[int, int], float]] = {}  # by radius and obscuration
    for terms in mirror.zernike:
        coefficients = sets.setdefault((terms.radius_mm, terms.obscuration), {})
        for index, value_um in terms.coefficients_um.items():
            nm = index_to_nm(index, terms.ordering)
            coefficients[nm] = coefficients.get(nm, 0.0) + value_um * 1e-3
    given = {key: {nm: value for nm, value in terms.items() if value != 0} for key, terms in sets.items()}
    given = {key: terms for key, terms in given.items() if terms}
    if not given:
        return ()
    least = min(radius for radius, _ in given)
    parts = [radial_series(terms, ratio, radius / least) for (radius, ratio), terms in given.items()]
    return (ZernikeDeparture(joined_series(parts), least),)
