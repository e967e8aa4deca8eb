"""From a folder of camera images to the mirror: a laboratory's round trip through files, and what goes wrong in it."""

from __future__ import annotations

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from fringe_folders import recorded, stored_as

import irtscots_cl as irt
from irtscots_cl import cli
from irtscots_cl.imaging.fringe_manifest import manifest_text
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.optics.setup import Setup

SETS = tuple(FringeSet.equal(axis, (0.9, 2.46), 4) for axis in "xy")
pytestmark = pytest.mark.needs_device


@pytest.fixture(scope="module")
def scene():
    return irt.load_scene("sphere-deviated")


@pytest.fixture(scope="module")
def run(scene):
    return irt.trace(scene, estimator="analytic")


@pytest.fixture(scope="module")
def noisy(run, scene):
    return recorded(run, scene, SETS)


def measured(folder, scene, capsys, *arguments):
    """(exit code, facts or None, stderr) of the command on a folder."""
    (folder / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    given = arguments or (folder,)
    out = ("--scene", folder / "scene.toml", "--out", folder / "out", "--json")
    code = cli.main(["reconstruct", *map(str, (*given, *out))])
    printed, err = capsys.readouterr()
    return code, json.loads(printed) if printed else None, err


def height_error_nm(folder, scene):
    """rms of the height's error without piston and tilt, and the stated one."""
    word = scene.camera.detector.orientation
    with h5py.File(folder / "out" / "result.h5") as file:
        x, y, height, error = (
            upright(file[name][()], word)
            for name in ("mirror/x_mm", "mirror/y_mm", "deviation_nm", "height_standard_error_nm")
        )
        mask = upright(file["mask"][()], word)
        assert file.attrs["orientation"] == word
    true_nm = Setup(scene).chief_rays.surface.deviation_at(x, y)[0] * 1e6
    return rms(remove_terms(x, y, height - true_nm, mask, "piston_tilt"), mask), rms(error, mask)


def test_clean_fringes_are_as_good_as_fine_line_scans(run, scene, tmp_path, capsys):
    """From 8-bit pictures and 12-bit images, whose rounding is all that is left: 0.045 nm, stated 0.048 nm.

    The `fine` line scan leaves 0.015 nm without rounding, fringes 0.013 nm without it.
    """
    recorded(run, scene, SETS, noise=False).write(tmp_path)
    code, facts, err = measured(tmp_path, scene, capsys)
    assert (code, err) == (0, "") and {c["level"] for c in facts["checks"]} == {"ok"}
    error, stated = height_error_nm(tmp_path, scene)
    assert error < 0.06 and 0.7 < error / stated < 1.3  # rounding is no white noise
    assert sum(facts["fringes"]["excluded"].values()) == facts["fringes"]["excluded"]["used"] == facts["pixels_used"]


@pytest.mark.parametrize(("word", "kind", "bits"), [("quarter-turn", "tif", 12), ("columns-reversed", "png", 8)])
def test_noisy_files_in_a_stored_orientation(run, scene, tmp_path, capsys, word, kind, bits):
    """Height within its stated error. A height's error is mostly its lowest terms: 9 numbers make 24 % of scatter."""
    turned = stored_as(scene, word)
    recorded(run, turned, SETS, bits=bits, seed=5).write(tmp_path, kind)
    code, facts, err = measured(tmp_path, turned, capsys)
    assert code == 0 and err == ""
    error, stated = height_error_nm(tmp_path, turned)
    assert 0.4 < error / stated < 1.7  # 3 sigma of that scatter
    assert stated == pytest.approx(facts["height_standard_error_nm"]) and 1 < stated < 6
    for name in ("copies", "frames", "fringes", "orientation", "pixels", "modulation x", "saturation"):
        assert next(c for c in facts["checks"] if c["name"] == name)["level"] == "ok"
    assert {p.name for p in (tmp_path / "out" / "figures").iterdir()} >= {"quality.png", "height.png"}
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        for name in ("screen/x_mm", "screen/y_standard_error_mm", "modulation", "excluded"):
            assert file[name].shape == (125, 125)
        assert file["fringes/x_residual"].shape == (2, 125, 125)


def test_another_orientation_is_named(noisy, scene, tmp_path, capsys):
    """The scene says upright, the files are turned by a quarter."""
    turned = replace(noisy, frames=np.ascontiguousarray(np.rot90(noisy.frames, axes=(1, 2))))
    turned.write(tmp_path)
    code, facts, err = measured(tmp_path, scene, capsys)
    assert (code, facts) == (2, None) and "orientation" in err and "camera.detector.orientation" in err


@pytest.mark.parametrize(
    ("order", "said"),
    [
        (
            {4: 5, 5: 4},
            ("image 5 (IMG_5.tif) shows x fringes of 0.9 periods at 270 degrees, not", "image 6 (IMG_6.tif)"),
        ),
        ({6: 8, 8: 6}, ("image 7 (IMG_7.tif) shows x fringes of 2.46 periods at 180 degrees, not", "image 9")),
        ({7: 12, 12: 7}, ("image 8 (IMG_8.tif) shows y fringes of 0.9 periods at 180 degrees", "image 13")),
    ],
)
def test_swapped_frames_are_named(noisy, scene, tmp_path, capsys, order, said):
    numbers = [order.get(k, k) for k in range(len(noisy.frames))]
    replace(noisy, frames=noisy.frames[numbers]).write(tmp_path)
    code, facts, err = measured(tmp_path, scene, capsys)
    assert (code, facts) == (2, None) and err.count("\n") == 1
    for part in said:
        assert part in err
    assert not (tmp_path / "out").exists()


def test_a_repeated_frame_is_named(run, noisy, scene, tmp_path, capsys):
    """A copy, and the same frame recorded twice with noise of its own."""
    copy, again = noisy.frames.copy(), noisy.frames.copy()
    copy[9] = copy[8]
    again[9] = recorded(run, scene, SETS, seed=99).frames[8]
    for name, frames, said in (
        ("copy", copy, "copies: image 10 (IMG_10.tif) is the same image as image 9 (IMG_9.tif)"),
        ("again", again, "image 10 (IMG_10.tif) shows x fringes of 2.46 periods at 180 degrees, not"),
    ):
        replace(noisy, frames=frames).write(tmp_path / name)
        code, facts, err = measured(tmp_path / name, scene, capsys)
        assert (code, facts) == (2, None) and said in err


def test_a_missing_frame_is_named(noisy, scene, tmp_path, capsys):
    noisy.write(tmp_path)[6].unlink()
    code, facts, err = measured(tmp_path, scene, capsys)
    assert (code, facts) == (2, None)
    assert "17 images" in err and "IMG_7.tif (x fringes of 2.46 periods at 0 degrees) is missing" in err


def test_the_manifest_may_lie_elsewhere_or_name_its_images(noisy, scene, tmp_path, capsys):
    paths = noisy.write(tmp_path, manifest=False)
    table = tmp_path / "m.toml"
    table.write_text(manifest_text(noisy.manifest, "1"), encoding="utf-8")
    code, facts, err = measured(tmp_path, scene, capsys, tmp_path / "camera")
    assert code == 2 and "no manifest.toml in it" in err
    code, facts, _ = measured(tmp_path, scene, capsys, *paths, "--manifest", table)
    assert code == 0
    # shuffled names, told frame by frame; the dark frame was not recorded
    names = [f"camera/{path.name}" for path in paths]
    turn = np.random.default_rng(3).permutation(np.arange(1, len(paths)))
    frames = tuple(replace(noisy.manifest.frames[k], image=names[k]) for k in turn)
    table.write_text(manifest_text(replace(noisy.manifest, frames=frames), "1"), encoding="utf-8")
    code, shuffled, _ = measured(tmp_path, scene, capsys, table)
    assert code == 0 and shuffled["pixels_used"] == facts["pixels_used"]
    assert shuffled["deviation_nm_rms"]["piston_tilt"] == pytest.approx(facts["deviation_nm_rms"]["piston_tilt"], 1e-3)


def test_masked_pixels_are_counted(noisy, scene, tmp_path, capsys):
    noisy.write(tmp_path)
    use = np.ones(noisy.frames.shape[1:], np.uint8)
    use[60:64, 40:50] = 0
    np.save(tmp_path / "use.npy", use)
    code, facts, _ = measured(tmp_path, scene, capsys, tmp_path, "--mask", tmp_path / "use.npy")
    assert code == 0 and facts["fringes"]["excluded"]["masked"] == 40
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        assert not file["mask"][()][60:64, 40:50].any() and (file["excluded"][()][60:64, 40:50] == 1).all()


def test_saturated_samples_are_found_left_out_and_named(run, scene, tmp_path, capsys):
    """12-bit counts in files of 16 bits: the ceiling of 4095 is found from the images. --strict refuses them."""
    recorded(run, scene, SETS, exposure=1.15).write(tmp_path)
    code, facts, err = measured(tmp_path, scene, capsys)
    assert code == 0 and "saturation" in err and "4095" in err
    error, stated = height_error_nm(tmp_path, scene)
    assert error < 3 * stated
    code, facts, err = measured(tmp_path, scene, capsys, tmp_path, "--strict")
    assert (code, facts) == (2, None) and "(--strict)" in err
