"""The mirror's surface in float64 on the host: sag, slopes and where lines meet it. Mirror frame, mm.

The device kernels have their own single-precision versions (kernels/mirror/surface_*.cl, kernels/mirror/mirror_*.cl).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.optics.departure import Departure, design_departures, deviations
from irtscots_cl.system import interruption

if TYPE_CHECKING:
    from irtscots_cl.optics.outline import Outline

BEYOND = 1.02  # radius in those of the deviations' disk: from there, beyond any mirror, they count for 0
MAX_STEPS = 50  # from the quadric to the surface; each is shorter by the departure's slope times the ray's
NEAR_MM = 1e-9  # a last step shorter than that leaves far less: slopes of surfaces are small

Guess = Callable[[np.ndarray, np.ndarray], np.ndarray]

# polynomials overflow far outside the mirror; a ray parallel to z = 0 has no point there
_BESIDE = np.errstate(over="ignore", invalid="ignore", divide="ignore")


@dataclass(frozen=True)
class Surface:
    """A quadric plus departures along z, inside a circular or annular aperture.

    design: departures of the design; deviation: those of the mirror as made from its design. outline: what the aperture
    is limited to, of a mirror that is no whole disk.
    """

    quadric: Quadric
    aperture_radius_mm: float
    obscuration_radius_mm: float = 0.0
    design: tuple[Departure, ...] = ()
    deviation: tuple[Departure, ...] = ()
    outline: Outline | None = None

    @classmethod
    def of(cls, mirror) -> Surface:
        """Surface of a scene's mirror (irtscots_cl.scene.Mirror)."""
        return cls(
            Quadric.conic(mirror.radius_mm, mirror.conic, mirror.off_axis_mm),
            mirror.diameter_mm / 2,
            mirror.obscuration_mm / 2,
            design_departures(mirror),
            deviations(mirror),
            _outline(mirror),
        )

    @property
    def departures(self) -> tuple[Departure, ...]:
        """All that is added to the quadric."""
        return self.design + self.deviation

    @property
    def departure_radius_mm(self) -> float:
        """Radius [mm] within which all departures are defined; inf without any."""
        return min((departure.radius_mm for departure in self.departures), default=math.inf)

    def contains(self, x_mm, y_mm, margin_mm: float = 0.0) -> np.ndarray:
        """Whether points lie in the aperture, widened by margin_mm at its rim and at the hole's."""
        radius = np.hypot(x_mm, y_mm)
        on = (radius <= self.aperture_radius_mm + margin_mm) & (radius >= self.obscuration_radius_mm - margin_mm)
        return on if self.outline is None else on & self.outline.contains(x_mm, y_mm, margin_mm)

    def depth(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distance [mm] of points from the aperture's edge, above 0 inside, and the direction (x, y) in which it grows.

        See Outline.depth for where it may be too small.
        """
        radius = np.hypot(x_mm, y_mm)
        with np.errstate(invalid="ignore", divide="ignore"):
            out_x, out_y = np.nan_to_num(x_mm / radius), np.nan_to_num(y_mm / radius)
        depth, toward_x, toward_y = self.aperture_radius_mm - radius, -out_x, -out_y
        others = [(radius - self.obscuration_radius_mm, out_x, out_y)] if self.obscuration_radius_mm > 0 else []
        others += [] if self.outline is None else [self.outline.depth(x_mm, y_mm)]
        for other, other_x, other_y in others:
            less = other < depth
            depth = np.where(less, other, depth)
            toward_x, toward_y = np.where(less, other_x, toward_x), np.where(less, other_y, toward_y)
        return depth, toward_x, toward_y

    def deviation_at(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Deviation from the design [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        return _sum(self.deviation, x_mm, y_mm)

    def departure_at(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Height above the quadric [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        return _sum(self.departures, x_mm, y_mm)

    def sag(self, x_mm, y_mm) -> np.ndarray:
        """Height of the surface above z = 0 [mm]."""
        return self.quadric.meet(x_mm, y_mm, 0.0, 0.0) + self.departure_at(x_mm, y_mm)[0]

    def gradient(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray]:
        """Slopes dz/dx, dz/dy of the surface."""
        return self._gradient(x_mm, y_mm, *self.departure_at(x_mm, y_mm)[1:])

    def _gradient(self, x_mm, y_mm, slope_x, slope_y) -> tuple[np.ndarray, np.ndarray]:
        """The same, where the departures' slopes are there already."""
        design = self.quadric.gradient(x_mm, y_mm, self.quadric.meet(x_mm, y_mm, 0.0, 0.0))
        return design[0] + slope_x, design[1] + slope_y

    def _defined(self, x_mm, y_mm) -> np.ndarray:
        """Where polynomials that grow fast outside their disk are used."""
        return np.hypot(x_mm, y_mm) <= BEYOND * self.departure_radius_mm

    @_BESIDE
    def meet(
        self, points_mm, directions, newton_steps: int | None = None, guess: Guess | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Follow rays from world points [..., 3] along directions [..., 3] to the surface.

        newton_steps: from the quadric to the surface; None for as many as it takes. guess: from (x, y) to the height
        above the quadric from which they set out for a design that departs from it; None: 0.
        Returns the points [..., 3] (NaN where a ray misses the surface; the aperture is ignored) and the
        directions after reflection [..., 3] (not normalised).
        """
        p, q = directions[..., 0] / directions[..., 2], directions[..., 1] / directions[..., 2]
        x0, y0 = points_mm[..., 0] - points_mm[..., 2] * p, points_mm[..., 1] - points_mm[..., 2] * q
        base = z = self.quadric.meet(x0, y0, p, q)
        x, y = x0 + p * z, y0 + q * z
        interruption.check()  # maps of a large detector take seconds
        slopes = None
        if self.departures:
            steps, until_near = MAX_STEPS if newton_steps is None else newton_steps, newton_steps is None
            if self.design:
                start = np.zeros_like(z) if guess is None else guess(x, y)
                z = self._follow_design(x0, y0, p, q, base, start, steps, until_near)
            elif until_near:
                z, slopes = self._onto_deviation(x0, y0, p, q, base)
            else:
                z = self._follow_deviation(x0, y0, p, q, base, steps)
            x, y = x0 + p * z, y0 + q * z
        slope_x, slope_y = self.gradient(x, y) if slopes is None else self._gradient(x, y, *slopes)
        interruption.check()
        length = np.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
        normal = -slope_x / length, -slope_y / length, 1.0 / length
        interruption.check()
        along = [directions[..., axis] * part for axis, part in enumerate(normal)]
        twice = 2.0 * (along[0] + along[1] + along[2])
        outgoing = np.empty(directions.shape)
        for axis, part in enumerate(normal):
            np.subtract(directions[..., axis], twice * part, out=outgoing[..., axis])
        return np.stack([x, y, z], -1), outgoing

    def _onto_deviation(self, x0, y0, p, q, base) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """Height z where lines (x0 + p z, y0 + q z, z) that meet the quadric at z = base meet the surface, and the
        slopes of the departures there.

        For slight departures: the quadric is as good as level over the way. Newton's method; the slopes are those at
        the last point but one, which is NEAR_MM away at most.
        """
        z, x, y = base, x0 + p * base, y0 + q * base
        quadric_x, quadric_y = self.quadric.gradient(x, y, z)
        level, defined = 1.0 - p * quadric_x - q * quadric_y, self._defined(x, y)
        for _ in range(MAX_STEPS):
            height, slope_x, slope_y = self.departure_at(x, y)
            left = (z - base) * level - np.where(defined, height, 0.0)
            step = left / (level - np.where(defined, p * slope_x + q * slope_y, 0.0))
            z = z - step
            x, y = x0 + p * z, y0 + q * z
            interruption.check()
            if not np.any(np.abs(step) > NEAR_MM):
                break
        return z, (slope_x, slope_y)

    def _follow_deviation(self, x0, y0, p, q, base, steps: int) -> np.ndarray:
        """The same in so many steps, as approach_slight.cl has them."""
        z, x, y = base, x0 + p * base, y0 + q * base
        slope_x, slope_y = self.quadric.gradient(x, y, z)
        defined = self._defined(x, y)
        for _ in range(steps):
            height = np.where(defined, self.departure_at(x, y)[0], 0.0)
            z = base + height / (1.0 - p * slope_x - q * slope_y)
            x, y = x0 + p * z, y0 + q * z
            interruption.check()
        return z

    def _follow_design(self, x0, y0, p, q, base, start, steps: int, until_near: bool) -> np.ndarray:
        """The same for departures of any size: Newton's method, with the quadric's bend, as approach_exact.cl has it.

        Of a point d from the line's point of the quadric, with the height h, the surface is where
        n . d' = d' . B d' / 2, d' = d - (0, 0, h), for the quadric's normal n at that point and its form B. start:
        the height from which to set out.
        """
        form, x, y = self.quadric, x0 + p * base, y0 + q * base
        across, along, up = form.q_xx * x + form.q_xz * base, form.q_yy * y, 1 - form.q_zz * base - form.q_xz * x
        dz = start * up / (up - across * p - along * q)
        x, y = x0 + p * (base + dz), y0 + q * (base + dz)
        for _ in range(steps):
            height, slope_x, slope_y = self._departure_near(x, y)
            dx, dy, du = p * dz, q * dz, dz - height
            bend_x, bend_y, bend_z = form.q_xx * dx + form.q_xz * du, form.q_yy * dy, form.q_zz * du + form.q_xz * dx
            left = -(across + bend_x / 2) * dx - (along + bend_y / 2) * dy + (up - bend_z / 2) * du
            rise = (up - bend_z) * (1 - p * slope_x - q * slope_y) - (across + bend_x) * p - (along + bend_y) * q
            step = left / rise
            dz = dz - step
            x, y = x0 + p * (base + dz), y0 + q * (base + dz)
            interruption.check()
            if until_near and not np.any(np.abs(step) > NEAR_MM):
                break
        return base + dz

    def _departure_near(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As departure_at, with deviations only where they are defined."""
        total = _sum(self.design, x_mm, y_mm)
        if not self.deviation:
            return total
        defined, more = self._defined(x_mm, y_mm), _sum(self.deviation, x_mm, y_mm)
        height, slope_x, slope_y = (a + np.where(defined, b, 0.0) for a, b in zip(total, more, strict=True))
        return height, slope_x, slope_y


def _outline(mirror) -> Outline | None:
    if mirror.outline is None:
        return None
    from irtscots_cl.optics.outline import Outline  # imported late: few mirrors are no disks

    return Outline.of(mirror)


@_BESIDE
def _sum(departures: Iterable[Departure], x_mm, y_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The sum of departures' heights [mm] and slopes at points of any one shape."""
    height = slope_x = slope_y = np.zeros(np.broadcast_shapes(np.shape(x_mm), np.shape(y_mm)))
    for departure in departures:
        more = departure.at(x_mm, y_mm)
        height, slope_x, slope_y = height + more[0], slope_x + more[1], slope_y + more[2]
    return height, slope_x, slope_y
