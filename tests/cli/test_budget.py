"""The command `irtscots budget`."""

from __future__ import annotations

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from small_budget import SOURCES, small_scene

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.formats.maps import write_map
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.presets import load_scene


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
        "budget.csv", "budget.h5", "budget.json", "cumulative.png", "maps.png", "report.html", "tornado.png",
    ]  # fmt: skip
    with h5py.File(tmp_path / "out" / "budget.h5") as file:
        total = np.nansum([file[f"ledger/{name}"][:] for name in SOURCES], axis=0)
        inside = np.isfinite(file["mirror/x_mm"][:])
        assert total[inside] == pytest.approx(file["ledger_total"][:][inside], abs=1e-9)
        assert file["ledger_total"].attrs["trial"] == 3
        size = np.sqrt(np.nanmean(file["sources/camera.x_mm"][:] ** 2))
        of_camera = next(one for one in data["sources"] if one["name"] == "camera.x_mm")
        assert size == pytest.approx(of_camera["nm"]["piston_tilt"], rel=1e-6)
        assert 0.9 < file["predicted/modes"].attrs["share_of_variance"] < 1
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
    code, out, err = irtscots("budget", path, "--out", tmp_path / "out")
    assert (code, err) == (0, "")
    assert "each source at a usual value" in out and "screen.brightness_xx" in out and " 550 nm " in out
    rows = {row.split(",")[0]: row.split(",") for row in (tmp_path / "out" / "budget.csv").read_text().splitlines()}
    assert rows["screen.z_mm"][1:5] == ["mm", "usual", "0.5", "0.5"]
    assert float(rows["screen.z_mm"][5]) == pytest.approx(592, rel=0.03)  # as of the preset on all pixels
    assert float(rows["screen.z_mm"][6]) < 5


def test_a_result_is_judged(irtscots, tmp_path):
    """A flat map: nothing but the errors, so that wide limits are met."""
    sources = {"camera.x_mm": 0.1, "screen.x_mm": 0.1}
    scene = replace(small_scene(31), name="small", budget=Budget(sources=sources))
    path, heights = tmp_path / "few.toml", tmp_path / "flat.npz"
    path.write_text(scene.to_toml())
    write_map(heights, HeightMap(np.zeros((60, 60)), pitch_mm=(scene.mirror.diameter_mm / 59,) * 2))
    code, out, err = irtscots("budget", path, "--result", heights, "--require", "3/9(9/9) RMSi<0.01", "--json")
    assert code == 0 and "the file tells no wavelength" in err
    told = json.loads(out)
    assert {one["name"]: one["verdict"] for one in told["required"]} == {
        "A": "met", "B": "met", "C": "met", "RMSi": "not decided",
    }  # fmt: skip
    assert told["required"][3]["missing_nm"] > 0 and told["zernike_nm"]["6"]["low_nm"] < 0
    code, out, _ = irtscots("budget", path, "--result", heights, "--require", "RMSi<0.01", "--wavelength-nm", "1000")
    assert code == 0 and "not decided" in out and "Zernike 6" in out and "half of 1000 nm" in out


def test_a_trial_is_simulated(irtscots, tmp_path):
    scene = replace(small_scene(31), name="few", budget=Budget(sources={"screen.z_mm": 0.1}, trials=4))
    path = tmp_path / "few.toml"
    path.write_text(scene.to_toml())
    options = ("--images", "--rays-per-pixel", "1024", "--trial", "2", "--json", "--out", tmp_path / "out")
    code, out, _ = irtscots("budget", path, *options)
    told = json.loads(out)["simulated"]
    assert code == 0 and told["trial"] == 2 and told["left_out"] == []
    assert told["simulated_nm"] == pytest.approx(told["predicted_nm"], abs=5 * told["rays_nm"])
    folder = tmp_path / "out" / "trial-2"
    assert load_scene(str(folder / "scene.toml")).name == "few-trial-2"
    with h5py.File(folder / "result.h5") as file:
        assert file["images/x"].shape == (21, 31, 31) and np.nanmax(file["images/x"][:]) > 0
    code, out, _ = irtscots("map", folder / "result.h5", "--json")
    # with the measure's own error and the noise of few rays at the rim
    assert code == 0 and told["with_rim_nm"] < json.loads(out)["rms_nm"] < 10 * told["with_rim_nm"]


@pytest.mark.parametrize("option", [("--allow-nm", "20"), ("--trials", "8"), ("--trial", "0"), ("--images",)])
def test_options_without_sources_to_act_on(irtscots, option):
    code, out, err = irtscots("budget", "sphere", *option)
    assert (code, out) == (2, "")
    assert err == f"irtscots: {option[0]}: must have a scene with error sources: give them in [budget.sources]\n"


def test_the_ledger_is_ranked_by_its_first_column(irtscots, small):
    """Piston and tilt removed: not by the tilt that is not shown."""
    out = irtscots("budget", small, "--trials", "8")[1].split("Ledger of trial 0")[1].split("sum of the maps")[0]
    shown = [
        float(line.split()[2]) for line in out.splitlines() if line.strip().startswith(("camera", "screen", "noise"))
    ]
    assert len(shown) == len(SOURCES) and shown == sorted(shown, reverse=True)


@pytest.mark.parametrize(
    "options, told",
    [
        (("--trials", "1"), "--trials = 1: must be from 2 to 1048576"),
        (("--trial", "16"), "--trial = 16: must be from 0 to 15"),
        (("--allow-nm", "0"), "--allow-nm = 0.0: must be a number above 0"),
        (("--require", "3/1"), "--require: must be given with --result"),
        (("--result", "none.h5"), "none.h5: not a readable file"),
        (("--result", "none.h5", "--require", "3/x"), "'3/x': must be 3/A(B/C)"),
        (("--result", "none.h5", "--require", " "), "--require: must have at least one limit"),
        (("--result", "none.h5", "--wavelength-nm", "500"), "--wavelength-nm: must be given with --require"),
        (("--result", "none.h5", "--trials", "5"), "--trials: must be left out with --result"),
        (("--result", "none.h5", "--trial", "0"), "--trial: must be left out with --result"),
        (("--device", "cpu"), "--device: must be given with --images"),
        (("--result", "none.h5", "--images"), "--images: must be left out with --result"),
        (("--trial", "-1"), "--trial = -1: must be from 0 to 15"),
    ],
)
def test_bad_options(irtscots, small, options, told):
    code, out, err = irtscots("budget", small, *options)
    assert (code, out) == (2, "") and told in err and err.count("\n") == 1
