"""From errors of places to errors of heights."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.geometry import geometry_changes
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.optics.setup import Setup


@pytest.fixture(scope="module")
def design():
    return MeasuredDesign.of(Setup(small_scene()))


def test_no_error_is_no_height(design):
    assert np.array_equal(design.heights_mm(np.zeros((2, design.count))), np.zeros(design.count))


def test_small_errors_are_those_of_the_linear_response(design):
    changes = geometry_changes(design, {"screen.x_mm": 1e-3})
    exact, linear = design.heights_mm(changes), design.response.heights_mm(changes[None])[0]
    assert np.abs(exact - linear).max() < 1e-4 * np.abs(exact).max()  # the rest is of second order


def test_errors_of_several_tests_are_those_of_each(design):
    changes = np.stack([geometry_changes(design, {"camera.x_mm": value}) for value in (0.1, -0.3)])
    both = design.heights_mm(changes)
    for one, alone in zip(both, changes, strict=True):
        assert np.abs(one - design.heights_mm(alone)).max() < 1e-13  # rounding of solvers for several maps


def test_the_covariance_of_a_pixels_places_is_that_of_rays(design):
    """By 4000 random rays of some pixels, binned to the screen's pixels as a light curve is."""
    random, setup = np.random.default_rng(5), design.setup
    row, column = (values[::171] for values in design.seen.pixels)
    found = design.light_covariance_mm2[:, :, ::171]
    count, aperture = 4000, setup.scene.camera.aperture_diameter_mm / 2
    radius, angle = aperture * np.sqrt(random.random(count)), random.random(count) * 2 * np.pi
    offset = random.random((2, count)) - 0.5
    _, u, v = setup.chief_rays.reverse(
        row[:, None] + offset[0], column[:, None] + offset[1], radius * np.cos(angle), radius * np.sin(angle)
    )
    pitch = setup.scene.screen.pitch_xy_mm
    places = np.stack([np.floor(u / pitch[0]) * pitch[0], np.floor(v / pitch[1]) * pitch[1]])
    for k in range(len(row)):
        covariance = np.cov(places[:, k])
        # sigma of a variance of 4000 is 2.2 %; binning with a few lines to a pixel's light adds as much
        assert np.abs(np.diag(covariance) / np.diag(found[..., k]) - 1).max() < 0.12
        assert abs(covariance[0, 1] - found[0, 1, k]) < 0.1 * found[0, 0, k]
