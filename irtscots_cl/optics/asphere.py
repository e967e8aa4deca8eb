"""Aspheric terms of a mirror's design as a departure from its quadric, on the parent's axis and off it. Unit: mm.

The terms belong to the parent (scene/asphere.py has the sag equation). A segment off the axis has its frame on the true
surface: the origin is its point at off_axis_mm from the axis, +Z its normal there, terms included. Its quadric is the
conic moved, without bending it, so that its point at off_axis_mm touches the surface there. So a segment's departure is
0 at its centre and level there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.optics.departure import Departure, polar_points
from irtscots_cl.scene.validation import SceneError

if TYPE_CHECKING:
    from irtscots_cl.scene.mirror import Mirror

BEYOND_RIM = 1.02  # radius of the series in those of the mirror's far edge; farther out the profile goes on straight
MAX_DEGREE = 96  # of the series; only Qbfs terms are no polynomials
SERIES_LOSS = 1e-14  # relative to the largest value
CHECK_POINTS = 301
ANGLES = 32  # of the points that find a departure's extremes
MAX_STEPS = 50
NEAR_MM = 1e-10  # Newton's last step: the next would be its square over a radius


@dataclass(frozen=True)
class Profile:
    """A rotationally symmetric height h = s g, s = (r / scale_mm)^2, from s = 1 on along its tangent.

    series: Chebyshev coefficients of g [mm] in t = 2 s - 1 if it is even, else in t = 2 sqrt(s) - 1.
    """

    series: FloatArray = field(repr=False)
    scale_mm: float
    even: bool

    @classmethod
    def of(cls, mirror: Mirror) -> Profile:
        """Of the aspheric terms of a scene's mirror."""
        terms = mirror.asphere
        rim = mirror.off_axis_mm + mirror.diameter_mm / 2
        scale, even = BEYOND_RIM * rim, terms.is_even
        if terms.q_bfs_um is not None:  # of a sphere, which ends
            scale = min(scale, (rim + abs(mirror.radius_mm)) / 2)

        def over_square(t: FloatArray) -> FloatArray:
            rho = np.sqrt((t + 1) / 2) if even else (t + 1) / 2
            return scale**2 * np.array([terms.over_square(r, mirror.radius_mm) for r in (scale * rho).tolist()])

        return cls(_series(over_square, terms.degree // (1 + even)), scale, even)

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        x, y = x_mm / self.scale_mm, y_mm / self.scale_mm
        square = x * x + y * y
        s = np.minimum(square, 1.0)
        rho = np.sqrt(s)
        t = 2 * s - 1 if self.even else 2 * rho - 1
        g, g_t = chebyshev.chebval(t, self.series), chebyshev.chebval(t, chebyshev.chebder(self.series))
        over = 2 * g + (4 * s if self.even else 2 * rho) * g_t  # slope by rho, over rho
        beyond = np.sqrt(np.maximum(square, 1.0))
        height = s * g + rho * over * (beyond - 1)
        slope = over / (beyond * self.scale_mm)
        return height, slope * x, slope * y


def _series(function: Callable[[FloatArray], FloatArray], degree: int) -> FloatArray:
    """Chebyshev coefficients of a smooth function on [-1, 1], of a polynomial of that degree or near one.

    Raises SceneError for a function that is not smooth enough.
    """
    points = np.cos(np.arange(CHECK_POINTS) * (np.pi / (CHECK_POINTS - 1)))
    right = function(points)
    while degree <= MAX_DEGREE:
        found: FloatArray = chebyshev.chebinterpolate(function, degree)
        if np.abs(chebyshev.chebval(points, found) - right).max() <= SERIES_LOSS * np.abs(right).max():
            return found
        degree += 4
    must = "have its mirror farther from the edge of the best-fit sphere"
    raise SceneError(f"mirror.asphere.q_bfs_um: must {must}: the terms are too steep there")


@dataclass(frozen=True)
class AsphereDeparture:
    """A profile about the mirror's own axis. radius_mm: of the mirror."""

    profile: Profile
    radius_mm: float

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        return self.profile.at(x_mm, y_mm)

    def spread(self, aperture_radius_mm: float) -> tuple[FloatArray, FloatArray]:
        """Points (x, y) [n] of the mirror, close enough to find the extremes of the slopes; many on the rim."""
        return polar_points(aperture_radius_mm, ANGLES)


@dataclass(frozen=True)
class SegmentDeparture:
    """A segment of an aspheric parent above the moved conic, along the segment's z.

    parent, profile: the parent's conic and terms; segment: the moved conic. place_mm, tilt: of the segment's frame in
    the parent's: its origin (x, z), and the angle from the parent's axis to its own.
    """

    parent: Quadric
    profile: Profile
    segment: Quadric
    place_mm: tuple[float, float]
    tilt: float
    radius_mm: float

    @classmethod
    def of(cls, mirror: Mirror, profile: Profile) -> SegmentDeparture:
        """Of a scene's mirror off its parent's axis."""
        parent, centre = Quadric.conic(mirror.radius_mm, mirror.conic), np.array([mirror.off_axis_mm])
        height, slope, _ = profile.at(centre, np.zeros(1))
        sag = parent.meet(centre, 0.0, 0.0, 0.0)
        slope = slope + parent.gradient(centre, np.zeros(1), sag)[0]
        return cls(
            parent,
            profile,
            Quadric.conic(mirror.radius_mm, mirror.conic, mirror.off_axis_mm),
            (mirror.off_axis_mm, float((sag + height)[0])),
            float(np.arctan(slope[0])),
            mirror.diameter_mm / 2,
        )

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape; NaN where a conic has ended."""
        x, y = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(y_mm, float))
        base = z = self.segment.meet(x, y, 0.0, 0.0)
        for _ in range(MAX_STEPS):
            left, _, gradient_z, _ = self._implicit(x, y, z)
            step = left / gradient_z
            z = z - step
            if not np.any(np.abs(step) > NEAR_MM):
                break
        _, gradient_x, gradient_z, gradient_y = self._implicit(x, y, z)
        slope_x, slope_y = self.segment.gradient(x, y, base)
        return z - base, -gradient_x / gradient_z - slope_x, -gradient_y / gradient_z - slope_y

    def spread(self, aperture_radius_mm: float) -> tuple[FloatArray, FloatArray]:
        """Points (x, y) [n] of the mirror, close enough to find the extremes of the slopes; many on the rim."""
        return polar_points(aperture_radius_mm, ANGLES)

    def _implicit(self, x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, ...]:
        """A function that is 0 on the surface, and its derivatives by x, z and y, at points of the segment's frame."""
        cosine, sine, q = np.cos(self.tilt), np.sin(self.tilt), self.parent
        across, up = self.place_mm[0] + cosine * x - sine * z, self.place_mm[1] + sine * x + cosine * z
        height, slope_x, slope_y = self.profile.at(across, y)
        u = up - height
        value = u - (q.q_xx * across * across + q.q_yy * y * y + q.q_zz * u * u) / 2
        rise = 1 - q.q_zz * u
        by_across, by_y = -q.q_xx * across - rise * slope_x, -q.q_yy * y - rise * slope_y
        return value, cosine * by_across + sine * rise, cosine * rise - sine * by_across, by_y


def asphere_departure(mirror: Mirror) -> Departure:
    """The departure of a scene's mirror with aspheric terms."""
    profile = Profile.of(mirror)
    if mirror.off_axis_mm > 0:
        return SegmentDeparture.of(mirror, profile)
    return AsphereDeparture(profile, mirror.diameter_mm / 2)
