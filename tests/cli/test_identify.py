"""The command `irtscots identify`."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest


@pytest.fixture
def small(tmp_path):
    """A scene of few pixels, with a table of what is known."""
    from dataclasses import replace

    from irtscots_cl.scene.calibration_known import Calibration
    from irtscots_cl.scene.presets import load_scene

    scene = load_scene("sphere")
    detector = replace(scene.camera.detector, pixels=(41, 41), pitch_mm=0.037 * 125 / 41)
    known = Calibration(known={"camera to screen": 0.02, "camera.x_mm": 0.1})
    scene = replace(scene, name="small", camera=replace(scene.camera, detector=detector), calibration=known)
    path = tmp_path / "small.toml"
    path.write_text(scene.to_toml())
    return path


def test_json(irtscots, small):
    code, out, err = irtscots("identify", small, "--json")
    assert (code, err) == (0, "")
    data = json.loads(out)
    assert data["scene"] == "small" and data["distances"] == [{"name": "camera to screen", "prior_mm": 0.02}]
    assert next(u for u in data["unknowns"] if u["name"] == "camera.x_mm")["prior"] == 0.1
    assert {"sources", "directions", "alike", "zernikes", "measures", "plan"} <= data.keys()
    assert data["centroid_standard_error_mm"] == pytest.approx(0.002)


def test_text_and_files(irtscots, small, tmp_path):
    folder = tmp_path / "out"
    code, out, err = irtscots("identify", small, "--out", folder, "--noise-um", "5", "--orders", "4")
    assert (code, err) == (0, "")
    assert "small: rms height error [nm]" in out and "What to measure next" in out and f"results in {folder}" in out
    data = json.loads((folder / "identify.json").read_text())
    assert [z["noll"] for z in data["zernikes"]] == list(range(4, 16))
    assert data["centroid_standard_error_mm"] == pytest.approx(0.005)
    assert sorted(str(p.relative_to(folder)) for p in folder.rglob("*.*")) == [
        "figures/weak_directions.png", "identify.json",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "arguments, text",
    [
        (("nothing",), "nothing"),
        (("sphere", "--noise-um", "0"), "--noise-um = 0.0: must be a number above 0"),
        (("sphere", "--noise-um", "nan"), "--noise-um = nan: must be a number above 0"),
        (("sphere", "--orders", "3"), "--orders = 3: must be from 4 to 20"),
    ],
)
def test_bad_input_is_refused_in_one_line(irtscots, arguments, text):
    code, out, err = irtscots("identify", *arguments)
    assert (code, out) == (2, "")
    assert text in err and err.count("\n") == 1


def test_an_unknown_name_in_the_scene_is_refused(irtscots, small):
    small.write_text(small.read_text().replace("camera.x_mm", "camera.w_mm"))
    code, _, err = irtscots("identify", small)
    assert code == 2 and "scene small: calibration.known: unknown 'camera.w_mm': did you mean" in err


def test_no_device_is_needed(small):
    """Neither OpenCL nor its Python package is loaded."""
    script = f"import sys; from irtscots_cl.cli import main; code = main(['identify', {str(small)!r}, '--json'])"
    script += "; print(code, 'pyopencl' in sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "0 False"
