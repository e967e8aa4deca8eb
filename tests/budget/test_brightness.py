"""Error sources: the brightness of the screen."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.budget.brightness import TERMS, Brightness
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene

NO_DRAW = Draw(0, 0)


@pytest.fixture(scope="module")
def sphere():
    return MeasuredDesign.of(Setup(load_scene("sphere")))


@pytest.mark.parametrize("term", ["x", "y"])
def test_a_linear_slope_of_a_tenth_costs_a_tilt(sphere, term):
    """The paper's case (its table of brightness): 100 to 105 nm of tilt and hardly more."""
    height = sphere.heights_mm(Brightness(term).changes_mm(sphere, 0.1, NO_DRAW)) * 1e6
    left = sphere.response.left(height[None])[0][0]
    assert 100 < np.sqrt(np.mean(height**2) - left**2) < 105
    assert left < 2


@pytest.mark.parametrize("term", TERMS)
def test_places_move_as_those_of_weighted_rays(sphere, term):
    """By the mean of random rays of a few pixels, weighted by the brightness of the screen's pixel that they meet."""
    random, setup, value = np.random.default_rng(3), sphere.setup, 0.3
    chosen = np.arange(500, sphere.count, 1900)
    row, column = (values[chosen] for values in sphere.seen.pixels)
    count, aperture = 2**16, setup.scene.camera.aperture_diameter_mm / 2
    radius, angle = aperture * np.sqrt(random.random(count)), random.random(count) * 2 * np.pi
    offset = random.random((2, count)) - 0.5
    _, u, v = setup.chief_rays.reverse(
        row[:, None] + offset[0], column[:, None] + offset[1], radius * np.cos(angle), radius * np.sin(angle)
    )
    screen = setup.scene.screen
    pitch, half = screen.pitch_xy_mm, np.array(screen.pixels) * screen.pitch_xy_mm / 2
    places = np.stack([(np.floor(u / pitch[0]) + 0.5) * pitch[0], (np.floor(v / pitch[1]) + 0.5) * pitch[1]])
    x, y = places[0] / half[0], places[1] / half[1]
    weight = 1 + value * {"x": x, "y": y, "xx": x * x, "xy": x * y, "yy": y * y}[term]
    moved = np.sum(places * weight, -1) / weight.sum(-1) - places.mean(-1)
    found = Brightness(term).changes_mm(sphere, value, NO_DRAW)[:, chosen]
    # the slope within a pixel's light is straight to a percent; 2^16 rays leave 0.5 % of the largest
    assert np.abs(moved - found).max() < 0.03 * max(np.abs(found).max(), 1e-4)
