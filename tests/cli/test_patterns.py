"""`irtscots patterns`: what it writes, prints and refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from irtscots_cl import cli
from irtscots_cl.imaging.fringe_manifest import read_manifest
from irtscots_cl.imaging.screen_pictures import upright_values
from irtscots_cl.scene.presets import load_scene


def run(capsys, *arguments):
    code = cli.main(["patterns", *map(str, arguments)])
    return (code, *capsys.readouterr())


def test_pictures_and_manifest(tmp_path, capsys):
    folder = tmp_path / "a" / "b"
    arguments = ("--out", folder, "--steps", 5, "--periods", 0.9, 4, "--json")
    code, out, err = run(capsys, "off-axis", *arguments)
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts["screen_pixels"] == [359, 303] and facts["periods"] == {"x": [0.9, 4.0], "y": [0.9, 4.0]}
    manifest = read_manifest(folder / "manifest.toml", load_scene("off-axis"))
    assert [frame.picture for frame in manifest.frames] == facts["pictures"] and len(manifest.frames) == 2 + 2 * 10
    assert sorted(p.name for p in folder.iterdir()) == sorted([*facts["pictures"], "manifest.toml"])
    # every picture by its manifest line alone
    for frame in manifest.frames:
        with Image.open(folder / frame.picture) as file:
            values = np.asarray(file)
        assert values.shape == (303, 359) and values.dtype == np.uint8
        if frame.shows == "fringes":
            along = values[0, ::-1] if frame.axis == "x" else values[::-1, 0]
            s = (np.arange(along.size) + 0.5) / along.size
            wanted = 127.5 + 127.5 * np.cos(2 * np.pi * frame.periods * s - np.radians(frame.step_deg))
            assert np.abs(along - wanted).max() <= 0.501


def test_text_says_what_to_do_next(tmp_path, capsys):
    code, out, err = run(capsys, "sphere", "--out", tmp_path)
    assert (code, err) == (0, "")
    assert "x fringes: 0.9, 2.46 periods over the screen, 4 steps each" in out
    assert f"irtscots reconstruct {tmp_path} --scene sphere" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--levels", 9), "--levels = 9: must be 8 or 16 (bits)"),
        (("--steps", 2), "--steps = 2: must be at least 3 and at most 64"),
        (("--periods", 11), "--periods = 11: must be above 0 and at most 10.5"),
        (("--periods", "nan"), "--periods = nan: must be above 0"),
        (("--periods", 1, 1), "--periods = 1 1: must differ"),
        (("--kind", "lines", "--steps", 4), "--steps: goes with --kind sinusoid or gray-phase, not with --kind lines"),
        (("--line-width", 2), "--line-width: goes with --kind lines, not with --kind sinusoid"),
        (("--kind", "gray-phase", "--periods", 2, 3), "--periods = 2 3: must be one for --kind gray-phase"),
        (("--kind", "gray-phase", "--periods", 0.9), "x fringes of 0.9 periods over the screen need no Gray code"),
        (("--kind", "gray", "--single-planes", "--dark-at"), "--single-planes: needs dark and white frames"),
        (("--kind", "lines", "--line-step", 0), "lines: step = 0 pixels: must be above 0"),
        (("--kind", "lines", "--line-step", 0.01), "lines: 1, 0.01, 0 pixels: must be multiples of 1/n of a pixel"),
        (("--kind", "gray", "--gray-cell", 50), "Gray code: cells = 0.42: must be above 1"),
        (("--kind", "dots", "--dot-pitch", 1), "dots: diameter 2, pitch 1 pixels: must be above 0"),
        (
            (
                "--kind",
                "pictures",
            ),
            "--pictures: must name the files",
        ),
        (("--dark-frames", 0), "--dark-frames = 0: must be from 1 to 1000"),
    ],
)
def test_refused_with_one_line(tmp_path, capsys, arguments, said):
    code, out, err = run(capsys, "sphere", "--out", tmp_path / "new", *arguments)
    assert (code, out) == (2, "") and err.startswith("irtscots: " + said) and err.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_a_file_in_the_folder_s_place_is_refused(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    code, _, err = run(capsys, "sphere", "--out", tmp_path / "file")
    assert code == 2 and "is not a folder" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("kind", "options", "count", "said"),
    [
        ("lines", ("--line-width", 1.5, "--line-step", 0.5), 2 + 2 * 40, "lines along x, y: 40, 40, 1.5 pixels wide"),
        ("gray", ("--single-planes",), 2 + 2 * 3, "x Gray code: 7 cells in 3 planes"),
        ("gray-phase", (), 2 + 2 * (2 * 2 + 4), "x fringes: 2.46 periods over the screen, 4 steps each"),
        ("dots", ("--dot-shifts", 2), 2 + 4, "dots of 2 pixels, 10 pixels apart, 4 frames"),
    ],
)
def test_other_kinds(tmp_path, capsys, kind, options, count, said):
    """Each picture holds what its frame says, to half a level; people are told the numbers."""
    code, out, err = run(capsys, "sphere", "--kind", kind, "--out", tmp_path, *options, "--order", "interleaved")
    assert (code, err) == (0, "") and said in out and f"{count} pictures of 21 x 21 pixels" in out
    scene = load_scene("sphere")
    for frame in read_manifest(tmp_path / "manifest.toml", scene).frames:
        with Image.open(tmp_path / frame.picture) as file:
            values = np.asarray(file)[::-1, ::-1] / 255
        assert np.abs(values - upright_values(frame, scene)).max() <= 0.501 / 255
        assert frame.shows in ("dark", "white") or values.any()


def test_pictures_of_the_users(tmp_path, capsys):
    values = np.random.default_rng(1).random((2, 21, 21))
    for k, one in enumerate(values):
        np.save(tmp_path / f"p{k}.npy", one)
    files = [tmp_path / f"p{k}.npy" for k in (1, 0)]
    code, out, _ = run(
        capsys, "sphere", "--kind", "pictures", "--out", tmp_path / "o", "--levels", 16, "--pictures", *files
    )
    assert code == 0 and "2 pictures of yours" in out and "reconstruct" not in out
    for name, wanted in (("2-picture.png", values[1]), ("3-picture.png", values[0])):
        with Image.open(tmp_path / "o" / name) as file:
            assert np.abs(np.asarray(file) / 65535 - wanted).max() < 1e-5
