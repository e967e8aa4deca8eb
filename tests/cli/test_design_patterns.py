"""The command `irtscots design-patterns`."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from scenes import coarse


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(coarse("sphere", 25).to_toml())
    return path


def test_text_files_and_the_command_that_it_names(irtscots, small, tmp_path):
    folder = tmp_path / "out"
    code, out, err = irtscots("design-patterns", small, "--frames", "16", "--read-noise", "4", "--out", folder)
    assert (code, err) == (0, "")
    assert "rms height error [nm] of 16 frames" in out and "bound of any" in out and f"results in {folder}" in out
    data = json.loads((folder / "design-patterns.json").read_text())
    assert data["camera"]["read_noise_e"] == 4.0 and data["frames"] == 16
    assert (folder / "figures" / "nm_against_periods.png").exists()
    named = data["best_fringes"]["command"].split()
    assert named[0] == "irtscots" and " ".join(named) in out
    code, out, err = irtscots(*named[1:], "--out", tmp_path / "pictures")
    assert (code, err) == (0, "") and "pictures of 21 x 21 pixels" in out


def test_json_and_a_noise_file(irtscots, small, tmp_path):
    file = tmp_path / "noise.toml"
    file.write_text(
        "[camera.detector.noise]\nelectrons_at_peak = 700.0\nshot_noise = true\nread_noise_e = 5.0\n"
        "[screen.response]\ngamma = 2.2\n"
    )
    code, out, err = irtscots("design-patterns", small, "--camera-noise", file, "--frames", "16", "--json")
    data = json.loads(out)
    assert (code, err) == (0, "") and data["camera"]["electrons_at_peak"] == 700.0 and data["screen_gamma"] == 2.2
    assert data["camera"]["electrons_per_count"] == 0.0 and data["best_fringes"]["gamma_bias_nm"] > 0


@pytest.mark.parametrize(
    "arguments, text",
    [
        (("nothing",), "nothing"),
        (("sphere", "--frames", "4"), "--frames = 4: must be from 6"),
        (("sphere", "--bits", "0"), "--bits = 0: must be from 1 to 16"),
        (("sphere", "--frame-time", "-1"), "--frame-time = -1: must be from 0"),
        (("sphere", "--ambiguity", "0"), "--ambiguity = 0: must be above 0"),
        (("sphere", "--camera-noise", "none.toml"), "none.toml"),
    ],
)
def test_refused(irtscots, arguments, text):
    code, out, err = irtscots("design-patterns", *arguments)
    assert (code, out) == (2, "") and text in err and err.count("\n") == 1


def test_no_device_is_asked_for(small):
    script = (
        "import sys; from irtscots_cl.cli import main; "
        f"code = main(['design-patterns', {str(small)!r}, '--frames', '12', '--json']); "
        "print(code, 'pyopencl' in sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stderr.strip() == "0 False"
