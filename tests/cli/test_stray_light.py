"""From `irtscots paths --out` to `irtscots budget`: ghosts of a camera as an error source."""

from __future__ import annotations

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scenes import coarse, coarse_screen

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.formats.maps import write_map
from irtscots_cl.scene.error_sources import Budget
from irtscots_cl.scene.presets import load_scene, parse_scene

RAYS = 2**13


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("stray")


@pytest.fixture(scope="module")
def scene(folder):
    """The singlet with few pixels, in a file, with a budget that names the file to come."""
    scene = replace(coarse(coarse_screen(load_scene("sphere-singlet"))), name="few")
    budget = Budget(sources={"stray.ghosts": 1.0, "noise.place_mm": 1e-4}, trials=4, stray_light="out/stray-light.h5")
    (folder / "few.toml").write_text(replace(scene, budget=budget).to_toml())
    return scene


@pytest.fixture
def traced(irtscots, device, folder, scene):
    """What `irtscots paths` says and writes."""
    if not (folder / "out" / "paths.json").exists():
        options = ("--rays-per-pixel", RAYS, "--branches", "split", "--device", device.index, "--quiet", "--json")
        code, out, err = irtscots("paths", folder / "few.toml", *options, "--out", folder / "out")
        assert (code, err) == (0, "") and json.loads(out) == json.loads((folder / "out" / "paths.json").read_text())
    return json.loads((folder / "out" / "paths.json").read_text())


def test_the_file_has_all_that_was_asked_for(folder, scene, traced):
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["paths.json", "stray-light.h5"]
    (ghost,) = traced["stray_light"]
    with h5py.File(folder / "out" / "stray-light.h5") as file:
        assert file.attrs["rays_total"] == traced["rays_total"] >= RAYS * 49 and file.attrs["seed"] == 1
        assert replace(parse_scene(file.attrs["scene"]), budget=None) == scene
        assert list(file) == ["ghost"] and file["ghost"].attrs["of_direct"] == ghost["of_direct"]
        heights = file["ghost/height_nm"][()]
        errors = file["ghost/height_standard_error_nm"][()]
        assert {"version irtscots-cl", "device", "driver", "measure"} <= set(file.attrs)
    used = np.isfinite(heights)
    assert np.sqrt(np.mean(heights[used] ** 2)) == pytest.approx(ghost["height_nm_rms"], rel=1e-9)
    assert np.array_equal(np.isfinite(errors), used) and 0 < np.median(errors[used]) < 1


def test_the_budget_has_the_height_that_the_paths_tell(irtscots, folder, traced):
    """On the pixels whose chief rays meet the mirror, which are others than those half on it, by the rim."""
    code, out, err = irtscots("budget", folder / "few.toml", "--json")
    assert code == 0
    told = json.loads(out)
    nm = {one["name"]: one["nm"]["piston_tilt"] for one in told["sources"]}
    assert nm["stray.ghosts"] == pytest.approx(traced["stray_light"][0]["height_nm_rms"], rel=0.05)
    (noise,) = told["stray_light"]
    assert noise["name"] == "stray.ghosts" and 0 < noise["rays_nm"]["piston_tilt"] < 0.05 * nm["stray.ghosts"]
    filled = noise["pixels_without_value"]
    assert err.count("no value in its file") == bool(filled) and "noise of its file" not in err
    code, out, _ = irtscots("budget", folder / "few.toml")
    assert code == 0 and "by the noise of the rays of its file" in out


def test_few_rays_are_told(irtscots, folder, scene, device):
    options = ("--rays-per-pixel", 1024, "--device", device.index, "--quiet", "--out", folder / "noisy")
    code, out, _ = irtscots("paths", folder / "few.toml", *options)
    assert code == 0 and f"results in {folder / 'noisy'}" in out
    text = (folder / "few.toml").read_text().replace(f"{folder}/out/", "out/").replace("out/stray", "noisy/stray")
    (folder / "noisy.toml").write_text(text)
    flat = folder / "flat.npz"
    write_map(flat, HeightMap(np.zeros((60, 60)), pitch_mm=(scene.mirror.diameter_mm / 59,) * 2))
    for result in ((), ("--result", flat)):
        code, _, err = irtscots("budget", folder / "noisy.toml", "--json", *result)
        assert code == 0 and "nm are noise of its file's rays: trace more" in err


def test_what_cannot_be_written_is_refused_before_a_ray(irtscots, folder, scene, monkeypatch):
    monkeypatch.setattr("irtscots_cl.tracing.trace.trace_paths", lambda *_, **__: pytest.fail("traced"))
    (folder / "taken" / "stray-light.h5").mkdir(parents=True)
    for options, told in (
        (("--out", folder / "taken"), "stray-light.h5 is a folder there; must be a file"),
        (("--out", folder / "few.toml"), "few.toml is not a folder"),
        (("--measure", "best"), "--measure = 'best': must be one of paper"),
    ):
        code, out, err = irtscots("paths", folder / "few.toml", *options)
        assert (code, out) == (2, "") and told in err and err.count("\n") == 1
