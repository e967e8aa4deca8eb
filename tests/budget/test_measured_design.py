"""From errors of places to errors of heights."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.geometry import geometry_changes
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Air, Budget


@pytest.fixture(scope="module")
def design():
    return MeasuredDesign.of(Setup(small_scene()))


def test_no_error_is_no_height(design):
    assert np.array_equal(design.heights_mm(np.zeros((2, design.count))), np.zeros(design.count))


def test_small_errors_are_those_of_the_linear_response(design):
    changes = geometry_changes(design, {"screen.x_mm": 1e-3})
    exact, linear = design.heights_mm(changes), design.response.heights_mm(changes[None])[0]
    assert np.abs(exact - linear).max() < 1e-4 * np.abs(exact).max()  # the rest is of second order


def test_heights_that_lean_are_those_of_the_linear_response():
    """Of a convex mirror in wide light errors are mostly tilt, 0.1 mm at the rim, which moves what pixels see of it by
    0.04 mm: with two rounds of the height fed back, to a part in a hundred of what is left without the tilt."""
    scene = small_scene(31, "./examples/convex.toml")
    design = MeasuredDesign.of(Setup(scene))
    for name, value in (("camera.x_mm", 0.1), ("screen.tilt_y_rad", 1e-4)):
        changes = geometry_changes(design, {name: value})
        exact, linear = design.heights_mm(changes)[None], design.response.heights_mm(changes[None])
        assert design.response.left(exact - linear)[0, 0] < 0.01 * design.response.left(linear)[0, 0]


def test_errors_of_several_tests_are_those_of_each(design):
    changes = np.stack([geometry_changes(design, {"camera.x_mm": value}) for value in (0.1, -0.3)])
    both = design.heights_mm(changes)
    for one, alone in zip(both, changes, strict=True):
        assert np.abs(one - design.heights_mm(alone)).max() < 1e-13  # rounding of solvers for several maps


def test_a_design_has_the_frames_and_the_air_of_its_budget_on_all_pixels():
    budget = Budget(periods=(2.0, 9.0), steps=5, air=Air(outer_scale_mm=300.0))
    design = MeasuredDesign.of_budget(Setup(small_scene()), budget)
    for one in (design, design.coarse(20), design.on(design.seen)):
        assert (one.fringes, one.air) == (((2.0, 9.0), 5), budget.air)
