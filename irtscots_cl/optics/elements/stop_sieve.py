"""Light of the screen that ends at the camera's stop or beside it: most rays of a test, and none need be followed.

Where the elements leave it no other way, a ray that meets the mirror goes on to the plane of the stop, and ends there
unless it passes the aperture or its rim. The kernels then look with the plain conic where rays cross that plane, and
follow only those element by element of which that does not tell the end. The limits leave room for rounding and for
what the mirror's departures turn aside, so no sum changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.elements.components import COPLANAR, Component
from irtscots_cl.optics.elements.extent import depths, radius_about_vertex
from irtscots_cl.optics.elements.first_hits import (
    ALL,
    MIN_ANGLE,
    MIN_COSINE,
    cosines,
    emission_bounds,
    mirror_points,
)
from irtscots_cl.optics.surface import Surface

ROUNDING = 8  # relative errors of the arithmetic, in a place that is found over a path's length; a quarter was enough
BETWEEN = 2.0  # a departure's largest slope and height, over those at the points of its spread
STEEPEST = 1.0  # slope against the camera's axis of rays that are known to pass beside everything
CLEAR = 1e-3  # relative distance of the mirror from the stop's plane
NOWHERE = -1.0  # below every square of a radius


@dataclass(frozen=True)
class StopSieve:
    """Squares of radii [mm^2] on the mirror and in the stop's plane, and of slopes there.

    mirror_least2 ... mirror_most2: on the mirror for sure; below hole2 and above rim2: beside it. stop_least2 ...
    stop_most2: on the stop. Beyond beside2, with slopes below slope2, and where rays run away from the plane: beside
    everything. stop: the stop's number.
    """

    mirror_least2: float
    mirror_most2: float
    hole2: float
    rim2: float
    stop_least2: float
    stop_most2: float
    beside2: float
    slope2: float
    stop: int


def stop_sieve(
    surface: Surface,
    components: tuple[Component, ...],
    screen: Frame,
    sources: np.ndarray,
    pitch_xy_mm: tuple[float, float],
    may: tuple[int, int],
    epsilon: float,
) -> StopSieve | None:
    """The limits; None where rays may go another way.

    may: of may_meet, with the same arguments; epsilon: relative rounding error of the kernels' reals.
    """
    mirror, stop, *others = components
    if may != (1, ALL & ~1) or stop.name != "stop":
        return None
    starts, directions = emission_bounds(screen, sources, pitch_xy_mm)
    points, normals = mirror_points(mirror)
    falls = directions[:, 2].max() < -MIN_COSINE and starts[:, 2].min() > max(points[:, 2].max(), 0.0)
    incidence = cosines(points, normals, starts).min()
    if not falls or incidence < np.sin(MIN_ANGLE) or not _parts(mirror, stop, others):
        return None
    to_mirror = max(np.linalg.norm(points - start, axis=-1).max() for start in starts)
    at_mirror = ROUNDING * epsilon * to_mirror / incidence
    at_stop = _error(surface, points, stop, ROUNDING * epsilon * to_mirror, ROUNDING * epsilon)
    limits = _limits(stop, others, at_mirror, at_stop)
    inner, outer = mirror.inner_mm, mirror.outer_mm
    if outer <= at_mirror or stop.outer_mm - stop.inner_mm <= 2 * at_stop:
        return None
    hole = inner > 0
    return StopSieve(
        (inner + at_mirror) ** 2 if hole else NOWHERE,
        (outer - at_mirror) ** 2,
        max(inner - at_mirror, 0.0) ** 2 if hole else NOWHERE,
        (outer + at_mirror) ** 2,
        *limits,
        1,
    )


def _parts(mirror: Component, stop: Component, others: list[Component]) -> bool:
    """Whether the stop's plane parts the mirror from all other elements."""
    centre, axis = stop.frame.position_mm, stop.frame.axes[2]
    size = float(np.abs(centre).max()) + mirror.outer_mm
    behind = all(depths(other, centre, axis)[0] >= -COPLANAR * size for other in others)
    return behind and depths(mirror, centre, axis)[1] < -CLEAR * size


def _error(surface: Surface, points: np.ndarray, stop: Component, before_mm: float, relative: float) -> float:
    """Bound [mm] of how far from its place on the conic's way a ray may cross the stop's plane.

    before_mm: error of a place on the mirror; relative: of a length.
    """
    to = stop.frame.position_mm - points
    deep = to @ stop.frame.axes[2]
    length = float(np.linalg.norm(to, axis=-1).max())
    slope = (np.sqrt(np.maximum(np.sum(to * to, -1) - deep**2, 0.0)) + stop.outer_mm) / deep
    growth = 1 + float(slope.max()) ** 2
    error = before_mm + relative * length
    if surface.departures:
        spread = [departure.spread(surface.aperture_radius_mm) for departure in surface.departures]
        height, *slopes = surface.departure_at(*(np.concatenate(axis) for axis in zip(*spread, strict=True)))
        turn, high = BETWEEN * np.hypot(*slopes).max(), BETWEEN * np.abs(height).max()
        error += 2 * turn * length + 8 * high
    return growth * error


def _limits(stop: Component, others: list[Component], at_mirror: float, at_stop: float) -> tuple[float, ...]:
    """From stop_least2 to slope2."""
    centre, axis = stop.frame.position_mm, stop.frame.axes[2]
    beside, deep = stop.outer_mm + 4 * at_stop, 0.0
    reach = 0.0
    for other in others:
        off = other.frame.position_mm - centre
        reach = max(reach, float(np.linalg.norm(np.cross(off, axis))) + radius_about_vertex(other))
        deep = max(deep, depths(other, centre, axis)[1])
    slope = min(STEEPEST, 0.9 * (stop.outer_mm - reach) / deep) if deep > 0 else STEEPEST
    return ((stop.inner_mm + at_stop) ** 2, (stop.outer_mm - at_stop) ** 2, beside**2,
            slope**2 if slope > 0 else NOWHERE)  # fmt: skip
