"""Masks and fiducials of `irtscots reconstruct`: which pixels are used, what is said, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from fringe_folders import DARK_COUNTS, recorded, stored_as
from mirror_pictures import Marked
from PIL import Image

import irtscots_cl as irt
from irtscots_cl import cli
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.mask_files import check_mask_lies
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.measurement.fringe_quality import Reason
from irtscots_cl.pipeline.picture import MaskChoice

SETS = tuple(FringeSet.equal(axis, (0.9, 2.46), 4) for axis in "xy")
MARKED = Marked(48)
SCENE = replace(MARKED.scene, name="marked")
MARKS = MARKED.marks(size_mm=75.0)
TABLE = "name,x_mm,y_mm,size_mm\n" + "".join(f"{m.name},{m.x_mm},{m.y_mm},75\n" for m in MARKS.marks)
pytestmark = pytest.mark.needs_device


@pytest.fixture(scope="module")
def lab():
    return recorded(irt.trace(SCENE, estimator="analytic"), SCENE, SETS)


@pytest.fixture
def measured(tmp_path, capsys):
    """(exit code, facts or None, stderr) of the command on frames, with further arguments."""

    def run(lab, *arguments, scene=SCENE):
        lab.write(tmp_path)
        (tmp_path / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
        out = ("--scene", tmp_path / "scene.toml", "--out", tmp_path / "out", "--json")
        code = cli.main(["reconstruct", *map(str, (tmp_path, *arguments, *out))])
        printed, err = capsys.readouterr()
        return code, json.loads(printed) if printed else None, err

    return run


def check_of(facts, name):
    return next(check for check in facts["checks"] if check["name"] == name)


def with_marks(lab, shift=(0.0, 0.0)):
    share = MARKED.light(MARKS, shift) / np.maximum(MARKED.light(MARKS, shift, without=range(7)), 1e-9)
    counts = DARK_COUNTS + (lab.frames - DARK_COUNTS) * share
    return replace(lab, frames=np.clip(np.rint(counts), 0, 4095).astype(np.uint16))


@pytest.mark.slow
def test_a_simulated_mirror_lies_where_its_design_has_it(lab, measured, tmp_path):
    code, facts, err = measured(lab)
    assert (code, err) == (0, "")
    rim = facts["outline"]
    assert max(abs(rim["shift_rows_px"]), abs(rim["shift_columns_px"])) < 5 * rim["shift_standard_error_px"] < 0.05
    assert abs(rim["scale"] - 1) < 5 * rim["scale_standard_error"] + 3e-4
    assert facts["mask"]["chosen_by"] == "auto" and "chosen by light" in check_of(facts, "mask")["text"]
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        coverage = file["outline/coverage"][()]
    assert np.abs(coverage - MARKED.chief.footprint.coverage).max() < 0.06
    assert facts["mask"]["pixels"]["whole"] == np.count_nonzero(coverage == 1)


def test_fiducials_tell_the_mapping_error_and_their_pixels_are_not_used(lab, measured, tmp_path):
    """Lit pixels on marks would be measured, dark and wrong: none of them is used."""
    (tmp_path / "marks.csv").write_text(TABLE)
    code, facts, err = measured(with_marks(lab), "--fiducials", tmp_path / "marks.csv")
    assert (code, err) == (0, "")
    found = facts["fiducials"]
    assert all(mark["found"] for mark in found["marks"])
    assert found["rms_mm"] < 2.0 and abs(found["turn_mrad"]) < 5 * found["turn_standard_error_mrad"]  # 22 mm pixels
    assert facts["fringes"]["excluded"]["mark"] > 30
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        reason, mask = file["excluded"][()], file["mask"][()]
    touched = MARKED.light(MARKS) < 0.99 * MARKED.light(MARKS, without=range(7))
    assert (reason[touched] == Reason.MARK).all() and not mask[touched].any()


def test_mirrored_marks_are_refused(lab, measured, tmp_path):
    mirrored = "".join(
        line if k == 0 else ",".join([(w := line.split(","))[0], str(-float(w[1])), *w[2:]])
        for k, line in enumerate(TABLE.splitlines(keepends=True))
    )
    (tmp_path / "marks.csv").write_text(mirrored)
    code, facts, err = measured(with_marks(lab), "--fiducials", tmp_path / "marks.csv")
    assert (code, facts) == (2, None) and err.count("\n") == 1
    assert "7 marks fit with the columns mirrored" in err and "seen from behind" in err


@pytest.mark.slow
def test_the_design_may_choose(lab, measured):
    code, facts, _ = measured(lab, "--mask", "design")
    assert code == 0 and facts["mask"]["chosen_by"] == "design"
    assert facts["pixels_used"] == facts["mask"]["pixels"]["design"]


@pytest.mark.slow
def test_a_mask_in_a_stored_orientation(measured, tmp_path):
    turned = stored_as(SCENE, "rows-reversed")
    use = np.zeros((48, 48), bool)
    use[26:40, 14:34] = True
    Image.fromarray(stored(use, "rows-reversed").astype(np.uint8) * 255).save(tmp_path / "mask.png")
    lab = recorded(irt.trace(turned, estimator="analytic"), turned, SETS)
    code, facts, err = measured(lab, "--mask", tmp_path / "mask.png", scene=turned)
    assert code == 0, err
    assert facts["pixels_used"] == use.sum() == facts["mask"]["pixels"]["file"]
    with h5py.File(tmp_path / "out" / "result.h5") as file:
        np.testing.assert_array_equal(file["mask"][()], stored(use, "rows-reversed"))


def test_a_mask_that_lies_otherwise_is_refused(tmp_path):
    """Also where no way fits, nothing is said: it may be meant so."""
    use = np.zeros((48, 48), bool)
    use[20:28, 2:12] = True
    use &= MARKED.chief.footprint.coverage > 0
    corner = np.zeros((48, 48), bool)
    corner[:6, 38:] = True  # beside the mirror whichever way it lies
    check_mask_lies(tmp_path, use, MARKED.chief.footprint.coverage > 0)
    check_mask_lies(tmp_path, corner, MARKED.chief.footprint.coverage > 0)
    beside = np.zeros((48, 48), bool)
    beside[:24] = True  # a mirror in the lower half of the picture, a mask of the upper half
    with pytest.raises(
        ValueError, match="100% of its pixels are off the mirror, with the rows upside down 0%: must lie"
    ):
        check_mask_lies(tmp_path, beside, ~beside)


def test_choices_are_read(tmp_path):
    assert MaskChoice.of(None, None, SCENE, "upright").how == "auto"
    assert MaskChoice.of(Path("design"), None, SCENE, "upright").how == "design"
    with pytest.raises(ValueError, match="there is no file of that name"):
        MaskChoice.of(Path("other"), None, SCENE, "upright")
