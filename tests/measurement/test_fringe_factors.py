"""What changed between frames: gains with their error bars, light, motion; nothing where nothing did."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fringe_stacks import SETS, SHAPE, disk, fringe_stack
from scipy.ndimage import shift

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.measurement.fringe_factors import BRIGHTNESS, LIGHT, MOTION, OTHER, frame_factors, without_gains

COUNT = 16


def test_equal_frames_are_left_alone():
    for seed in range(5):
        found = frame_factors(fringe_stack(seed=seed), disk())
        assert not found.divided and found.changes == () and 0.85 < found.excess[0] < 1.15
        assert found.white == found.dark == 0 and (found.at_zero == 0).all()


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_gains_are_found_with_their_errors(gamma):
    """Pulls of 8 x 16 gains: their variance is known to 13 %; 5 sigma are 6e-7."""
    pulls = []
    for seed in range(8):
        gains = np.random.default_rng(50 + seed).normal(1, 0.03, COUNT)
        found = frame_factors(fringe_stack(gains=gains, seed=seed, gamma=gamma), disk())
        assert found.changes[0].kind == BRIGHTNESS and found.divided
        off = np.log(found.gains) - np.log(gains)
        pulls.append((off - off.mean()) / found.gain_error)
    pulls = np.array(pulls)
    assert 0.2 < pulls.var() < 1.7


def test_noise_is_no_gain_where_pixels_see_nearly_the_same_phase():
    """The light's own noise, in both sides of the equations, does not fall with the number of pixels."""
    for seed in range(6):
        found = frame_factors(fringe_stack(seed=seed, seen=0.3), disk())
        assert not found.divided and found.changes == () and not found.undecided


def test_gains_of_a_narrow_range_of_phases_are_told_or_left_alone():
    """One frame's gain explains all: it is divided out. Those of all frames are too uncertain: said, and left."""
    gains = np.ones(COUNT)
    gains[5] = 0.9
    for seed in range(3):
        found = frame_factors(fringe_stack(seed=seed, seen=0.2, gains=gains), disk())
        assert found.gains == pytest.approx(gains, abs=0.004) and found.changes[0].first == 5
        uneven = np.random.default_rng(50 + seed).normal(1, 0.03, COUNT)
        found = frame_factors(fringe_stack(seed=seed, seen=0.2, gains=uneven), disk())
        assert not found.divided and found.undecided and found.gain_error.max() > 0.05


def test_gains_are_unbiased_where_little_tells_them():
    """Mean over 12 seeds of 16 gains, in its own standard errors; the light's noise in both sides moved it by 5."""
    pulls = []
    for seed in range(12):
        gains = np.where(np.arange(COUNT) % 2, 0.8, 1.2)
        found = frame_factors(fringe_stack(seed=seed, seen=0.4, gains=gains), disk())
        assert found.divided
        off = np.log(found.gains / gains)
        pulls.append((off - off.mean()) / found.gain_error)
    pulls = np.array(pulls)
    assert np.abs(pulls.mean(0)).max() < 4.0 / np.sqrt(12) and 0.2 < pulls.var() < 1.7


def test_divided_frames_are_equal_again_and_saturated_samples_are_none():
    gains = np.ones(COUNT)
    gains[5] = 0.5
    stack = fringe_stack(gains=gains)
    found = frame_factors(stack, disk())
    assert (found.changes[0].first, found.changes[0].stays) == (5, False)
    assert found.gains[5] == pytest.approx(0.5, rel=0.01)
    equal = without_gains(replace(stack, saturation=900.0), found.gains)
    ratio = (equal.frames[5] - stack.dark)[disk()] / (np.asarray(stack.frames[5]) - stack.dark)[disk()]
    assert np.nanmedian(ratio) == pytest.approx(2.0, rel=0.02) and len(equal.frames[2:5]) == 3
    assert np.isnan(equal.frames[0][np.asarray(stack.frames[0]) >= 900]).all() and equal.saturation == np.inf
    assert frame_factors(without_gains(stack, found.gains), disk()).changes == ()


def changed(frames):
    return frame_factors(replace(fringe_stack(), frames=frames), disk()).changes


def test_light_from_a_frame_on_is_named():
    frames = np.array(fringe_stack().frames)
    frames[6:] += np.linspace(30, 60, SHAPE[1])
    (one,) = changed(frames)
    assert (one.kind, one.first, one.stays) == (LIGHT, 6, True) and one.explained > 0.9


def test_motion_from_a_frame_on_is_named():
    frames = np.array(fringe_stack(electrons=0, blur=1.0).frames)
    frames[9:] = [shift(image, (0.2, 0.1), order=1, mode="nearest") for image in frames[9:]]
    (one,) = changed(frames)
    assert (one.kind, one.first, one.stays) == (MOTION, 9, True)
    assert one.size == pytest.approx(np.hypot(0.2, 0.1), rel=0.3)


def test_a_frame_with_a_part_gone_is_named_with_the_ones_that_cannot_be_told_from_it():
    """Opposite steps of a series: the sum of both is twice the offset, whichever is wrong."""
    frames = np.array(fringe_stack().frames)
    frames[5, 15:22, 15:25] = 20.0
    (one,) = changed(frames)
    assert one.kind == OTHER and not one.stays and {one.first, *one.ties} == {5, 7}


def test_samples_at_zero_and_wrong_references_are_counted():
    stack = fringe_stack()
    dark = np.maximum(np.rint(np.asarray(stack.frames) - 100), 0).astype(np.uint16)
    found = frame_factors(replace(stack, frames=dark), disk())
    assert found.at_zero.max() > 0.05
    assert frame_factors(replace(stack, white=np.asarray(stack.frames[4])), disk()).white > 0.3
    assert frame_factors(replace(stack, dark=np.asarray(stack.frames[4])), disk()).dark > 0.3


def test_three_steps_of_one_axis_tell_nothing():
    sets = (FringeSet.equal("x", (0.9,), 3),)
    found = frame_factors(fringe_stack(sets), disk())
    assert not found.divided and found.gain_error.min() > 0.1 and np.isnan(found.excess).all()
    assert SETS[0].count * 2 == COUNT
