"""The examples with a table [budget], on fewer pixels: what docs/budget.md says of them in full."""

from __future__ import annotations

import json
import re

import pytest
from scenes import EXAMPLES

PIXELS = {"paper-budget": 125, "paper-errors": 125, "budget-406": 176, "budget-406-calibrated": 176}


@pytest.fixture
def coarse(tmp_path):
    """An example with 31 x 31 larger pixels."""

    def made(name):
        text = (EXAMPLES / f"{name}.toml").read_text()
        pitch = {125: 0.037, 176: 0.0276}[PIXELS[name]]
        old = (f"pixels = [{PIXELS[name]}, {PIXELS[name]}]", f"pitch_mm = {pitch}")
        assert all(text.count(part) == 1 for part in old)
        path = tmp_path / f"{name}.toml"
        path.write_text(
            text.replace(old[0], "pixels = [31, 31]").replace(old[1], f"pitch_mm = {pitch * PIXELS[name] / 31}")
        )
        return path

    return made


def budget(irtscots, path):
    code, out, err = irtscots("budget", path, "--trials", "64", "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


def test_uneven_screens_cost_more_than_twenty_nanometres(irtscots, coarse):
    data = budget(irtscots, coarse("paper-budget"))
    told = data["tolerances"]
    assert told["now_nm"] == pytest.approx(42, rel=0.15)
    assert told["plan"][0]["name"] == "screen.brightness_random"
    nm = {one["name"]: one["nm"]["piston_tilt"] for one in data["sources"]}
    assert nm["screen.brightness_random"] == pytest.approx(28, rel=0.1) and nm["screen.brightness_x"] < 0.5


def test_what_the_plan_of_the_406_mm_test_buys(irtscots, coarse):
    data = budget(irtscots, coarse("budget-406"))
    assert data["tolerances"]["now_nm"] == pytest.approx(443, rel=0.1)
    plan = data["tolerances"]["plan"]
    assert {step["name"] for step in plan[:2]} == {"camera.z_mm", "screen.z_mm"}
    assert plan[-1]["after_nm"] <= 20 and 7 <= len(plan) <= 10


def test_what_it_bought_suffices(irtscots, coarse):
    data = budget(irtscots, coarse("budget-406-calibrated"))
    assert 15 < data["tolerances"]["now_nm"] < 20 and data["tolerances"]["plan"] == []
    assert data["trials_percentiles_nm"]["0.95"]["piston_tilt"] < 20


def test_light_errors_of_the_paper(irtscots, coarse):
    """As the file is, without a trace: the screen's random brightness is all of it."""
    data = budget(irtscots, coarse("paper-errors"))
    nm = {one["name"]: one["nm"]["piston_tilt"] for one in data["sources"]}
    assert nm.keys() == {
        "screen.brightness_x", "screen.brightness_y", "screen.brightness_random",
        "detector.efficiency_x", "detector.efficiency_y",
    }  # fmt: skip
    assert nm["screen.brightness_random"] == pytest.approx(28, rel=0.1) and nm["screen.brightness_x"] < 0.5
    assert max(nm["detector.efficiency_x"], nm["detector.efficiency_y"]) < 0.02
    assert data["trials_rms_nm"]["piston_tilt"] == pytest.approx(nm["screen.brightness_random"], rel=0.1)


def test_scattered_light_of_the_paper(irtscots, device, coarse, tmp_path, monkeypatch):
    """With the file's own command, and without the # of its two lines."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").mkdir()
    text = coarse("paper-errors").read_text()
    (tmp_path / "examples" / "paper-errors.toml").write_text(text)
    (command,) = re.findall("^#   irtscots (paths .*)$", text, re.MULTILINE)
    few = ("--rays-per-pixel", 4096, "--device", device.index, "--quiet", "--json")
    code, out, err = irtscots(*command.split(), *few)
    assert (code, err) == (0, "")
    traced = json.loads(out)["stray_light"][0]
    text, count = re.subn('^# (stray_light|"stray)', r"\1", text, flags=re.MULTILINE)
    assert count == 2
    (tmp_path / "examples" / "paper-errors.toml").write_text(text)
    data = budget(irtscots, "./examples/paper-errors.toml")
    nm = {one["name"]: one["nm"]["piston_tilt"] for one in data["sources"]}
    assert nm["stray.scatter"] == pytest.approx(0.0043, rel=0.1)
    assert nm["stray.scatter"] == pytest.approx(traced["height_nm_rms"], rel=0.05)
    assert data["stray_light"][0]["rays_nm"]["piston_tilt"] < 0.05 * nm["stray.scatter"]
