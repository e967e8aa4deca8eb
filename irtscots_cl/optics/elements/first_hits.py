"""The elements that rays can meet in their first steps. The kernels do not test the others.

All bounds hold for the whole screen and the whole emission, with margins far above the errors of the bounds.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.extent import radius_about_vertex

MIN_COSINE = 0.05  # between rays and the normal of a plane that they run away from
MIN_ANGLE = np.radians(5.0)  # between the mirror's reflected light and directions that could meet it again
NEAR = 1e-6  # relative distance below which rays that start near a plane may meet it
RINGS, SPOKES = 3, 32  # of points on the mirror
TURNS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)  # of planes between rays and a curved element, from across the rays
ALL = 0xFFFFFFFF


def may_meet(
    components: tuple[Component, ...], screen: Frame, sources: np.ndarray, pitch_xy_mm: tuple[float, float]
) -> tuple[int, int]:
    """Bits of the elements that rays may meet first, and second.

    sources: structs.emitter_dtype. components[0] is the mirror. pitch_xy_mm: of the screen.
    """
    starts, directions = emission_bounds(screen, sources, pitch_xy_mm)
    first = [number for number, component in enumerate(components) if not _is_clear(component, starts, directions)]
    bits = sum(1 << number for number in first)
    second = ALL
    if first == [0] and components[0].scatter is None and not _meets_again(components[0], starts):
        second = ALL & ~1
    return bits, second


def emission_bounds(
    screen: Frame, sources: np.ndarray, pitch_xy_mm: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Corners [4, 3] of the screen, and directions [n, 3] whose cone contains all rays; none if it is too wide."""
    centres = (sources[axis].astype(float) for axis in ("x", "y"))
    rim_u, rim_v = (
        np.array([c.min() - pitch / 2, c.max() + pitch / 2]) for c, pitch in zip(centres, pitch_xy_mm, strict=True)
    )
    corners = np.stack(np.meshgrid(rim_u, rim_v), -1).reshape(-1, 2)
    half_l = np.abs(sources["aim_ll"]).astype(float)
    half_m = np.hypot(sources["aim_ml"], sources["aim_mm"]).astype(float)
    l = np.linspace((sources["centre_l"] - half_l).min(), (sources["centre_l"] + half_l).max(), 5)
    m = np.linspace((sources["centre_m"] - half_m).min(), (sources["centre_m"] + half_m).max(), 5)
    l, m = (grid.ravel() for grid in np.meshgrid(l, m))
    left = 1 - l * l - m * m
    if left.min() <= 0:
        return screen.to_world(*corners.T), np.zeros((0, 3))
    return screen.to_world(*corners.T), np.stack([l, m, -np.sqrt(left)], -1) @ screen.axes


def _is_clear(component: Component, starts: np.ndarray, directions: np.ndarray) -> bool:
    """Whether no ray meets a component; False if that cannot be told."""
    if not len(directions):
        return False
    return _leaves_behind(component, starts, directions) if component.shape == "plane" else (
        _is_beside(component, starts, directions))  # fmt: skip


def _leaves_behind(component: Component, starts: np.ndarray, directions: np.ndarray) -> bool:
    """Whether a plane component lies behind all rays: they start on one side of it and all run away from it."""
    away = (starts - component.frame.position_mm) @ component.frame.axes[2]
    side = np.sign(away[0])
    size = np.abs(starts).max() + np.abs(component.frame.position_mm).max()
    return bool(np.all(side * away > NEAR * size) and np.all(side * directions @ component.frame.axes[2] > MIN_COSINE))


def _is_beside(component: Component, starts: np.ndarray, directions: np.ndarray) -> bool:
    """Whether a plane parts a curved component from all rays: they start beyond it and all run away from it."""
    centre, radius = component.frame.position_mm, radius_about_vertex(component)
    middle, aside = directions.mean(0), starts.mean(0) - centre
    size = np.abs(starts).max() + np.abs(centre).max()
    for turn in TURNS:
        normal = middle / np.linalg.norm(middle) + turn * aside / max(float(np.linalg.norm(aside)), NEAR * size)
        normal /= np.linalg.norm(normal)
        beyond = np.min((starts - centre) @ normal) > radius + NEAR * size
        if beyond and np.min(directions @ normal) > MIN_COSINE:
            return True
    return False


def _meets_again(mirror: Component, starts: np.ndarray) -> bool:
    """Whether reflected light from the screen could meet the mirror again, by the angles with its normals."""
    points, normals = mirror_points(mirror)
    largest = np.arccos(cosines(points, normals, starts).min())
    with np.errstate(invalid="ignore"):  # for a point and itself
        again = np.arccos(np.nanmax(cosines(points, normals, points)))
    return not largest + MIN_ANGLE < again


def mirror_points(mirror: Component) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 3] of the mirror up to its rim, and the unit normals there."""
    radius = mirror.outer_mm * np.arange(RINGS + 1) / RINGS
    angle = np.arange(SPOKES) * (2 * np.pi / SPOKES)
    x, y = np.outer(radius, np.cos(angle)).ravel(), np.outer(radius, np.sin(angle)).ravel()
    points = np.stack([x, y, mirror.quadric.meet(x, y, 0.0, 0.0)], -1)
    slope_x, slope_y = mirror.quadric.gradient(*points.T)
    normals = np.stack([-slope_x, -slope_y, np.ones_like(x)], -1)
    return points, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def cosines(points: np.ndarray, normals: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Cosines [points, others] between the normals and the directions to the other points."""
    to = others[None] - points[:, None]
    return np.einsum("pk,pok->po", normals, to) / np.linalg.norm(to, axis=-1)
