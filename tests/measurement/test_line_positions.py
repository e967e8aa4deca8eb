"""Line positions that are not the screen's: refused, with the cause in words."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import small_scene

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.line_positions import check_line_positions, line_position_problem, with_all_lines
from irtscots_cl.measurement.methods import measure_by

SCENE = small_scene("sphere", 5)
LINES = LineScan(SCENE).positions_mm("x")  # 21 lines from -2 to 2 mm
SCREEN = "the screen of scene sphere has 21 lines from -2 to 2 mm, 0.2 mm apart; must agree within half a pitch"


def scan(positions, axis="x", scene=SCENE):
    return Scan.from_images(axis, positions, np.ones((len(positions), *scene.camera.detector.pixels)))


@pytest.mark.parametrize(
    ("positions", "found", "cause"),
    [
        (LINES / 1e3, "21 lines from -0.002 to 0.002 mm, 0.0002 mm apart", "be in metres"),
        (LINES / 25.4, "21 lines from -0.0787402 to 0.0787402 mm, 0.00787402 mm apart", "be in inches"),
        (LINES * 1e3, "21 lines from -2000 to 2000 mm, 200 mm apart", "be in micrometres"),
        (LINES + 2, "21 lines from 0 to 4 mm, 0.2 mm apart", "be counted from the first line, not from the screen's"),
        ((LINES + 2) / 1e3, "21 lines from 0 to 0.004 mm, 0.0002 mm apart", "be in metres and counted from the first"),
        (np.arange(21.0), "21 lines from 0 to 20 mm, 1 mm apart", "be numbers of lines"),
        (LINES * 1.3, "21 lines from -2.6 to 2.6 mm, 0.26 mm apart", "have another pitch"),
    ],
)
def test_the_likely_cause_is_named(positions, found, cause):
    problem = line_position_problem(scan(positions), SCENE)
    assert problem.startswith(f"/lines/x_mm: {found}; {SCREEN}; the positions seem to {cause}")
    with pytest.raises(ValueError, match="^/lines/x_mm: ") as caught:
        check_line_positions(scan(positions), SCENE)
    assert str(caught.value) == problem


def test_a_reversed_scan_of_a_screen_off_centre_is_named():
    screen = dataclasses.replace(SCENE.screen, centre_offset_mm=(1.5, 0.0))
    scene = dataclasses.replace(SCENE, screen=screen)
    lines = LineScan(scene).positions_mm("x")
    assert line_position_problem(scan(lines), scene) == ""
    assert "the positions seem to have the opposite sign: the scan is reversed" in line_position_problem(
        scan(-lines[::-1]), scene
    )
    assert "seem to be moved by -1.2 mm" in line_position_problem(scan(lines - 1.2), scene)


def test_positions_that_were_calibrated_are_accepted():
    wobble = 0.09 * np.sin(np.arange(21))  # of a pitch of 0.2 mm
    for positions in (LINES, LINES + 0.099, LINES * 1.01, LINES + wobble):
        check_line_positions(scan(positions), SCENE)
    assert line_position_problem(scan(LINES + 0.101), SCENE) != ""


def test_without_a_cause_the_two_sets_are_named():
    positions = np.sort(np.random.default_rng(1).uniform(-2, 2, 21))
    assert line_position_problem(scan(positions, "y"), SCENE).endswith(SCREEN)


@pytest.mark.parametrize("measure", ["paper", "fine", "refined"])
def test_positions_in_metres_are_refused_before_measuring(measure):
    """The light-curve model would have thousands of lines for a pitch of 0.2 micrometres."""
    stack = ImageStack(scan(LINES / 1e3), scan(LINES / 1e3, "y"))
    with pytest.raises(ValueError, match="the positions seem to be in metres$"):
        measure_by(measure, stack, SCENE)


# --- scans of some of the screen's lines ---------------------------------------------------------------------


@pytest.mark.parametrize("pick", [slice(None, None, 2), slice(4, 18), [0, 1, 3, 4, 5, 9, 10, 11, 15, 20]])
def test_lines_that_were_not_recorded_become_missing_samples(pick):
    number = np.arange(21)[pick]
    some = Scan.from_images("x", LINES[number], np.broadcast_to(number[:, None, None], (len(number), 5, 5)))
    whole = with_all_lines(ImageStack(some, scan(LINES, "y")), SCENE)
    np.testing.assert_array_equal(whole.x.positions_mm, LINES)
    expected = np.full(21, np.nan)
    expected[number] = number
    np.testing.assert_array_equal(whole.x.flux_w[0, 7], expected)
    np.testing.assert_array_equal(whole.y.flux_w, scan(LINES, "y").flux_w)


@pytest.mark.parametrize(
    "found", [LINES[::2] + 0.1, LINES[:2], LINES[::2] * 2, np.repeat(LINES[:5], 2)[:9] + np.arange(9) * 1e-4]
)
def test_positions_that_are_no_lines_of_the_screen_stay(found):
    some = scan(found)
    assert with_all_lines(ImageStack(some, some), SCENE).x is some
