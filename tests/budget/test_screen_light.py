"""Error sources: light of the screen."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.screen_light import BrightnessDrift, DeadPixels, FrameBrightness, PixelBrightness, weighted
from irtscots_cl.budget.source import Draw
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene


@pytest.fixture(scope="module")
def sphere():
    return MeasuredDesign.of(Setup(load_scene("sphere")))


def test_random_brightness_of_a_tenth(sphere):
    """The paper's case: 32 +- 6 nm, with tilt."""
    draws = np.stack([PixelBrightness().changes_mm(sphere, 0.1, Draw(1, k)) for k in range(12)])
    nm = sphere.heights_mm(draws).std(-1) * 1e6
    assert 26 < nm.mean() < 38


def test_a_factor_that_is_the_same_everywhere_changes_nothing(sphere):
    columns, rows = sphere.setup.scene.screen.pixels
    assert np.abs(weighted(sphere, np.full((rows, columns), 0.3))).max() < 1e-12


def test_a_dark_half_moves_places_to_the_other(sphere):
    columns, rows = sphere.setup.scene.screen.pixels
    factor = np.ones((rows, columns))
    factor[:, : columns // 2] = 0.0
    moved = weighted(sphere, factor)
    seen = np.isfinite(moved).all(0)
    assert (moved[0][seen] > -1e-12).all() and moved[0][seen].max() > 0.05
    assert (~seen).any()  # pixels that see the dark half alone have no place


@pytest.mark.parametrize("source", [FrameBrightness(), BrightnessDrift()])
def test_frames_brightness_acts_by_the_frames_weights(sphere, source):
    one, two = (source.changes_mm(sphere, value, Draw(3, 4)) for value in (1e-3, 2e-3))
    assert np.abs(2 * one - two).max() < 1e-15
    limit = 4.4 if source.kind.is_random else 1.0
    for axis in range(2):
        weights = sphere.frames.of_brightness[axis]
        bound = np.sqrt(np.sum(weights**2, -1)) if source.kind.is_random else np.sum(np.abs(weights), -1) / 2
        assert (np.abs(one[axis]) < limit * 1e-3 * bound).all()


def test_dead_pixels_move_places_by_what_they_take_away(sphere):
    """Few of them: mean square of the share of each of the screen's pixels times its distance, times their share."""
    root = 0.02
    draws = np.stack([DeadPixels().changes_mm(sphere, root, Draw(4, k)) for k in range(400)])
    shares, screen = sphere.light.of_pixels, sphere.setup.scene.screen
    for axis, number in enumerate(np.meshgrid(*(np.arange(k) for k in screen.pixels))):
        place = number.ravel() * screen.pitch_xy_mm[axis]
        squares = shares.multiply(shares)
        middle = shares @ place
        told = squares @ place**2 - 2 * middle * (squares @ place) + middle**2 * (squares @ np.ones_like(place))
        # 70 dead pixels are seen among 400 screens: 12 %, 3 sigma
        assert np.mean(draws[:, axis] ** 2) == pytest.approx(root**2 * told.mean(), rel=0.4)
    assert np.isnan(DeadPixels().changes_mm(sphere, 1.0, Draw(4, 0))).all()  # nothing is seen
