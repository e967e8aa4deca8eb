"""Lines as pictures, and the scan that their frames are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import irtscots_cl as irt
from irtscots_cl.imaging.line_pictures import LineSet, line_values, scene_of_lines
from irtscots_cl.imaging.patterns import LineScan


def frames_of(lines, pixels=21):
    return [frame for axis in "xy" for frame in lines.series(axis, pixels)]


def test_pixels_covered_in_part_are_grey():
    np.testing.assert_allclose(line_values(1.25, 1.5, 5), [0, 0.75, 0.75, 0, 0])
    np.testing.assert_allclose(line_values(1.25, 0.5, 5), [0, 0.5, 0, 0, 0])
    np.testing.assert_allclose(line_values(3, 1, 5), [0, 0, 0, 1, 0])


@pytest.mark.parametrize(
    "lines", [LineSet(), LineSet(2, 1, 3), LineSet(1, 0.5), LineSet(1.25, 0.75, 0.5), LineSet(3, 4, 2)]
)
def test_the_scene_of_the_frames_scans_their_lines(lines):
    """Centres, width and screen in mm, whatever the lines' parts of pixels."""
    scene = irt.load_scene("sphere")
    own, numbers = scene_of_lines(frames_of(lines), scene)
    k = np.arange(lines.count(21))
    wanted = (lines.first_px + lines.width_px / 2 + k * lines.step_px - 10.5) * 0.2
    for axis in "xy":
        pattern = LineScan(own)
        positions = pattern.positions_mm(axis)
        np.testing.assert_allclose(positions[numbers[axis]], wanted, atol=1e-12)
        np.testing.assert_allclose(pattern.line_width * pattern.spacing_mm(axis), lines.width_px * 0.2)
    assert own.screen.pixels[0] * own.screen.pitch_xy_mm[0] == pytest.approx(21 * 0.2)


def test_lines_that_were_not_shown_leave_gaps():
    scene = irt.load_scene("sphere")
    frames = [f for f in frames_of(LineSet()) if not (f.axis == "x" and f.first_px[0] in (0, 5))]
    own, numbers = scene_of_lines(frames, scene)
    assert len(LineScan(own).positions_mm("x")) == 21
    assert numbers["x"] == [k for k in range(21) if k not in (0, 5)] and numbers["y"] == list(range(21))


def test_what_is_no_scan_is_named():
    scene, frames = irt.load_scene("sphere"), frames_of(LineSet())
    cases = [
        ([*frames, frames[0]], "a line of the x scan is shown twice"),
        ([replace(frames[0], width_px=2.0), *frames[1:]], "lines 1 and 2 pixels wide: must be one"),
        ([f for f in frames if f.axis == "x" or f.first_px[0] % 2 == 0], "lines 1 and 2 pixels apart in x and y"),
        ([replace(frames[0], first_px=(30.0, 0.0)), *frames[1:]], "a line of the x scan lies beyond the screen's edge"),
        ([replace(frames[0], first_px=(0.123, 0.0)), *frames[1:]], "must be multiples of 1/n of a pixel, n at most 16"),
    ]
    for given, said in cases:
        with pytest.raises(ValueError, match=said):
            scene_of_lines(given, scene)
    with pytest.raises(ValueError, match="width = 0 pixels: must be above 0"):
        LineSet(0)
    with pytest.raises(ValueError, match="2 lines on the 21 pixels of the x scan; must be at least 3"):
        LineSet(1, 15).series("x", 21)
