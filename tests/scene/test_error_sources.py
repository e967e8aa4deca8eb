"""The table [budget]."""

from __future__ import annotations

import os

import pytest

from irtscots_cl.scene.presets import parse_scene, preset_text
from irtscots_cl.scene.validation import SceneError


def scene_with(table: str):
    return parse_scene(preset_text("sphere") + table)


def test_round_trip():
    scene = scene_with(
        "\n[budget]\ntrials = 16\nallow_nm = 20.0\nmirror_turns = 2\nexposures = 3\n"
        'compensators = ["screen.z_mm"]\ncalibrated = "out/report.json"\nstray_light = "out/stray-light.h5"\n'
        "[budget.sources]\ncamera.x_mm = 0.1\n"
        '"screen.tilt_x_rad" = { uniform = 1e-3, cost = 500.0 }\n'
        "[budget.air]\nouter_scale_mm = 300.0\nwind_mm_per_s = 0.0\n"
    )
    assert scene.budget.sources["camera.x_mm"].normal == 0.1
    assert scene.budget.sources["screen.tilt_x_rad"].cost == 500
    assert (scene.budget.air.outer_scale_mm, scene.budget.air.wind_mm_per_s, scene.budget.air.frame_s) == (300, 0, 0.1)
    budget = scene.budget
    assert (budget.mirror_turns, budget.exposures, budget.compensators) == (2, 3, ("screen.z_mm",))
    assert os.path.isabs(budget.calibrated) and budget.calibrated.endswith("report.json")
    assert os.path.isabs(budget.stray_light) and budget.stray_light.endswith("stray-light.h5")
    assert parse_scene(scene.to_toml()) == scene and hash(scene) == hash(parse_scene(scene.to_toml()))


@pytest.mark.parametrize(
    "table, told",
    [
        ("[budget.sources]\ncamera.x_mm = -1.0", "normal = -1.0: must be a finite number above 0"),
        (
            '[budget.sources]\n"camera.x_mm" = { normal = 1.0, uniform = 2.0 }',
            "uniform = 2.0: must be given without another",
        ),
        (
            '[budget.sources]\n"camera.x_mm" = { normal = 1.0, set_ups = 25 }',
            "set_ups = 25: must be an integer from 1 to",
        ),
        ('[budget.sources]\n"camera.x_mm" = { cost = 1.0 }', "must be given, or uniform"),
        (
            '[budget.sources]\n"camera.x_mm" = "a"',
            "must be a number, or a table { normal, uniform, triangular, set_ups, cost }",
        ),
        ("[budget]\ntrials = 1", "budget.trials = 1: must be an integer from 2 to"),
        ("[budget]\nexposures = 0", "budget.exposures = 0: must be an integer from 1 to"),
        ("[budget]\nmirror_turns = 25", "budget.mirror_turns = 25: must be an integer from 1 to 24"),
        ('[budget]\ncompensators = ["a", "a"]', "budget.compensators = 'a': must name each once"),
        ("[budget]\nallow = 1.0", "budget.allow: unknown key; did you mean allow_nm?"),
        ("[budget.air]\nouter_scale_mm = 0.0", "budget.air.outer_scale_mm = 0.0: must be a finite number at least"),
        ("[budget.air]\nwind = 1.0", "budget.air.wind: unknown key; allowed: outer_scale_mm, wind_mm_per_s, frame_s"),
        ("budget = 3", "budget = 3: must be a table [budget]"),
    ],
)
def test_refusals(table, told):
    text = preset_text("sphere")
    text = f"{table}\n{text}" if "[" not in table else f"{text}\n{table}\n"
    with pytest.raises(SceneError, match="^scene") as error:
        parse_scene(text)
    assert told in str(error.value) and "\n" not in str(error.value)
