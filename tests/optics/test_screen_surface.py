"""Screens through measured points: between the points, beyond them, and their slopes."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.optics.screen_surface import screen_surface
from irtscots_cl.scene.instrument import Screen
from irtscots_cl.scene.screen_shape import ScreenShape


def screen(interpolation):
    fraction = np.stack(np.meshgrid([0.0, 0.3, 0.8, 1.0], [0.0, 0.5, 1.0])).reshape(2, -1)
    x, y = 400 * (fraction[0] - 0.5), 300 * (fraction[1] - 0.5)
    points = np.stack([x + 5 * fraction[0] * fraction[1], y - 3 * fraction[1] ** 2, 20 * fraction[0] ** 2], -1)
    shape = ScreenShape(
        fractions=tuple(map(tuple, fraction.T.tolist())),
        points_mm=tuple(map(tuple, points.tolist())),
        interpolation=interpolation,
    )
    return Screen(position_mm=(0.0, 0.0, 1000.0), pixels=(400, 300), pitch_mm=1.0, shape=shape), fraction, points


@pytest.mark.parametrize("interpolation", ["linear", "smooth"])
def test_the_surface_goes_through_the_points(interpolation):
    made, fraction, points = screen(interpolation)
    found = screen_surface(made).points(400 * (fraction[0] - 0.5), 300 * (fraction[1] - 0.5))
    np.testing.assert_allclose(found, points, rtol=0, atol=1e-10)


@pytest.mark.parametrize("interpolation", ["linear", "smooth"])
def test_tangents_are_the_difference_quotients(interpolation):
    """Also beyond the points, where the surface goes on as a plane; FITPACK has no derivative of straight pieces."""
    surface = screen_surface(screen(interpolation)[0])
    u, v = np.meshgrid([-230.0, -180.5, -33.3, 60.1, 140.2, 215.0], [-170.0, -70.7, 33.3, 160.0])
    step = 1e-4
    along_u, along_v = surface.tangents(u, v)
    for along, (du, dv) in ((along_u, (step, 0)), (along_v, (0, step))):
        quotient = (surface.points(u + du, v + dv) - surface.points(u - du, v - dv)) / (2 * step)
        # third derivatives times step^2 and rounding over step; the planes beyond the points change slowly along them
        np.testing.assert_allclose(along, quotient, rtol=0, atol=2e-2 if interpolation == "smooth" else 1e-2)
    inside = (np.abs(u) < 200) & (np.abs(v) < 150)
    quotient = (surface.points(u + step, v) - surface.points(u - step, v)) / (2 * step)
    np.testing.assert_allclose(along_u[inside], quotient[inside], rtol=0, atol=1e-8)


def test_straight_pieces_are_straight():
    made, _, points = screen("linear")
    surface = screen_surface(made)
    middle = surface.points(400 * (0.55 - 0.5), -150.0)  # between the fractions 0.3 and 0.8 of the lowest row
    np.testing.assert_allclose(middle, (points[1] + points[2]) / 2, atol=1e-10)
