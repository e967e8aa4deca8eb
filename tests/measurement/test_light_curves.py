"""Which samples of a light curve count, and which curves can be used."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.measurement.light_curves import (
    DARK_EDGE_TOLERANCE,
    EDGE_TOLERANCE,
    Flag,
    effective_screen_pixels,
    flag_curves,
)

POSITIONS = np.array([-0.4, -0.2, 0.0, 0.2, 0.4])  # the screen's edges are at -0.5 and 0.5 mm


def flag(curve, centroid_mm, reach_mm, first_line=0, positions=POSITIONS) -> Flag:
    curve = np.array([curve], float)
    scan = Scan("x", positions, (1, 1), np.array([0]), np.array([first_line]), curve[None], np.ones(1), np.ones(1))
    return Flag(flag_curves(scan, curve, np.array([centroid_mm]), np.array([reach_mm]))[0])


def test_samples_above_the_threshold_count():
    curves = np.array([[0.0, 1e-30, 5.0, 10.0], [0.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 2.0, 1.0]])
    np.testing.assert_array_equal(effective_screen_pixels(curves), [[0, 1, 1, 1], [0, 0, 0, 0], [0, 0, 1, 1]])
    np.testing.assert_array_equal(effective_screen_pixels(curves, 0.5), [[0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 1, 0]])
    assert effective_screen_pixels(np.zeros((3, 2, 0))).shape == (3, 2, 0)


def test_a_curve_inside_the_screen_is_good():
    assert flag([0, 1, 2, 1, 0], 0.0, 0.3) == Flag.GOOD


def test_a_curve_without_light_is_empty_wherever_it_lies():
    assert flag([0, 0, 0, 0, 0], np.nan, 0.3) == Flag.EMPTY
    assert flag([0, 0, 0, 0, 0], 0.4, 0.3) == Flag.EMPTY


@pytest.mark.parametrize("side", [1, -1])
def test_a_curve_is_clipped_once_its_light_reaches_past_the_last_line(side):
    curve = [0, 0, 1, 2, 1][::side]
    assert flag(curve, side * 0.2, 0.295) == Flag.GOOD
    inside = 0.3 + 0.9 * EDGE_TOLERANCE * 0.2  # past the edge by nine tenths of what is tolerated
    assert flag(curve, side * 0.2, inside) == Flag.GOOD
    beyond = 0.3 + 1.1 * EDGE_TOLERANCE * 0.2
    assert flag(curve, side * 0.2, beyond) == Flag.CLIPPED


def test_where_the_edge_s_line_is_dark_more_is_tolerated():
    """Few rays light no edge line, and move the centroid; a spot far larger than the screen is clipped all the same."""
    dark = DARK_EDGE_TOLERANCE * 0.2
    assert flag([0, 1, 2, 1, 0], 0.0, 0.5 + 0.9 * dark) == Flag.GOOD
    assert flag([0, 1, 2, 1, 0], 0.0, 0.5 + 1.1 * dark) == Flag.CLIPPED
    assert flag([0, 1, 2, 1, 0], 0.0, 25.0) == Flag.CLIPPED


def test_much_light_where_the_geometry_allows_none_is_stray():
    assert flag([1, 1, 1, 1, 1], 0.0, 0.15) == Flag.STRAY  # background: two fifths are more than 0.35 mm away
    assert flag([0.3, 1, 5, 1, 0.3], 0.0, 0.15) == Flag.GOOD  # 8 % of the light
    assert flag([0.5, 1, 5, 1, 0.5], 0.0, 0.15) == Flag.STRAY  # 12.5 %


def test_samples_past_the_scan_s_last_line_are_no_edge():
    assert (
        flag([0, 1, 2, 0, 0], 0.2, 0.32, first_line=2) == Flag.CLIPPED  # the sample of 2 is line 4, the last
    )
    assert flag([1, 2, 0, 0, 0], 0.15, 0.4, first_line=2) == Flag.GOOD  # lines 2 and 3 alone


def test_the_edge_is_where_the_scan_s_own_lines_end():
    assert flag([0, 0, 1, 2, 1], 100.2, 0.295, positions=POSITIONS + 100) == Flag.GOOD
    assert flag([0, 0, 1, 2, 1], 100.2, 0.35, positions=POSITIONS + 100) == Flag.CLIPPED


def test_a_curve_at_the_cameras_limit_is_saturated():
    """In one exposure out of three: in the mean its top is below the limit, and still bent."""
    exposures = np.array([[0, 1, 3, 1, 0], [0, 1, 2.9, 1, 0], [0, 1, 2.8, 1, 0]], float)[:, None]
    scan = Scan("x", POSITIONS, (1, 1), np.zeros(1, int), np.zeros(1, int), exposures, np.ones(3), np.ones(1))
    for limit, expected in ((np.inf, Flag.GOOD), (3.01, Flag.GOOD), (3.0, Flag.SATURATED), (2.85, Flag.SATURATED)):
        stack = ImageStack(scan, scan).saturating_at(limit)
        assert flag_curves(stack.x, scan.mean_w(), np.zeros(1), np.full(1, 0.3)) == [expected]
        assert stack.y.saturation_w == limit and np.isinf(scan.saturation_w)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="--saturation = .*: must be above 0"):
            ImageStack(scan, scan).saturating_at(wrong)


def test_one_line_alone_tells_no_centroid():
    assert flag([1.0], 0.0, 0.3, positions=np.array([0.0])) == Flag.CLIPPED
