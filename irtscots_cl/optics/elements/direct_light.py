"""The way of the direct light through a scene's elements: how many it meets."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.walk import walk

RINGS, SPOKES = 8, 24  # of mirror points
MAX_STEPS = 64


def longest_direct_path(chief: ChiefRays, components: tuple[Component, ...]) -> int:
    """Elements, the detector included, that light from the screen meets on its longest intended way to the detector.

    Rays are followed from the centre of the camera's aperture in both directions: back by way of points all over the
    mirror until they cross the screen's plane against its light, and on to the detector. An element counts as often as
    it is met.
    """
    (back, _), (forth, _) = chief_walks(chief, components)
    lens = any(component.name == "lens" for component in components)
    return sum(1 for _ in back) + sum(1 for _ in forth) + int(lens)


def chief_walks(chief: ChiefRays, components: tuple[Component, ...]):
    """Visits of rays from the centre of the camera's aperture, and the components that they tell of by number.

    Back by way of mirror_points until they cross the screen's plane against its light, and on towards the detector; the
    rays of both have the same numbers.
    """
    centre = chief.camera_frame.position_mm
    ways = mirror_points(chief) - centre
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    starts = np.broadcast_to(centre, ways.shape)
    beside = tuple(component for component in components if component.name not in ("stop", "lens"))
    back = walk(beside, starts, ways, MAX_STEPS, passes=crosses_screen(chief.screen_frame))
    return (back, beside), (walk(beside, starts, -ways, MAX_STEPS), beside)


def crosses_screen(screen: Frame):
    """For walk: whether rays cross the screen's plane, against its light, before they reach the next element."""

    def crosses(at: np.ndarray, along: np.ndarray, distance: np.ndarray) -> np.ndarray:
        away = (at - screen.position_mm) @ screen.axes[2]
        rise = along @ screen.axes[2]
        with np.errstate(divide="ignore", invalid="ignore"):
            return (rise > 0) & (away < 0) & (-away / rise <= distance * (1 + 1e-9))

    return crosses


def mirror_points(chief: ChiefRays) -> np.ndarray:
    """Points [n, 3] all over the mirror."""
    surface = chief.surface
    square = (np.arange(RINGS) + 0.5) / RINGS
    inner, outer = surface.obscuration_radius_mm**2, surface.aperture_radius_mm**2
    radius, angle = np.sqrt(inner + (outer - inner) * square), np.arange(SPOKES) * (2 * np.pi / SPOKES)
    x, y = np.outer(radius, np.cos(angle)).ravel(), np.outer(radius, np.sin(angle)).ravel()
    return np.stack([x, y, surface.quadric.meet(x, y, 0.0, 0.0)], -1)
