"""Measured points of a bent screen that are joined by straight lines."""

from __future__ import annotations

import numpy as np
from real_setup import measured_points, real_setup
from scenes import with_part

from irtscots_cl.optics.screen_model import ScreenModel


def test_linear_points_are_bilinear_between_them_and_have_the_slopes_of_differences():
    scene = with_part(real_setup("points", glass=False), "screen", shape=measured_points(5, "linear"))
    surface = ScreenModel.of(scene.screen).surface
    shape, half = scene.screen.shape, np.array([23 * 0.9, 17 * 0.85]) / 2
    places = (2 * np.array(shape.fractions) - 1) * half + scene.screen.centre_offset_mm
    np.testing.assert_allclose(surface.points(*places.T), shape.points_mm, atol=1e-12)
    corners = [0, 1, 5, 6]  # of the first cell
    middle = places[corners].mean(0)
    np.testing.assert_allclose(surface.points(*middle), np.array(shape.points_mm)[corners].mean(0), atol=1e-12)
    u, v = np.random.default_rng(2).uniform(-0.95, 0.95, (2, 50)) * half[:, None] + places.mean(0)[:, None]
    for tangent, step in zip(surface.tangents(u, v), ((1e-6, 0.0), (0.0, 1e-6)), strict=True):
        along = (surface.points(u + step[0], v + step[1]) - surface.points(u - step[0], v - step[1])) / 2e-6
        np.testing.assert_allclose(tangent, along, atol=1e-7)  # of 50 points none lies within 1e-6 mm of a line
