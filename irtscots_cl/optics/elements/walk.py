"""Light from element to element in the order in which it meets them, in float64 on the host. World frame, mm.

The kernels do this for all rays of a trace; here a few rays tell what a trace must be prepared for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.sequential_rays import GHOST, NOMINAL, interact, quadric_form, surface_normal

NEAR = 1e-9  # relative to the distances: a surface so near behind a ray touches the one that it stands on


@dataclass(frozen=True)
class Visit:
    """What one step has done to the rays that met an element.

    rays: their numbers [n]; numbers: of the elements [n]; points, along, normals, goes [n, 3]: where, the direction
    before, the unit normal towards the front, and the direction after, NaN if the ray ends there.
    """

    rays: np.ndarray
    numbers: np.ndarray
    points: np.ndarray
    along: np.ndarray
    normals: np.ndarray
    goes: np.ndarray


Choose = Callable[[int, np.ndarray], np.ndarray]


def walk(
    components: tuple[Component, ...],
    points_mm: np.ndarray,
    directions: np.ndarray,
    steps: int,
    *,
    last: int = -1,
    reflects: Choose | None = None,
    passes: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> Iterator[Visit]:
    """Follow rays from points_mm along unit directions [n, 3] for at most `steps` elements, one Visit for each step.

    Elements do the intended: mirrors reflect, refractors and lenses pass light on, absorbers and detectors end it.
    last: the element that the rays stand on. reflects(step, rays [k]): which rays a refractor reflects instead.
    passes(points, directions, distances to the next element): which rays [k] end before they reach it.
    """
    rays, at, along = np.arange(len(points_mm)), np.array(points_mm, float), np.array(directions, float)
    stands = np.full(len(rays), last)
    for step in range(steps):
        nearest, numbers = _nearest(components, at, along, stands)
        goes_on = numbers >= 0
        if passes is not None:
            goes_on &= ~passes(at, along, nearest)
        rays, at, along, nearest, numbers = (a[goes_on] for a in (rays, at, along, nearest, numbers))
        if not len(rays):
            return
        at = at + nearest[:, None] * along
        reflected = np.zeros(len(rays), bool) if reflects is None else reflects(step, rays)
        normals, goes = np.zeros_like(at), np.full_like(at, np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):
            for number in np.unique(numbers):
                here = np.flatnonzero(numbers == number)
                normals[here], goes[here] = _event(components[number], at[here], along[here], reflected[here])
        yield Visit(rays, numbers, at, along, normals, goes)
        left = np.isfinite(goes[:, 0])
        rays, at, along, stands = rays[left], at[left], goes[left], numbers[left]


def _event(component: Component, at, along, reflected) -> tuple[np.ndarray, np.ndarray]:
    """Normals and directions afterwards [n, 3], in the world, of rays at an element. reflected: where it refracts."""
    axes = component.frame.axes
    local, way = (at - component.frame.position_mm) @ axes.T, along @ axes.T
    goes = np.full_like(way, np.nan)
    if component.refracts:
        goes = interact(component, NOMINAL, local, way)
        mirrored = interact(component, GHOST, local, way)
        goes = np.where((reflected | np.isnan(goes[:, 0]))[:, None], mirrored, goes)  # NaN: total reflection
    elif component.kind in ("mirror", "lens"):
        goes = interact(component, NOMINAL, local, way)
    return surface_normal(component, local) @ axes, goes @ axes


def _nearest(components, at, along, stands) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the nearest element [n] and its number, -1 for none."""
    nearest, which = np.full(len(at), np.inf), np.full(len(at), -1)
    for number, component in enumerate(components):
        distance = distance_to(component, at, along, stands == number)
        closer = distance < nearest
        nearest[closer], which[closer] = distance[closer], number
    return nearest, which


def distance_to(component: Component, at: np.ndarray, along: np.ndarray, stands: np.ndarray) -> np.ndarray:
    """Distance [n] along unit directions to an element within its aperture, infinite if it is not met.

    stands: rays that start on it, which meet only another part of it.
    """
    frame = component.frame
    local, way = (at - frame.position_mm) @ frame.axes.T, along @ frame.axes.T
    q = component.quadric
    back = np.where(stands, 0.0, -np.sum(local * way, -1))
    base = local + back[:, None] * way
    a, b = quadric_form(q, way, way), quadric_form(q, base, way) - way[:, 2]
    c = np.where(stands, 0.0, quadric_form(q, base, base) - 2 * base[:, 2])
    with np.errstate(invalid="ignore", divide="ignore"):
        larger = np.where(b < 0, 1.0, -1.0) * np.sqrt(b * b - a * c) - b
        best = np.full(len(at), np.inf)
        for root in (np.where(stands, np.nan, c / larger), larger / a):
            point, distance = base + root[:, None] * way, back + root
            u, v = point[:, 0], point[:, 1]
            radius = np.hypot(u, v)
            inside = (radius <= component.outer_mm) & (radius >= component.inner_mm)
            inside &= (np.abs(u) <= component.half_mm[0]) & (np.abs(v) <= component.half_mm[1])
            inside &= q.q_zz * point[:, 2] + q.q_xz * point[:, 0] < 1
            ahead = distance > NEAR * (1 + np.linalg.norm(local, axis=-1))
            best = np.where(inside & ahead & (distance < best), distance, best)
    return best
