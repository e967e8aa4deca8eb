"""`irtscots patterns`: what it writes, prints and refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from irtscots_cl import cli
from irtscots_cl.imaging.fringe_manifest import read_manifest
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
