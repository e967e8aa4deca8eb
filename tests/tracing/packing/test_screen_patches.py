"""Cubics that stand for the part of a bent screen that a detector pixel sees."""

from __future__ import annotations

import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from real_setup import measured_points, real_setup
from scenes import with_part

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.screen_shape import ScreenShape
from irtscots_cl.tracing.packing.screen_patches import (
    ScreenFitWarning,
    _slopes,
    fit_error,
    screen_patches,
    steps_needed,
)
from irtscots_cl.tracing.packing.sources import receivers


def some(chief, count=200):
    visible = np.flatnonzero(chief.sees_mirror)
    return visible[np.linspace(0, len(visible) - 1, count).astype(int)]


def bent(**sag):
    return with_part(real_setup("flat", glass=False), "screen", shape=ScreenShape(**sag))


def test_rays_meet_a_patch_where_they_meet_the_screen():
    """Steps from the tangent plane, with the cubic itself exact: the host's own intersection."""
    chief = ChiefRays(real_setup("sag", glass=False))
    pixels = some(chief)
    patches, row, column = screen_patches(chief, pixels), *np.divmod(pixels, 90)
    points, u, v = chief.reverse(row, column, 1.0, -0.7)
    way = (chief.screen_model.to_world(u, v) - points) @ chief.screen_frame.axes.T
    slopes = (way[:, :2] / way[:, 2:]).T
    x, y, z = chief.screen_model.surface.points(u, v).T
    crossing = np.stack([x, y]) - slopes * z  # where the ray meets the frame's plane
    goal = crossing - patches.centre - patches.coefficient[:2, 0] + slopes * patches.coefficient[2, 0]
    lands = np.isfinite(u) & (np.abs(u - 1.3) < 10.3) & (np.abs(v + 7.3) < 7.2)
    assert lands.sum() > 150
    left = [np.abs(patches.met(goal, slopes, steps) + patches.centre - [u, v])[:, lands].max() for steps in range(1, 7)]
    assert left[-1] < 1e-10  # mm: the surface is a cubic, so nothing but the steps is left
    # each step leaves a hundredth or so of the last error
    assert all(later < 0.05 * earlier for earlier, later in pairwise(left[:5]))
    for asked in (1e-5, 1e-10):  # of a screen pixel; the steps are counted in the corners of the patches, not beyond
        assert left[steps_needed(chief, patches, _slopes(chief, pixels), asked) - 1] < asked * 0.9


@pytest.mark.parametrize("shape", ["sag", "points"])
def test_the_steps_are_as_many_as_the_error_needs(shape):
    chief = ChiefRays(real_setup(shape))
    pixels = some(chief)
    patches, slopes = screen_patches(chief, pixels), _slopes(chief, pixels)
    found = [steps_needed(chief, patches, slopes, left) for left in (1.0, 1e-5, 1e-10)]
    assert found[0] == 0 and found == sorted(found) and found[2] <= 8
    made = [receivers(chief, pixels, np.zeros((200, 2), int), p)["patch"]["steps"] for p in ("fp32", "fp64")]
    assert [set(steps.tolist()) for steps in made] == [{found[1]}, {found[2]}]


def test_a_cubic_is_as_good_as_the_screen_is_smooth():
    chief = ChiefRays(real_setup("points"))
    pixels = some(chief)
    assert fit_error(chief, screen_patches(chief, pixels), _slopes(chief, pixels)) < 1e-3  # of a screen pixel
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScreenFitWarning)
        receivers(chief, pixels, np.zeros((200, 2), int), "fp32")


def test_a_kink_is_told_of():
    """Measured points that are joined by straight lines, ten times as bent."""
    scene = with_part(real_setup("points"), "screen", shape=measured_points(5, "linear", bend=10.0))
    chief = ChiefRays(scene)
    with pytest.warns(ScreenFitWarning, match="screen.shape: the screen bends so much .* by up to 0.* screen pixels"):
        receivers(chief, some(chief), np.zeros((200, 2), int), "fp32")


def test_a_screen_that_turns_away_is_refused():
    """Its slope, towards which the rays run, goes through theirs within the light of a pixel."""
    scene = with_part(bent(sag_mm=((2, 0, 60.0),)), "camera", aperture_diameter_mm=12.0)
    chief = ChiefRays(replace(scene, name="steep"))
    pixels = some(chief)
    patches = screen_patches(chief, pixels)
    with pytest.raises(ValueError, match=r"^scene real-flat|^scene steep: screen.shape: rays do not find the bent"):
        steps_needed(chief, patches, np.full((2, len(pixels)), 3.0), 1e-5)
