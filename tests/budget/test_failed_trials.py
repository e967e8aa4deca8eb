"""Trials that lose part of their view, and trials of which nothing can be measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_budget import small_scene, small_trials

from irtscots_cl.budget.assess import assess_budget
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.source import Draw
from irtscots_cl.budget.trials import LEAST_SHARE, NotMeasuredError, Trials
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.validation import SceneError

TILT = "camera.tilt_x_rad"


def trials_with_large_screen(sources, trials=16):
    """Places stay on the screen however the camera turns."""
    scene = small_scene()
    scene = replace(scene, screen=replace(scene.screen, pixels=(201, 201)))
    budget = Budget(sources=sources, trials=trials)
    return Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget)


@pytest.mark.parametrize("angle", [0.0, 0.005, 0.05, 0.1])
def test_the_share_out_of_view_is_that_of_two_circles(angle):
    """A turned camera sees a disk as large as the mirror, beside it: what both share in closed form."""
    trials = trials_with_large_screen({TILT: 0.01})
    _, lost = trials.heights_and_lost([(0, {TILT: angle})])
    apart = np.tan(angle) * np.linalg.norm(trials.design.setup.scene.camera.position_mm) / 1064.0
    both = 2 / np.pi * (np.arccos(apart) - apart * np.sqrt(1 - apart**2))
    pixel = 1 / 36  # of the mirror's diameter
    assert lost[0] == pytest.approx(1 - both, abs=0.8 * pixel)  # disks through mesh of pixels, seen at an angle
    assert (lost[0] == 0) == (angle == 0)


def test_a_trial_without_half_its_view_has_failed():
    trials = trials_with_large_screen({TILT: {"uniform": 0.15}}, trials=64)
    spread = monte_carlo(trials)
    angles = np.abs(trials.values[TILT])
    assert 5 < len(spread.failed) < 59
    failed = np.isin(np.arange(64), list(spread.failed))
    assert angles[failed].min() > angles[~failed].max()
    assert np.isinf(spread.rms_nm[failed]).all() and np.isfinite(spread.rms_nm[~failed]).all()
    assert np.isnan(spread.lost[failed]).all() and spread.lost[~failed].max() < 1 - LEAST_SHARE
    assert all("pixels still see the screen's light in the mirror; too few" in why for why in spread.failed.values())
    alone = trials.heights_mm([(int(np.flatnonzero(~failed)[0]), None)])
    row = spread.rms_nm[np.flatnonzero(~failed)[0]]
    assert trials.design.response.left(alone)[0] * 1e6 == pytest.approx(row, rel=1e-12)
    share = failed.mean()
    assert np.isfinite(spread.percentile_nm(0.9 * (1 - share))).all()
    assert np.isinf(spread.percentile_nm(1 - 0.5 * share)).all()


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("screen.x_mm", 30.0, r"^0 of \d+ pixels still see the screen's light in the mirror; too few"),
        ("screen.dead_pixels", 1.0, r"^0 of \d+ pixels still see"),
        ("screen.brightness_random", 1.5, r"^0 of \d+ pixels still see"),
        ("screen.brightness_xx", -40.0, r"^\d+ of \d+ pixels still see"),
        ("mirror.conic", 1e3, r"^Mirror: diameter_mm = 1064.0: must be below"),
        ("camera.tilt_x_rad", 3.0, r"^Scene: camera.look_at_mm = .*: must look from position_mm within 89 degrees"),
        ("camera.k1", -40.0, r"^Camera: intrinsics.distortion = .*: must be one-to-one"),
        ("mirror.tilt_x_rad", 1.5, r"^the chief rays of \d+ of \d+ pixels miss the surfaces"),
    ],
)
def test_why_a_trial_cannot_be_measured(name, value, why):
    trials = small_trials(sources={name: abs(value)}, pixels=31)
    with pytest.raises(NotMeasuredError, match=why):
        trials.heights_mm([(0, {name: value})])


@pytest.mark.parametrize(("name", "size"), [("screen.dead_pixels", 0.97), ("detector.quantisation", 1.84)])
def test_a_pixel_without_light_keeps_its_place(name, size):
    """What leaves pixels without light, once in a test or in every measurement: their share is told."""
    trials = small_trials(sources={name: size}, pixels=31)
    changes = trials.sources[0].changes_mm(trials.design, size, Draw(trials.budget.seed, 0))
    dark = np.isnan(changes).any(0)
    assert 0 < dark.mean() < 0.5
    assert not trials.changes_mm(0)[:, dark].any() and np.array_equal(trials.changes_mm(0)[:, ~dark], changes[:, ~dark])
    assert trials.heights_and_lost([(0, None)])[1][0] == pytest.approx(dark.mean(), abs=1e-12)


def test_no_trial_that_can_be_measured_is_one_line():
    trials = small_trials(sources={"screen.dead_pixels": 1.0}, trials=4, pixels=31)
    with pytest.raises(SceneError, match=r"^sphere: budget.sources: 4 of 4 trials cannot be measured.*Trial 0: 0 of"):
        monte_carlo(trials)


def test_the_ledger_of_a_failed_trial_says_why():
    scene = small_scene(31)
    budget = Budget(sources={"screen.x_mm": {"uniform": 4.0}}, trials=8)
    trials = Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget)
    worst = int(np.argmax(np.abs(trials.values["screen.x_mm"])))
    found = assess_budget(scene, budget, worst)
    assert found.ledger is None and "pixels still see" in found.no_ledger
    assert worst in found.monte_carlo.failed
