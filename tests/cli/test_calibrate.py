"""The command `irtscots calibrate` as its users meet it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from calibrations import measured, paraboloid, write_places

SCENE = paraboloid(21)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(SCENE.to_toml())
    m = measured(SCENE, {"camera.x_mm": 0.3, "zernike.6_um": 0.1})
    u, v = m.on_grid(m.places_mm)
    error = np.full(u.shape, 1e-3)
    write_places("places.h5", screen__x_mm=u, screen__y_mm=v, screen__x_standard_error_mm=error,
                 screen__y_standard_error_mm=error)  # fmt: skip
    return tmp_path


def test_tables_and_files(irtscots, here):
    code, out, err = irtscots("calibrate", "places.h5", "--scene", "mine.toml")
    assert (code, err) == (0, "")
    for words in ("good: the fitted set-up explains", "camera.tilt_x_rad", "standard deviation, calibration and noise"):
        assert words in out
    assert out.endswith("results in irtscots-out/paraboloid-calibrated\n")
    folder = Path("irtscots-out/paraboloid-calibrated")
    assert sorted(p.name for p in folder.iterdir()) == ["calibration.h5", "report.json", "scene.toml"]
    # the fitted scene is one to measure with, and to calibrate again
    code, out, _ = irtscots("calibrate", "places.h5", "--scene", folder / "scene.toml", "--out", "again", "--json")
    assert code == 0 and all(
        u["prior_source"] in ("irtscots calibrate", "default") for u in json.loads(out)["unknowns"]
    )


def test_json(irtscots, here):
    arguments = ("--fit", "camera,intrinsics", "--hold", "camera.z_mm", "--mirror-order", "2", "--json", "--out", "o")
    code, out, _ = irtscots("calibrate", "places.h5", "--scene", "mine.toml", *arguments)
    facts = json.loads(out)
    names = [u["name"] for u in facts["unknowns"]]
    assert code == 0 and len(names) == 5 + 3 + 3 and "camera.z_mm" not in names and "zernike.6_um" in names
    assert facts == json.loads(Path("o/report.json").read_text())


def test_a_warning_goes_to_stderr_and_with_strict_is_an_error(irtscots, here):
    arguments = ("calibrate", "places.h5", "--scene", "mine.toml", "--mirror-order", "0", "--out", "o")
    code, out, err = irtscots(*arguments)
    assert code == 0 and "irtscots: warning: mirror terms: no term of the mirror is an unknown" in err and out
    code, out, err = irtscots(*arguments[:-1], "strict", "--strict")
    assert (code, out) == (2, "") and err.count("\n") == 1 and "(--strict)" in err and not Path("strict").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--fit", "camera.roll"), "--fit, --hold: unknown 'camera.roll': did you mean camera.roll_rad?"),
        (("--hold", "zernike.3-x"), "--fit, --hold: unknown 'zernike.3-x'"),
        (("--mirror-order", "-1"), "--mirror-order = '-1': must be auto, or a whole number from 0 to 20"),
        (("--mirror-turn", "a"), "--mirror-turn = 'a': must be angles in degrees within 360, with commas between"),
        (("--mirror-turn", "0,90"), "--mirror-turn = 2 angles: must be one for each of the 1 files"),
        (("--saturation", "0"), "--saturation = 0.0: must be above 0"),
        (("--mask", "none.png"), "--mask = 'none.png': not a readable mask: "),
        (("--no-default-priors", "--fit", "camera,screen,mirror"), "no image and no prior determines"),
    ],
)
def test_arguments_that_are_wrong(irtscots, here, arguments, words):
    if arguments[0] == "--mirror-order":
        arguments = (f"--mirror-order={arguments[1]}",)
    code, out, err = irtscots("calibrate", "places.h5", "--scene", "mine.toml", "--out", "o", *arguments)
    assert (code, out) == (2, "") and err.startswith("irtscots: ") and err.count("\n") == 1 and words in err
    assert not Path("o").exists()


def test_files_that_are_wrong(irtscots, here):
    Path("list.toml").write_text('[[measurement]]\nimages = "none.h5"')
    for images, words in (("none.h5", "none.h5: not a readable HDF5 file: there is no file of that name"),
                          ("mine.toml", "mine.toml: name: unknown key; "),
                          ("list.toml", "none.h5: not a readable HDF5 file")):  # fmt: skip
        code, out, err = irtscots("calibrate", images, "--scene", "mine.toml", "--out", "o")
        assert (code, out) == (2, "") and err.count("\n") == 1 and words in err, err
        assert not Path("o").exists()


def test_an_unknown_name_in_what_is_known(irtscots, here):
    Path("mine.toml").write_text(SCENE.to_toml() + '\n[calibration.known]\n"camera.x" = 0.5\n')
    code, out, err = irtscots("calibrate", "places.h5", "--scene", "mine.toml", "--out", "o")
    assert (code, out) == (2, "") and "mine.toml: calibration.known: unknown 'camera.x': did you mean" in err


def test_the_output_must_not_replace_the_input(irtscots, here):
    Path("out").mkdir()
    Path("mine.toml").rename("out/scene.toml")
    code, _, err = irtscots("calibrate", "places.h5", "--scene", "out/scene.toml", "--out", "out")
    assert code == 2 and "out/scene.toml is there and would be replaced; must be another folder" in err


def test_a_list_of_measurements(irtscots, here):
    Path("list.toml").write_text('[[measurement]]\nimages = "places.h5"\n[[measurement]]\nimages = "places.h5"\n')
    code, out, _ = irtscots("calibrate", "list.toml", "--scene", "mine.toml", "--out", "o", "--json")
    assert code == 0 and [m["name"] for m in json.loads(out)["measurements"]] == ["places (1)", "places (2)"]
