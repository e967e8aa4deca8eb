"""Corners of straight-sided mirrors in pictures with soft edges, whose corners are known."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.calibration.outline import outline, polygon_corners


def picture(corners, shape=(90, 110), parts=10):
    """Share [rows, columns] of each pixel inside a convex polygon (row, column), counter-clockwise or clockwise."""
    step = (np.arange(parts) + 0.5) / parts - 0.5
    row, column = np.mgrid[: shape[0], : shape[1]].astype(float)
    share = np.zeros(shape)
    ahead = np.roll(corners, -1, axis=0)
    for down in step:
        for right in step:
            side = [
                (b[1] - a[1]) * (row + down - a[0]) - (b[0] - a[0]) * (column + right - a[1])
                for a, b in zip(corners, ahead, strict=True)
            ]
            share += np.all(np.stack(side) > 0, 0) | np.all(np.stack(side) < 0, 0)
    return share / parts**2


SQUARE = np.array([[70.3, 88.1], [68.9, 20.4], [12.2, 23.7], [15.6, 91.8]])
HEXAGON = np.array([[80.2, 55.3], [62.0, 91.0], [25.5, 90.2], [8.1, 54.0], [27.0, 18.5], [63.5, 19.2]])
TRIANGLE = np.array([[80.0, 15.0], [75.0, 100.0], [10.0, 50.0]])


@pytest.mark.parametrize("corners", [SQUARE, HEXAGON, TRIANGLE], ids=["square", "hexagon", "triangle"])
def test_corners_are_found_to_a_fraction_of_a_pixel(corners):
    share = picture(corners)
    noise = 0.01 * np.random.default_rng(4).standard_normal(share.shape)
    edge = outline(5 + 200 * share + 200 * noise - 5, share > 0.6)
    start = corners + np.random.default_rng(5).uniform(-3, 3, corners.shape)
    found = polygon_corners(edge, start)
    # 30 and more points of a side, each to 0.1 pixel where the contour runs between pixels: the corner to 0.05 or so
    assert np.abs(found - corners).max() < 0.15


def test_hidden_corners_do_not_matter():
    share = picture(SQUARE)
    share[65:75, 84:93] = 0  # something stands in front of a corner
    found = polygon_corners(outline(share, share > 0.5), SQUARE + 1.0)
    assert np.abs(found - SQUARE).max() < 0.2


def test_what_does_not_fit_is_refused():
    share = picture(SQUARE)
    edge = outline(share, share > 0.5)
    with pytest.raises(
        ValueError, match="side 1 of 4 has 0 points of the edge near it; must have 8: the facet's corners"
    ):
        polygon_corners(edge, SQUARE + np.array([0.0, 400.0]))
    with pytest.raises(ValueError, match="two of its corners lie at one place"):
        polygon_corners(edge, SQUARE[[0, 0, 1, 2]])
    with pytest.raises(ValueError, match="no edge of the bright region lies in the picture"):
        outline(np.ones((20, 20)), np.ones((20, 20), bool))
