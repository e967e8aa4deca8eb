"""The command `irtscots budget`."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from small_budget import SOURCES, small_scene

from irtscots_cl.scene.error_sources import Budget


@pytest.fixture
def small(tmp_path):
    """A scene of few pixels, with a budget."""
    scene = replace(small_scene(31), name="small", budget=Budget(sources=dict(SOURCES), trials=16))
    path = tmp_path / "small.toml"
    path.write_text(scene.to_toml())
    return path


def test_json_and_file(irtscots, small, tmp_path):
    code, out, err = irtscots("budget", small, "--json", "--trial", "3", "--out", tmp_path / "out")
    assert (code, err) == (0, "")
    data = json.loads(out)
    assert data == json.loads((tmp_path / "out" / "budget.json").read_text())
    assert {one["name"] for one in data["sources"]} == set(SOURCES)
    assert sorted(path.name for path in (tmp_path / "out").rglob("*.*")) == [
        "budget.csv", "budget.json", "cumulative.png", "maps.png", "tornado.png",
    ]  # fmt: skip
    head, *rows = (tmp_path / "out" / "budget.csv").read_text().splitlines()
    assert head.startswith("source,unit,distribution,size,sigma,nm_piston_tilt,") and len(rows) == len(SOURCES)
    assert data["ledger"]["trial"] == 3 and data["trials"] == 16
    assert data["predicted_nm"]["piston_tilt"] == pytest.approx(data["trials_rms_nm"]["piston_tilt"], rel=0.5)


def test_text(irtscots, small):
    code, out, err = irtscots("budget", small, "--trials", "8")
    assert (code, err) == (0, "")
    assert "What to calibrate" not in out
    assert "All together, 8 trials" in out and "Ledger of trial 0" in out and "camera.x_mm" in out


def test_what_is_allowed(irtscots, small):
    code, out, err = irtscots("budget", small, "--trials", "8", "--allow-nm", "5")
    assert (code, err) == (0, "")
    assert "5 nm allowed" in out and "none: the others cost too much" in out and "What to calibrate" in out


def test_a_scene_without_a_budget_has_its_sensitivities(irtscots, tmp_path):
    path = tmp_path / "plain.toml"
    path.write_text(replace(small_scene(31), name="plain").to_toml())
    code, out, err = irtscots("budget", path)
    assert (code, err) == (0, "")
    assert "each source at a usual value" in out and "screen.brightness_xx" in out


@pytest.mark.parametrize(
    "options, told",
    [
        (("--trials", "1"), "--trials = 1: must be from 2 to 1048576"),
        (("--trial", "16"), "--trial = 16: must be from 0 to 15"),
        (("--allow-nm", "0"), "--allow-nm = 0.0: must be a number above 0"),
        (("--trial", "-1"), "--trial = -1: must be from 0 to 15"),
    ],
)
def test_bad_options(irtscots, small, options, told):
    code, out, err = irtscots("budget", small, *options)
    assert (code, out) == (2, "") and told in err and err.count("\n") == 1
