"""Which frame each image shows: its own, another one, or none, whatever noise and saturation do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fringe_stacks import SETS, disk, fringe_stack, place

from irtscots_cl.measurement.fringe_frames import frames_shown
from irtscots_cl.measurement.screen_coordinates import screen_coordinates

DESIGN = {axis: place(axis) for axis in "xy"}


def shown(stack, design=DESIGN):
    return frames_shown(stack, screen_coordinates(stack, mask=disk()), design)


@pytest.mark.parametrize("noise", [1.5, 150.0])
def test_good_images_show_their_own_frames(noise):
    """Also where noise is half of the fringes' amplitude."""
    for design in (DESIGN, None):
        found = shown(fringe_stack(read=noise), design)
        assert not found.wrong.size and not found.foreign.size
        assert (found.saturated == 0).all() and np.allclose(found.contrast, 1, atol=0.5)


def test_swapped_images_are_told_without_a_design():
    frames = np.array(fringe_stack().frames)
    frames[[5, 13]] = frames[[13, 5]]
    found = shown(replace(fringe_stack(), frames=frames), None)
    assert found.wrong.tolist() == [5, 13] and found.shows[[5, 13]].tolist() == [13, 5]


@pytest.mark.parametrize(("number", "picture"), [(2, "dark"), (9, "white"), (14, "noise")])
def test_an_image_without_fringes_is_foreign(number, picture):
    stack = fringe_stack()
    frames = np.array(stack.frames)
    noise = np.random.default_rng(3).normal(0, 2, frames[0].shape)
    frames[number] = {"dark": stack.dark, "white": stack.white, "noise": 500 + 100 * noise}[picture]
    found = shown(replace(stack, frames=frames))
    assert found.foreign.tolist() == [number] and not found.wrong.size
    assert (found.contrast[number] < 0.3) == (picture != "noise")


def test_saturated_samples_are_not_judged():
    stack = fringe_stack()
    frames = np.array(stack.frames)
    frames[3] = 5000.0
    found = shown(replace(stack, frames=frames, saturation=5000.0))
    assert np.isnan(found.unexplained[3]) and found.saturated[3] == 1
    assert not found.wrong.size and not found.foreign.size
    half = shown(replace(stack, saturation=600.0))
    assert 0.05 < half.saturated.mean() < 0.6 and not half.wrong.size and not half.foreign.size


def test_steps_that_ran_backwards_are_no_wrong_frames():
    stack = fringe_stack(tuple(replace(one, reverse=False) for one in SETS))
    order = [0, 3, 2, 1]
    frames = np.concatenate([np.asarray(stack.frames)[k : k + 4][order] for k in range(0, 16, 4)])
    assert not shown(replace(stack, frames=frames), None).wrong.size
