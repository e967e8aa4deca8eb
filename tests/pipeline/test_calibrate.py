"""Calibrating from files: two passes over images, what is written, what is refused."""

from __future__ import annotations

import json
import tomllib
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np
import pytest
from calibrations import inner_pixels, measured, paraboloid, write_places
from noisy_images import Images, images_of, small

from irtscots_cl.calibration.calibrate import FITTED, Unknowns
from irtscots_cl.calibration.jacobian import design_centroids
from irtscots_cl.calibration.measured import Measurement
from irtscots_cl.calibration.parameters import moved
from irtscots_cl.pipeline import calibrate as module
from irtscots_cl.pipeline.calibrate import FILES, calibrate_files
from irtscots_cl.pipeline.measurement_list import planned
from irtscots_cl.scene.model import Scene

SCENE = small(25).nominal()
TRUE = {"camera.x_mm": 0.4, "camera.tilt_y_rad": 1e-3, "screen.clocking_rad": -1e-3, "zernike.6_um": 0.1}
PLAIN = Unknowns(FITTED)


@lru_cache
def images() -> Images:
    return images_of(moved(SCENE, TRUE)).noisy(0.002, 3)


def write_images(path: Path) -> Path:
    of = images()
    with h5py.File(path, "w") as file:
        file["images/x"], file["images/y"], file["lines/x_mm"], file["lines/y_mm"] = of.x, of.y, of.lines_x, of.lines_y
    return path


def write_measured(path: Path, m: Measurement) -> Path:
    u, v = m.on_grid(m.places_mm)
    error = m.on_grid(m.errors_mm)[0]
    write_places(path, screen__x_mm=u, screen__y_mm=v, screen__x_standard_error_mm=error,
                 screen__y_standard_error_mm=error)  # fmt: skip
    return path


def test_images_give_a_scene_that_measures_the_mirror(tmp_path):
    out = tmp_path / "out"
    facts = calibrate_files(planned([write_images(tmp_path / "lab.h5")], SCENE), SCENE, out, PLAIN)
    assert sorted(p.name for p in out.iterdir()) == sorted(FILES)
    assert facts["verdict"].startswith("good") and facts["mirror_order"] == 4
    assert json.loads((out / "report.json").read_text())["verdict"] == facts["verdict"]
    for unknown in facts["unknowns"]:
        assert abs(unknown["value"] - TRUE.get(unknown["name"], 0.0)) < 5 * unknown["standard_error"]  # 1e-5 of 24
    term = next(t for t in facts["zernike"] if t["noll"] == 6)
    assert abs(term["after_um"] - 0.1) < 5 * term["standard_error_um"] + 1e-3
    scene = Scene.from_dict(tomllib.loads((out / "scene.toml").read_text()))
    fitted = {u["name"]: u["value"] for u in facts["unknowns"] if not u["name"].startswith("zernike")}
    assert (scene.camera, scene.screen) == (moved(SCENE, fitted).camera, moved(SCENE, fitted).screen)
    with h5py.File(out / "calibration.h5") as file:
        names = file["unknowns/name"].asstr()[()].tolist()
        assert names == [u["name"] for u in facts["unknowns"]]
        np.testing.assert_allclose(file["unknowns/covariance"][()], facts["covariance"])
        residual, error = (file[f"measurement/1/residual/{n}"][()] for n in ("x_mm", "x_standard_error_mm"))
        used = file["measurement/1/used"][()]
        assert residual.shape == (25, 25) and np.isfinite(residual[used]).all() and used.sum() > 150
        assert 0.7 < np.std(residual[used] / error[used]) < 1.3
        assert np.isfinite(file["height/standard_deviation_nm"][()][np.isfinite(file["height/after_nm"][()])]).all()
        assert file["height/after_nm"].attrs["unit"] == "nm"


def test_the_light_is_modelled_with_the_geometry_of_a_first_fit(tmp_path, monkeypatch):
    guesses, read = [], module.from_file
    monkeypatch.setattr(module, "from_file", lambda *a, **k: (guesses.append(a[2]), read(*a, **k))[1])
    calibrate_files(planned([write_images(tmp_path / "lab.h5")], SCENE), SCENE, tmp_path / "out", PLAIN)
    believed, guess = guesses
    assert believed == SCENE and guess.mirror.zernike
    inside = inner_pixels(SCENE).ravel()
    true, first, second = (design_centroids(s, SCENE)[:, inside] for s in (moved(SCENE, TRUE), believed, guess))
    assert np.std(second - true) < 0.02 * np.std(first - true)


def test_several_files_with_the_mirror_turned(tmp_path):
    scene = paraboloid(21)
    figure, turned = {"zernike.5_um": 0.2}, {"zernike.5_um": -0.2}
    for name, terms, seed in (("a", figure, 1), ("b", turned, 2)):
        write_measured(tmp_path / f"{name}.h5", measured(scene, terms, seed))
    paths = [tmp_path / "a.h5", tmp_path / "b.h5"]
    facts = calibrate_files(planned(paths, scene, [0.0, 90.0]), scene, tmp_path / "out", PLAIN)
    assert [m["name"] for m in facts["measurements"]] == ["a (1)", "b (2)"] and facts["verdict"].startswith("good")
    (term,) = (t for t in facts["zernike"] if t["noll"] == 5)
    assert abs(term["after_um"] - 0.2) < 5 * term["standard_error_um"] < 0.1


def test_strict_refuses_what_is_doubtful(tmp_path):
    scene = paraboloid(21)
    write_measured(tmp_path / "a.h5", measured(scene, {"camera.k1": 0.5}))
    plans = planned([tmp_path / "a.h5"], scene)
    facts = calibrate_files(plans, scene, tmp_path / "out", PLAIN)
    assert facts["verdict"].startswith("the model does not explain the data")
    with pytest.raises(ValueError, match=r"chi-square: .*camera\.k1.*\(--strict\)$"):
        calibrate_files(plans, scene, tmp_path / "strict", PLAIN, strict=True)
    assert not (tmp_path / "strict").exists()


def test_a_failed_write_leaves_no_report(tmp_path, monkeypatch):
    scene = paraboloid(21)
    write_measured(tmp_path / "a.h5", measured(scene, {}))
    plans = planned([tmp_path / "a.h5"], scene)
    calibrate_files(plans, scene, tmp_path / "out", PLAIN)
    monkeypatch.setattr("irtscots_cl.pipeline.calibrate.write_calibration", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        calibrate_files(plans, scene, tmp_path / "out", PLAIN)
    assert not (tmp_path / "out" / "report.json").exists()
