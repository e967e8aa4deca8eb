"""From the pictures of `irtscots patterns` to the mirror, through files: lines, Gray codes, dots, any order of time."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from pattern_folders import height_error_nm, record, small_scene

import irtscots_cl as irt
from irtscots_cl import cli

pytestmark = pytest.mark.needs_device


@pytest.fixture(scope="module")
def scene():
    return small_scene()


@pytest.fixture(scope="module")
def run(scene):
    return irt.trace(scene, estimator="analytic")


def folder_of(tmp_path, scene, *arguments):
    """The folder of `irtscots patterns` with the scene's file beside it."""
    (tmp_path / "s.toml").write_text(scene.to_toml(), encoding="utf-8")
    folder = tmp_path / "shown"
    assert cli.main(["patterns", str(tmp_path / "s.toml"), "--out", str(folder), *map(str, arguments)]) == 0
    return folder


def measured(folder, capsys, *arguments):
    """(exit code, facts or None, stderr) of `irtscots reconstruct` on a folder."""
    capsys.readouterr()
    given = (folder, "--scene", folder.parent / "s.toml", "--out", folder / "out", "--json", *arguments)
    code = cli.main(["reconstruct", *map(str, given)])
    printed, err = capsys.readouterr()
    return code, json.loads(printed) if printed else None, err


def level(facts, name):
    return next(check["level"] for check in facts["checks"] if check["name"] == name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "limit_nm"),
    [
        ((), 0.5),  # 0.09 without whole counts
        (("--line-width", 1, "--line-step", 0.5, "--levels", 16), 0.7),  # 131 were grey pixels taken for sharp lines
    ],
)
def test_clean_lines_reach_the_line_scan_s_accuracy(run, scene, tmp_path, capsys, options, limit_nm):
    """Whole counts of a 12-bit camera are all that is wrong with them; peak: of a line, not of a white screen."""
    folder = folder_of(tmp_path, scene, "--kind", "lines", *options, "--white-at")
    record(run, scene, folder, noise=0.0)
    code, facts, err = measured(folder, capsys)
    assert (code, err) == (0, "") and facts["measure"] == "likelihood" and facts["pixels_used"] >= 360
    error, _ = height_error_nm(folder / "out" / "result.h5", scene)
    assert error < limit_nm


@pytest.mark.slow
def test_noisy_lines_interleaved_with_dark_frames_in_between(run, scene, tmp_path, capsys):
    """Height as stated, within the scatter of its lowest terms; the order of time changes nothing."""
    options = ("--kind", "lines", "--order", "interleaved", "--dark-at", "start", "between", "end", "--dark-frames", 2)
    folder = folder_of(tmp_path, scene, *options, "--white-at")
    paths = record(run, scene, folder, seed=4)
    assert len(paths) == 6 + 42
    code, facts, err = measured(folder, capsys)
    assert (code, err) == (0, "")
    error, stated = height_error_nm(folder / "out" / "result.h5", scene)
    assert 0.4 < error / stated < 1.7 and stated < 20
    for option in (("--measure", "windowed"), ("--mask", mask_of(tmp_path))):
        code, other, _ = measured(folder, capsys, *option)
        assert code == 0 and other["pixels_used"] <= facts["pixels_used"]
    assert other["pixels_used"] == facts["pixels_used"] - 8


def mask_of(tmp_path):
    use = np.ones((24, 24), np.uint8)
    use[10:12, 10:14] = 0
    np.save(tmp_path / "use.npy", use)
    return tmp_path / "use.npy"


@pytest.mark.slow
def test_lines_that_were_not_recorded_are_missing_samples(run, scene, tmp_path, capsys):
    folder = folder_of(tmp_path, scene, "--kind", "lines", "--white-at")
    paths = record(run, scene, folder, seed=2)
    text = (folder / "manifest.toml").read_text(encoding="utf-8").splitlines()
    for k in (1 + 8, 1 + 21 + 12):  # a line of x, one of y
        paths[k].unlink()
        text = [line for line in text if f'"{k:02d}-' not in line]
    (folder / "manifest.toml").write_text("\n".join(text), encoding="utf-8")
    code, _, _ = measured(folder, capsys)
    assert code == 0
    error, stated = height_error_nm(folder / "out" / "result.h5", scene)
    assert 0.4 < error / stated < 1.7


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--gray-cell", 1), ("--single-planes", "--gray-cell", 2)])
def test_gray_codes_have_the_stated_errors(run, scene, tmp_path, capsys, options):
    """Height within the scatter of its lowest terms; cells as fine as a pixel are below the light's width."""
    folder = folder_of(tmp_path, scene, "--kind", "gray", *options)
    record(run, scene, folder, seed=3)
    code, facts, err = measured(folder, capsys)
    assert (code, err) == (0, "") and facts["measure"] == "gray" and facts["pixels_used"] == 364
    error, stated = height_error_nm(folder / "out" / "result.h5", scene)
    assert 0.4 < error / stated < 1.7 and stated < 30
    assert facts["places"]["pixels_with_wrong_cell"] < 1e-6
    assert {level(facts, name) for name in ("gray frames", "gray model", "orientation", "outline", "pixels")} == {"ok"}


