"""The commands `irtscots init` and `irtscots check`, and what `irtscots run` says of a scene."""

from __future__ import annotations

import json

import pytest

from irtscots_cl.scene.presets import preset_text


@pytest.fixture
def half_screen(tmp_path):
    path = tmp_path / "half.toml"
    path.write_text(preset_text("newtonian").replace("pixels = [36, 32]", "pixels = [20, 10]"), encoding="utf-8")
    return path


def test_init_then_check(irtscots, tmp_path):
    path, folder = tmp_path / "mine.toml", tmp_path / "out"
    code, out, err = irtscots("init", "--diameter", "406.4", "--f-ratio", "4", "--conic", "-1", "--out", path)
    assert (code, err) == (0, "")
    assert path.read_text(encoding="utf-8") in out and f"irtscots check {path}" in out
    code, out, err = irtscots("check", path, "--quick", "--out", folder, "--strict")
    assert (code, err) == (0, "")
    assert out.startswith("mine: 100% of the mirror is seen and lit") and "nothing wrong found" in out
    assert sorted(file.name for file in folder.iterdir()) == ["check.json", "setup.png"]
    assert json.loads((folder / "check.json").read_text(encoding="utf-8"))["measured_share"] == 1.0


def test_check_as_json(irtscots, half_screen):
    code, out, err = irtscots("check", half_screen, "--quick", "--json")
    assert (code, err) == (0, "")
    (finding,) = json.loads(out)["findings"]
    assert (finding["code"], finding["level"]) == ("screen-too-small", "warning")
    assert irtscots("check", half_screen, "--quick", "--strict")[0] == 2


def test_check_explains_a_scene_that_is_refused(irtscots, tmp_path):
    path = tmp_path / "metres.toml"
    path.write_text(preset_text("newtonian").replace("3251.2\n", "3.2512\n"), encoding="utf-8")
    code, out, err = irtscots("check", path)
    assert code == 2 and err == ""
    assert out.startswith("error: radius-in-metres: mirror.radius_mm = 3.2512 looks like a number in metres")


def test_a_run_says_loudly_what_is_not_measured(irtscots, half_screen, tmp_path):
    code, _, err = irtscots(
        "run", half_screen, "--estimator", "analytic", "--no-figures", "--out", tmp_path / "out", "--quiet"
    )
    assert code == 0
    assert "warning: screen-too-small: " in err and "needs screen.pixels = [22, 16]" in err


def test_a_run_names_the_mistake_where_nothing_is_seen(irtscots, tmp_path):
    path = tmp_path / "inches.toml"
    path.write_text(preset_text("newtonian").replace("3251.2\n", "128.0\n"), encoding="utf-8")
    code, _, err = irtscots("run", path)
    assert code == 2 and err.count("\n") == 1
    assert "looks like a number in inches: with 3251.2 the light lands" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "--diameter: must be given where there is no terminal to ask on"),
        (("--diameter", "-3", "--radius", "100"), "--diameter = -3: must be a number above 0"),
        (("--diameter", "100"), "--radius: must be given (or --f-ratio)"),
        (("--diameter", "100", "--radius", "0"), "--radius = 0: must be above 0 (concave), below 0 (convex) or inf"),
        (("--diameter", "100", "--radius", "9", "--f-ratio", "4"), "--f-ratio: must be left out with --radius"),
        (
            ("--diameter", "100", "--f-ratio", "4", "--screen-pixels", "4K"),
            "--screen-pixels = 4K: must be COLUMNSxROWS",
        ),
        (("--diameter", "100", "--f-ratio", "4", "--sensor-pitch", "nan"), "--sensor-pitch = nan: must be a number"),
        (("--diameter", "1000", "--radius", "-1000"), "needs one of about"),
    ],
)
def test_bad_options_of_init(irtscots, tmp_path, options, message):
    code, out, err = irtscots("init", *options, "--out", tmp_path / "mine.toml")
    assert (code, out) == (2, "") and message in err and err.count("\n") == 1
    assert not (tmp_path / "mine.toml").exists()


def test_init_replaces_no_file(irtscots, half_screen):
    code, _, err = irtscots("init", "--diameter", "100", "--radius", "1000", "--out", half_screen)
    assert code == 2 and "exists; must be a new file, or --force" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--periods", "0"), "--periods = 0.0: must be above 0"),
        (("--steps", "2"), "--steps = 2: must be from 3 to 64"),
        (("--detail-mm", "-1"), "--detail-mm = -1.0: must be above 0"),
    ],
)
def test_bad_options_of_check(irtscots, options, message):
    code, _, err = irtscots("check", "sphere", *options)
    assert code == 2 and message in err
