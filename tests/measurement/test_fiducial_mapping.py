"""Mapping errors by marks whose places are known: values, error bars, wrong, missing and mirrored ones."""

from __future__ import annotations

import numpy as np
import pytest
from mirror_pictures import Marked, picture

from irtscots_cl.measurement.fiducial_checks import fiducial_checks, suggested_change
from irtscots_cl.measurement.fiducial_mapping import MirroredMarksError, map_fiducials

LAB = Marked()
SHIFT = (0.4, -0.3)


def mapped(signal, marks=None, shift=SHIFT):
    return map_fiducials(signal, LAB.region(shift), LAB.chief, LAB.marks() if marks is None else marks)


def checks_of(found):
    checks = fiducial_checks(found, suggested_change(found, LAB.chief))
    return {check.name: check for check in checks}


@pytest.fixture(scope="module")
def clean():
    return picture(LAB.light(LAB.marks(), SHIFT), noise=0.0)


def test_offset_and_error_bars(clean):
    """6 pictures, four numbers each: the pulls' scatter is known to 15 %; 3 sigma. 0.05 pixel is 0.8 mm."""
    expected = LAB.mm_per_px(LAB.rim.centre) @ SHIFT
    pulls = []
    for seed in range(6):
        found = mapped(clean + 2.0 * np.random.default_rng(seed).standard_normal(clean.shape))
        errors = np.array([*(found.offset_mm - expected), found.scale - 1, found.turn_rad])
        assert found.matched.all() and np.abs(errors[:2]).max() < 0.8
        pulls.append(errors / np.sqrt(np.diag(found.move_covariance)))
    assert 0.55 < np.std(pulls) < 1.45
    assert found.rms_mm() == pytest.approx(np.hypot(*expected), rel=0.1)
    assert found.rms_mm(left=True) < 0.8 and (found.standard_error_mm[found.matched] < 0.8).all()


def test_turn_and_scale_are_found_and_a_change_of_the_scene_explains_them():
    """The camera that is suggested maps the marks to their noise."""
    signal = picture(LAB.light(LAB.marks(), (1.0, 2.0), turn=0.03, scale=1.015), noise=0.5)
    found = mapped(signal, shift=(1.0, 2.0))
    assert found.turn_rad == pytest.approx(0.03, abs=2e-3) and found.scale == pytest.approx(1.015, abs=2e-3)
    change = suggested_change(found, LAB.chief)
    assert set(change.keys) == {"camera.look_at_mm", "camera.roll_deg", "camera.focal_length_mm"}
    assert change.rms_mm < 0.03 * found.rms_mm()
    check = checks_of(found)["fiducial mapping"]
    assert check.level == "warning" and "camera.roll_deg = -1.7" in check.text


def test_marks_in_their_places_raise_no_check():
    found = mapped(picture(LAB.light(LAB.marks()), noise=1.0), shift=(0, 0))
    checks = checks_of(found)
    assert {check.level for check in checks.values()} == {"ok"}
    assert set(checks) == {"fiducials", "fiducial mapping", "fiducial residual"}


def test_missing_moved_and_strange_marks_are_named():
    marks = LAB.marks()
    signal = picture(LAB.light(marks, without=(1,), moved={3: (60.0, 30.0)}), noise=0.5)
    found = mapped(signal, shift=(0, 0))
    assert found.matched.tolist() == [True, False, True, False, True, True, True]
    assert np.abs(found.offset_mm).max() < 1.0 and found.near_mm[3] == pytest.approx(67, abs=3)
    text = checks_of(found)["fiducials"].text
    assert "5 of 7 marks found; not found: B; not where the others have it: D (6" in text
    few = map_fiducials(signal, LAB.region(), LAB.chief, type(marks)(marks.marks[:6], "six"))
    assert len(few.strays) == 1 and "1 more that look like marks" in checks_of(few)["fiducials"].text


def test_too_few_marks_tell_nothing():
    found = mapped(picture(LAB.light(LAB.marks(), without=(1, 2, 3, 4)), noise=0.5), shift=(0, 0))
    assert not found.is_enough and suggested_change(found, LAB.chief) is None
    checks = checks_of(found)
    assert set(checks) == {"fiducials"} and "those found are too few to tell offset, turn and scale" in (
        checks["fiducials"].text
    )


def test_found_marks_on_a_line_tell_nothing():
    points = ((-300, -150), (-100, -50), (100, 50), (300, 150), (-100, 250), (120, -260))
    marks = LAB.marks(points=points)
    found = mapped(picture(LAB.light(marks, without=(4, 5)), noise=0.5), marks, shift=(0, 0))
    assert found.matched.tolist() == [True] * 4 + [False] * 2 and not found.is_enough
    assert "those found lie on one line" in checks_of(found)["fiducials"].text


@pytest.mark.parametrize(
    ("turned", "word"),
    [(np.flipud, "rows-reversed"), (np.fliplr, "columns-reversed"), (np.rot90, "three-quarter-turn"),
     (lambda a: np.rot90(a, 2), "half-turn"), (np.transpose, "transposed")],
)  # fmt: skip
def test_mirrored_and_turned_pictures_are_refused_with_the_word_to_set(clean, turned, word):
    region = np.ascontiguousarray(turned(LAB.region(SHIFT)))
    with pytest.raises(MirroredMarksError, match=f'camera.detector.orientation = "{word}" \\(now "upright"\\)'):
        map_fiducials(np.ascontiguousarray(turned(clean)), region, LAB.chief, LAB.marks())


def test_symmetric_marks_do_not_tell_the_orientation():
    marks = LAB.marks(points=((-250, 0), (250, 0), (0, 250), (0, -250)))
    found = mapped(picture(LAB.light(marks), noise=0.5), marks, shift=(0, 0))
    assert found.matched.all() and "the rows upside down" in found.alike
    assert checks_of(found)["fiducial orientation"].level == "warning"


def test_pixels_on_marks_are_covered_also_those_of_unseen_ones():
    marks = LAB.marks()
    touched = LAB.light(marks, SHIFT, without=()) < LAB.light(marks, SHIFT, without=range(7)) - 1e-9
    found = mapped(picture(LAB.light(marks, SHIFT, without=(2,)), noise=0.5))
    covered = found.covered((LAB.n, LAB.n))
    assert covered[touched].all()
    assert covered.sum() < 4 * touched.sum()
