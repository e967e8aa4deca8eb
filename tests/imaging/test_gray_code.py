"""The planes of a Gray code."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.gray_code import GraySet, from_gray, gray, gray_sets
from irtscots_cl.imaging.sequences import in_order


@pytest.mark.parametrize("cells", [2, 3.5, 7, 64, 100.25, 4000])
def test_neighbouring_cells_differ_in_one_plane_and_planes_number_the_cells(cells):
    code = GraySet("x", cells)
    all_cells = np.arange(code.count)
    middles = (all_cells + 0.25) / cells
    values = code.values(middles)
    assert values.shape == (code.planes, code.count) and 2 ** (code.planes - 1) < code.count <= 2**code.planes
    assert (np.abs(np.diff(values, axis=1)).sum(0) == 1).all()
    np.testing.assert_array_equal(code.number(values.astype(int)), all_cells)
    assert values[0].tolist() == sorted(values[0])  # the coarsest plane has one edge


def test_there_and_back():
    numbers = np.arange(5000)
    np.testing.assert_array_equal(from_gray(gray(numbers)), numbers)


def test_the_frames_tell_their_code():
    codes = [GraySet("x", 12.5), GraySet("y", 9, inverted=False)]
    found = gray_sets(in_order({code.axis: [code.series()] for code in codes}))
    assert [found[axis][0] for axis in "xy"] == codes
    assert found["x"][1][0, False] == 2 and found["x"][1][3, True] == 9 and found["y"][1][3, False] == 13


def test_missing_and_repeated_planes_are_named():
    frames = in_order({"x": [GraySet("x", 12).series()]})
    with pytest.raises(ValueError, match="plane 1, inverted, of the x Gray code: missing"):
        gray_sets(tuple(f for f in frames if not (f.bit == 1 and f.inverted)))
    with pytest.raises(ValueError, match=r"frames\[10\]: plane 3, inverted, of the x Gray code is shown twice"):
        gray_sets((*frames, frames[-1]))
    with pytest.raises(ValueError, match="cells = 1: must be above 1"):
        GraySet("x", 1)
