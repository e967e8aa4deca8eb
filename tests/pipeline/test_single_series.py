"""One number of periods, beyond one over the screen, and a bar across the mirror: phases unwrapped over the image."""

from __future__ import annotations

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from fringe_folders import DARK_COUNTS, recorded

import irtscots_cl as irt
from irtscots_cl import cli
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.optics.setup import Setup

SETS = tuple(FringeSet.equal(axis, (2.46,), 4) for axis in "xy")
BAR = slice(58, 68)  # columns: two islands
pytestmark = pytest.mark.needs_device


@pytest.fixture(scope="module")
def scene():
    return irt.load_scene("sphere-deviated")


@pytest.fixture(scope="module")
def barred(scene):
    lab = recorded(irt.trace(scene, estimator="analytic"), scene, SETS)
    frames = lab.frames.copy()
    frames[:, :, BAR] = np.uint16(DARK_COUNTS)
    return replace(lab, frames=frames)


def measured(folder, scene, capsys, *options):
    (folder / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    out = ("--scene", folder / "scene.toml", "--out", folder / "out", "--json")
    code = cli.main(["reconstruct", *map(str, (folder, *out, *options))])
    printed, err = capsys.readouterr()
    return code, json.loads(printed) if printed else None, err


def test_two_islands_are_measured_each_by_itself(barred, scene, tmp_path, capsys):
    """Places of both islands to their error bars; heights of an island without its own plane within three of theirs."""
    barred.write(tmp_path)
    code, facts, err = measured(tmp_path, scene, capsys)
    assert code == 0 and "order x" in err
    told = [c["text"] for c in facts["checks"] if c["name"].startswith("order")]
    assert len(told) == 2 and all("2 islands of pixels" in text and "wrong with probability" in text for text in told)
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        x, y, height, error = (
            file[name][()] for name in ("mirror/x_mm", "mirror/y_mm", "deviation_nm", "height_standard_error_nm")
        )
        mask = file["mask"][()]
    assert not mask[:, BAR].any() and mask.sum() > 8000
    true_nm = Setup(scene).chief_rays.surface.deviation_at(x, y)[0] * 1e6
    for half in (slice(0, 58), slice(68, None)):
        own = np.zeros_like(mask)
        own[:, half] = mask[:, half]
        assert rms(remove_terms(x, y, height - true_nm, own, "piston_tilt"), own) < 3 * np.nanmean(error[own])


def test_a_design_half_a_period_away_is_refused(barred, scene, tmp_path, capsys):
    """The screen 0.85 mm off its place: a fringe is 1.7 mm wide. Nothing tells which fringe is seen."""
    barred.write(tmp_path)
    screen = replace(scene.screen, centre_offset_mm=(4.2 / 2.46 / 2, 0.0))
    code, facts, err = measured(tmp_path, replace(scene, screen=screen), capsys)
    assert (code, facts) == (2, None) and "of the mirror's pixels are used" in err and "order in doubt" in err