def test_clean_gray_code(run, scene, tmp_path, capsys):
    """Left: what 24 pixels over the mirror cost by the integration, 1.0 nm, and whole counts."""
    folder = folder_of(tmp_path, scene, "--kind", "gray")
    record(run, scene, folder, noise=0.0)
    code, _, _ = measured(folder, capsys)
    error, _ = height_error_nm(folder / "out" / "result.h5", scene)
    assert code == 0 and error < 3


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--periods", 3.4, "--single-planes", "--order", "interleaved")])
def test_gray_and_phase(run, scene, tmp_path, capsys, options):
    folder = folder_of(tmp_path, scene, "--kind", "gray-phase", *options)
    record(run, scene, folder, seed=6)
    code, facts, err = measured(folder, capsys)
    assert (code, err) == (0, "") and facts["pixels_used"] == 364
    error, stated = height_error_nm(folder / "out" / "result.h5", scene)
    assert 0.4 < error / stated < 1.7 and stated < 30
    assert facts["fringes"]["pixels_with_wrong_order"] < 1e-3
    assert level(facts, "gray frames") == level(facts, "frames") == "ok"
    with h5py.File(folder / "out" / "result.h5") as file:
        assert np.nanmax(file["fringes/x_wrong_order_probability"]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gray", "gray-phase"])
def test_swapped_planes_are_named(run, scene, tmp_path, capsys, kind):
    folder = folder_of(tmp_path, scene, "--kind", kind, "--single-planes")
    paths = record(run, scene, folder)
    first, second = paths[2].read_bytes(), paths[3].read_bytes()
    paths[2].write_bytes(second)
    paths[3].write_bytes(first)
    code, facts, err = measured(folder, capsys)
    assert (code, facts) == (2, None) and err.count("\n") == 1
    assert "image 3 (IMG_3.tif) shows plane 1 of the x Gray code, not plane 0 of the x Gray code" in err


@pytest.mark.slow
def test_dots(tmp_path, capsys):
    """A smaller aperture keeps the dots of this screen apart. Places at the dots have the stated errors: the mirror is
    the design, so that each is 0. Limit: 4 standard errors of some 50 pulls, and a fifth
    for windows of whole pixels."""
    scene = small_scene("sphere", 32, aperture_diameter_mm=0.3)
    run = irt.trace(scene, estimator="adjoint", rays_per_pixel=2**14, seed=1)
    folder = folder_of(tmp_path, scene, "--kind", "dots", "--dot-shifts", 4)
    record(run, scene, folder, noise=3.0)
    code, facts, err = measured(folder, capsys)
    assert code == 0 and level(facts, "dots") == "warning" and "interpolated" in err
    with h5py.File(folder / "out" / "result.h5") as file:
        found = {name: values[()] for name, values in file["dots"].items()}
    pulls = np.concatenate(
        [(found[f"{a}_mm"] - found[f"design_{a}_mm"]) / found[f"{a}_standard_error_mm"] for a in "xy"]
    )
    assert facts["places"]["dots"]["matched"] == len(found["x_mm"]) > 15
    assert abs(pulls.mean()) < 4 / np.sqrt(len(pulls)) + 0.2 and 0.5 < pulls.std() < 2
    assert 1 < facts["places"]["distance_px"]["median"] < facts["places"]["distance_px"]["farthest"] < 6
    code, facts, err = measured(folder, capsys, "--strict")
    assert (code, facts) == (2, None) and "(--strict)" in err


def test_pictures_measure_nothing(scene, tmp_path, capsys):
    np.save(tmp_path / "p.npy", np.random.default_rng(1).random((21, 21)))
    folder = folder_of(tmp_path, scene, "--kind", "pictures", "--pictures", tmp_path / "p.npy")
    code, facts, err = measured(folder, capsys)
    assert (code, facts) == (2, None) and "frames: show pictures, which tell no places" in err


def test_options_of_line_scans_are_refused_for_others(scene, tmp_path, capsys):
    folder = folder_of(tmp_path, scene, "--kind", "gray")
    code, _, err = measured(folder, capsys, "--measure", "fine")
    assert code == 2 and "--measure: is of line scans; IMAGES is no line scan" in err
