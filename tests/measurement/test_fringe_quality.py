"""Reasons why pixels are not used, and checks: each at both sides of its limit."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from fringe_stacks import DARK, SHAPE, disk, fringe_stack

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.measurement.fringe_frames import frames_shown
from irtscots_cl.measurement.fringe_quality import (
    Reason,
    check_noise,
    check_notes,
    check_pixels,
    check_saturation,
    exclusions,
)
from irtscots_cl.measurement.photon_transfer import photon_transfer
from irtscots_cl.measurement.quality import ERROR, OK, WARNING
from irtscots_cl.measurement.screen_coordinates import screen_coordinates


@lru_cache
def found_of(saturation=np.inf):
    stack = fringe_stack(saturation=saturation)
    return stack, screen_coordinates(stack, mask=disk())


def test_every_pixel_has_its_reason():
    _, found = found_of()
    row, column = np.argwhere(disk())[[40, 80, 120, 160]].T
    one = found.x
    wrong, misfit, fraction = one.wrong.copy(), one.misfit.copy(), one.fraction.copy()
    wrong[row[0], column[0]], misfit[row[1], column[1]], fraction[row[2], column[2]] = 0.5, 100.0, np.nan
    changed = replace(found, axes={**found.axes, "x": replace(one, wrong=wrong, misfit=misfit, fraction=fraction)})
    use = np.ones(SHAPE, bool)
    use[row[3], column[3]] = False
    why = exclusions(changed, disk(), use)
    assert why.reason[row, column].tolist() == [Reason.ORDER, Reason.DISAGREE, Reason.ORDER, Reason.MASKED]
    assert (why.reason[~disk()] == Reason.DARK).all() and why.used.sum() == disk().sum() - 4
    counts = why.counts(disk())
    assert counts == {
        "used": disk().sum() - 4, "masked": 1, "dark": 0, "saturated": 0, "order": 2, "disagree": 1, "edge": 0,
        "mark": 0, "bad": 0,
    }  # fmt: skip


@pytest.mark.parametrize(("used", "level"), [(95, OK), (80, WARNING), (5, ERROR)])
def test_few_pixels_are_named_with_their_reasons(used, level):
    counts = {reason.name.lower(): 0 for reason in Reason} | {"used": used, "order": 100 - used, "masked": 7}
    check = check_pixels(counts)
    assert check.level == level and check.value == used / 100  # those masked by the user are not counted
    assert f"{100 - used} with a fringe order in doubt" in check.text and "7 masked" in check.text


def test_saturation_names_the_image_that_has_most_of_it():
    stack, found = found_of(saturation=700.0)
    check = check_saturation(found, disk(), 700.0, frames_shown(stack, found), str)
    assert check.level == WARNING and "at 700" in check.text and "most in" not in check.text
    frames = np.array(stack.frames)
    frames[6] = 5000.0
    stack = replace(stack, frames=frames, saturation=5000.0)
    found = screen_coordinates(stack, mask=disk())
    check = check_saturation(found, disk(), 5000.0, frames_shown(stack, found), lambda k: f"image {k}")
    assert check.level == WARNING and "most in image 6 (100%)" in check.text
    stack, found = found_of()
    assert check_saturation(found, disk(), np.inf, frames_shown(stack, found), str).level == OK


def notes_of(frames):
    return check_notes(screen_coordinates(replace(fringe_stack(), frames=frames), mask=disk()))


def test_a_series_without_fringes_is_an_error_that_names_it():
    frames = np.array(fringe_stack().frames)
    assert [check.level for check in notes_of(frames)] == [OK]
    frames[12:] = DARK + 500 + np.random.default_rng(1).normal(0, 10, frames[12:].shape)
    errors = [check.text for check in notes_of(frames) if check.level == ERROR]
    assert any("y fringes of 3.2 periods: no fringes in the images" in text for text in errors)


def test_a_series_of_other_periods_is_named_among_three():
    sets = tuple(FringeSet.equal(axis, (0.9, 2.9, 7.3), 4) for axis in "xy")
    shown = tuple(FringeSet.equal(axis, (0.9, 4.1, 7.3), 4) for axis in "xy")
    stack = replace(fringe_stack(shown), sets=sets)
    errors = [check.text for check in check_notes(screen_coordinates(stack, mask=disk())) if check.level == ERROR]
    assert len(errors) == 2 and all("without that of 2.9 periods they agree" in text for text in errors)


def test_frames_of_no_screen_are_an_error():
    frames = np.array(fringe_stack().frames)
    frames[[1, 2]] = frames[[2, 1]]
    assert any("wrong frames alone make" in c.text for c in notes_of(frames) if c.level == ERROR)


def test_noise_that_is_no_line_over_light_is_named():
    random = np.random.default_rng(2)
    light = random.uniform(0, 1000, 20_000)
    square = random.standard_normal(len(light)) ** 2
    assert check_noise(photon_transfer(square * (4 + light / 5), light)).level == OK
    check = check_noise(photon_transfer(square * (4 + light**2 / 1e3), light))
    assert check.level == WARNING and "record raw images" in check.text
    assert check_noise(None).level == OK
