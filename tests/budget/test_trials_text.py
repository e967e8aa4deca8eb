"""Trials as text: the same bits from it, without the files that the budget names."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from height_maps import letter, with_maps
from small_budget import SOURCES, calibration_report, small_scene, small_trials

from irtscots_cl.budget import trials_text as module
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.trial_blocks import block_of
from irtscots_cl.budget.trials import Trials
from irtscots_cl.budget.trials_text import block_of_text, trials_of_text, trials_text
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Air, Budget
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.outline import Outline
from irtscots_cl.scene.validation import SceneError

NOISY = SOURCES | {"air.turbulence_nm": 10.0, "vibration.camera.x_mm": 0.01}


def assert_same(one, other):
    assert (one.numbers, one.failed) == (other.numbers, other.failed)
    for name in ("rms_nm", "zernike_nm", "sum_mm", "squares_mm2"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"periods": (1.0, 8.0), "steps": 5, "air": Air(outer_scale_mm=500.0), "seed": 7},
        {"compensators": ("screen.z_mm",), "exposures": 2, "mirror_turns": 3, "allow_nm": 20.0},
    ],
    ids=["lines", "fringes", "procedure"],
)
def test_blocks_have_the_same_bits_from_text(told):
    budget = Budget(sources=dict(NOISY), trials=18, **told)
    trials = Trials.of(MeasuredDesign.of_budget(Setup(small_scene(31)), budget), budget)
    for block, count in ((0, 16), (1, 2)):
        found = block_of_text(trials_text(trials), block)
        assert len(found.numbers) == count
        assert_same(found, block_of(trials, block))


def test_a_calibration_s_report_and_the_mirror_s_map_are_not_read_again(tmp_path):
    path = calibration_report(tmp_path, 0.6)
    scene = small_scene(31)
    scene = replace(scene, mirror=replace(scene.mirror, map=(MirrorMap(file=str(tmp_path / "gone.h5")),)))
    budget = Budget(sources={"screen.y_mm": 0.1}, trials=16, calibrated=path)
    trials = Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget)
    Path(path).unlink()
    found = trials_of_text(trials_text(trials))
    assert found.joint.names == ("camera.x_mm", "screen.x_mm")
    assert_same(block_of(found, 0), block_of(trials, 0))


def test_pixels_and_frames_are_the_design_s():
    """Also where they are not those that the budget's design would have."""
    trials = small_trials(16, periods=(1.0, 4.0), pixels=61).coarse(30)
    seen = trials.design.seen
    assert seen.step == 3
    mask = seen.mask.copy()
    mask[:10] = False
    lines = MeasuredDesign(trials.design.setup, replace(seen, mask=mask))
    for one in (trials, trials.on(lines)):
        found = trials_of_text(trials_text(one)).design
        assert found.fringes == one.design.fringes
        np.testing.assert_array_equal(found.seen.x_mm, one.design.seen.x_mm)
        np.testing.assert_array_equal(found.seen.mask, one.design.seen.mask)


def test_an_outline_whose_picture_is_gone_is_one_line(tmp_path):
    np.save(tmp_path / "mask.npy", np.ones((50, 50), np.uint8))
    outline = Outline(shape="mask", file=str(tmp_path / "mask.npy"), pitch_mm=20.0)
    scene = small_scene(31)
    scene = replace(scene, mirror=replace(scene.mirror, outline=outline))
    budget = Budget(sources={"screen.y_mm": 0.1}, trials=16)
    text = trials_text(Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget))
    assert_same(block_of(trials_of_text(text), 0), block_of_text(text, 0))
    moved = text.replace("mask.npy", "gone.npy")
    assert moved != text
    with pytest.raises((SceneError, ValueError, OSError), match=r"gone\.npy") as error:
        trials_of_text(moved)
    assert "\n" not in str(error.value)


def test_a_process_makes_the_trials_once(monkeypatch):
    text, made = trials_text(small_trials(40, pixels=31)), []
    monkeypatch.setattr(Trials, "of", lambda *given, _of=Trials.of: made.append(given) or _of(*given))
    module._kept.clear()
    for block in (0, 2, 1):
        block_of_text(text, block)
    assert len(made) == 1 and json.loads(text)["step"] == 1


def test_sources_of_files_that_others_cannot_read_are_one_line():
    scene = with_maps(small_scene(31), MirrorMap(heights=letter(), outside="nearest"))
    budget = Budget(sources={"map.1": 0.1}, trials=16)
    trials = Trials.of(MeasuredDesign.of_budget(Setup(scene), budget), budget)
    with pytest.raises(SceneError, match=r"^sphere: budget.sources.'map.1': must be left out on a cluster: its file"):
        trials_text(trials)
