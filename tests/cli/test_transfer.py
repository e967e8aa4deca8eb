"""The command `irtscots transfer`."""

from __future__ import annotations

import json
import subprocess
import sys

import h5py
import numpy as np
import pytest
from scenes import coarse
from scipy.ndimage import gaussian_filter


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(coarse("sphere", 25).nominal().to_toml())
    return path


@pytest.fixture
def result(tmp_path):
    """A result.h5 of random heights on the pixels of `small`."""
    from irtscots_cl.optics.chief_rays import ChiefRays

    footprint = ChiefRays(coarse("sphere", 25).nominal()).footprint
    on = footprint.coverage > 0.5
    smooth = gaussian_filter(np.random.default_rng(1).normal(0, 9.0, on.shape), 1.0)
    heights = np.where(on, smooth, np.nan)
    path = tmp_path / "result.h5"
    with h5py.File(path, "w") as file:
        file["deviation_nm"] = heights
        file["mirror/x_mm"], file["mirror/y_mm"] = (np.where(on, v, np.nan) for v in (footprint.x_mm, footprint.y_mm))
        file["height_standard_error_nm"] = np.where(on, 1.0, np.nan)
    return path


def test_json(irtscots, small):
    code, out, _ = irtscots("transfer", small, "--json", "--periods", "200,120", "--ripple", "3", "--direction", "30")
    assert code == 0
    data = json.loads(out)
    assert data["scene"] == "sphere" and data["measure"] == "paper" and data["integration_method"] == "southwell"
    assert [w["period_mm"] for w in data["waves"]] == [200.0, 120.0]
    wave = data["waves"][1]
    assert wave["seen_nm"] == pytest.approx(3 * wave["height"])
    assert wave["height"] == pytest.approx(wave["slope"] * wave["integration"])
    assert wave["height_over_mirror"]["min"] <= wave["height"] <= wave["height_over_mirror"]["max"]
    assert wave["phase_rad"] == 0.0 and not wave["aliased"]
    assert data["nyquist_period_mm"]["x"] == pytest.approx(2 * data["pixel_mm"]["column"][0])
    assert 1 < data["half_response_period_mm"]["x"] / data["nyquist_period_mm"]["x"] < 2
    assert data["half_response_period_mm"]["direction"] < data["half_response_period_mm"]["x"]


def test_text_and_files(irtscots, small, tmp_path):
    folder = tmp_path / "out"
    code, out, err = irtscots("transfer", small, "--frequencies", "0.006,0.015", "--ripple", "3", "--out", folder)
    assert code == 0
    assert "a 166.7 mm ripple of 3 nm would be seen as 1." in out and "an alias" in out and "half response at" in out
    assert "warning: waves shorter than the grid shows are seen as longer ones" in err
    assert json.loads((folder / "transfer.json").read_text())["waves"][1]["aliased"]
    assert (folder / "figures" / "transfer.png").stat().st_size > 10000


def test_a_result_s_spectrum_is_corrected(irtscots, small, result, tmp_path):
    folder = tmp_path / "out"
    code, out, _ = irtscots("transfer", small, "--psd", result, "--measure", "fine", "--out", folder)
    assert code == 0 and "Power spectral density over all directions, noise subtracted" in out
    psd = json.loads((folder / "transfer.json").read_text())["psd"]
    assert len({len(psd[k]) for k in ("frequency_per_mm", "response", "corrected_nm2_mm2", "aliased")}) == 1
    assert psd["corrected_nm2_mm2"][0] is None  # next to frequency 0
    known = [k for k, value in enumerate(psd["corrected_nm2_mm2"]) if value is not None]
    assert known and all(psd["response"][k] > 0.1 for k in known)


def test_a_map_s_spectrum_too_and_what_is_not_known_is_said(irtscots, small, tmp_path):
    path = tmp_path / "map.npz"
    heights = np.random.default_rng(2).normal(0, 1e-6, (24, 24))
    np.savez(path, heights_mm=heights, pitch_mm=[48.0, 48.0], wavefront=0)
    code, out, err = irtscots("transfer", small, "--psd", path)
    assert code == 0 and "noise included" in out
    assert "what a change of its grid did is not known" in err


def test_low_orders_that_leak_are_named_and_can_be_removed(irtscots, small, tmp_path):
    path = tmp_path / "map.npz"
    x, y = np.meshgrid(*[(np.arange(24) - 11.5) * 48.0] * 2)
    fine = np.random.default_rng(2).normal(0, 1e-8, x.shape)
    heights = np.where(np.hypot(x, y) < 580, fine + 3e-4 * (x * x + y * y) / 580**2, np.nan)
    np.savez(path, heights_mm=heights, pitch_mm=[48.0, 48.0], wavefront=0)
    code, out, err = irtscots("transfer", small, "--psd", path, "--json")
    assert code == 0 and "low orders of 86" in err and "--remove piston_tilt_power_astigmatism takes" in err
    found = [json.loads(out)["psd"]]
    code, out, err = irtscots("transfer", small, "--psd", path, "--json", "--remove", "piston_tilt_power_astigmatism")
    assert code == 0 and "low orders" not in err
    found.append(json.loads(out)["psd"])
    assert [one["removed"] for one in found] == ["piston_tilt", "piston_tilt_power_astigmatism"]
    # white heights of 1e-8 mm rms: their variance times the area of a sample, in nm^2 mm^2
    highest = [np.mean(one["measured_nm2_mm2"][-4:]) for one in found]
    assert highest[1] == pytest.approx(1e-4 * 48**2, rel=0.3) and highest[0] > 3 * highest[1]


@pytest.mark.parametrize(
    "arguments, text",
    [
        (("nothing",), "nothing"),
        (("sphere", "--periods", "40,x"), "--periods = 40,x: must be numbers above 0 with commas between"),
        (("sphere", "--frequencies", "0"), "--frequencies = 0: must be numbers above 0"),
        (("sphere", "--periods", "1e9"), "--periods: 1e+09 mm: must be above 0 and at most 106400"),
        (("sphere", "--measure", "best"), "--measure = 'best': must be one of paper"),
        (("sphere", "--fringes", "-1"), "--fringes = -1.0: must be above 0"),
        (("sphere", "--ripple", "0"), "--ripple = 0: must be above 0"),
        (("sphere", "--direction", "nan"), "--direction = nan: must be from -360 to 360 degrees"),
        (("sphere", "--at", "600", "0"), "--at = 600 0: no pixel sees that place of the mirror as a whole"),
        (("sphere", "--psd", "nothing.h5"), "nothing.h5"),
        (
            ("sphere", "--psd", "result", "--remove", "coma"),
            "--remove = coma: must be one of none, piston, piston_tilt,",
        ),
    ],
)
def test_bad_input_is_refused_in_one_line(irtscots, small, result, arguments, text):
    arguments = tuple({"sphere": small, "result": result}.get(a, a) for a in arguments)
    code, out, err = irtscots("transfer", *arguments)
    assert (code, out) == (2, "")
    assert text in err and err.count("\n") == 1


@pytest.mark.slow
def test_no_device_is_needed(small):
    script = f"import sys; from irtscots_cl.cli import main; code = main(['transfer', {str(small)!r}, '--json'])"
    script += "; print(code, 'pyopencl' in sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stderr.strip().splitlines()[-1] == "0 False"
