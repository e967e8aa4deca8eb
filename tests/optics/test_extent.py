"""Bounds of where components can lie: no point of any surface is beyond them, and some come near."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.maths.frame import Frame
from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.optics.elements.components import PLANE, Component
from irtscots_cl.optics.elements.extent import depths, heights, radius_about_vertex

SURFACES = {
    "plane": ("plane", PLANE, 30.0),
    "concave": ("quadric", Quadric.conic(100.0), 40.0),
    "convex": ("quadric", Quadric.conic(-60.0, -1.5), 40.0),
    "off axis": ("quadric", Quadric.conic(80.0, -1.0, 50.0), 30.0),
}


def placed(name):
    """A surface away from the world's origin, turned against all of its axes."""
    shape, quadric, radius = SURFACES[name]
    frame = Frame.looking((40.0, -70.0, 300.0), (-20.0, 30.0, 200.0), 0.3)
    return Component(name, "absorber", shape, frame, quadric, outer_mm=radius)


def points_of(component):
    """Points [n, 3] all over a component, in its frame."""
    radius = component.outer_mm * np.sqrt(np.linspace(0, 1, 301))
    x, y = (np.outer(radius, f(np.linspace(0, 2 * np.pi, 97))).ravel() for f in (np.cos, np.sin))
    return np.stack([x, y, component.quadric.meet(x, y, 0.0, 0.0)], -1)


@pytest.mark.parametrize("name", SURFACES)
def test_no_point_lies_beyond_the_bounds(name):
    component = placed(name)
    points = points_of(component)
    low, high = heights(component)
    assert low <= points[:, 2].min() <= points[:, 2].max() <= high
    assert high - low <= 1.2 * np.ptp(points[:, 2])  # twice the room of a twentieth, and rounding
    radius = np.linalg.norm(points, axis=-1).max()
    assert radius - 1e-9 <= radius_about_vertex(component) < 1.1 * radius  # mm, rounding
    origin, rng = np.array([5.0, 6.0, 7.0]), np.random.default_rng(1)
    world = component.frame.position_mm + points @ component.frame.axes
    for normal in (component.frame.axes[2], *rng.normal(size=(20, 3))):
        normal = normal / np.linalg.norm(normal)
        depth = (world - origin) @ normal
        least, most = depths(component, origin, normal)
        assert least <= depth.min() + 1e-9 and depth.max() - 1e-9 <= most  # mm, rounding
        assert most - least <= 1.3 * np.ptp(depth) + 1.2 * np.ptp(points[:, 2]) + 1e-9  # a cylinder, not much larger


def test_an_element_without_a_rim_has_no_bounds():
    wall = Component("wall", "absorber", "plane", Frame.looking((0.0, 0.0, 9.0), (0.0, 0.0, 0.0)))
    assert radius_about_vertex(wall) == np.inf
    assert depths(wall, np.zeros(3), np.array([0.0, 0.0, 1.0])) == (9.0, 9.0)
    assert depths(wall, np.zeros(3), np.array([0.6, 0.0, 0.8])) == (-np.inf, np.inf)


def test_a_surface_that_ends_before_its_rim_has_no_bounds():
    ball = Component("ball", "absorber", "quadric", Frame.looking((0.0, 0.0, 9.0), (0.0, 0.0, 0.0)),
                     Quadric.conic(10.0), outer_mm=20.0)  # fmt: skip
    assert heights(ball) == (-np.inf, np.inf)
