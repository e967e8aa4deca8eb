"""Grids of dots."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.dots import DotGrid, dot_centres, dot_values


def test_dots_lie_where_they_should_with_their_area():
    frame = DotGrid(10, 4.5, 3).series((41, 35))[4]
    x, y = dot_centres(frame, (41, 35))
    values = dot_values(frame, (41, 35))
    assert values.shape == (35, 41) and values.max() == 1
    row, column = np.mgrid[:35, :41] + 0.5
    for u in x:
        for v in y:
            own = values * ((np.abs(column - u) < 4) & (np.abs(row - v) < 4))
            assert own.sum() == pytest.approx(np.pi * 4.5**2 / 4, rel=0.02)  # 8 x 8 samples of a pixel
            assert (own * column).sum() / own.sum() == pytest.approx(u, abs=0.02)
            assert (own * row).sum() / own.sum() == pytest.approx(v, abs=0.02)
    assert values.sum() == pytest.approx(len(x) * len(y) * np.pi * 4.5**2 / 4, rel=0.02)


def test_shifts_fill_the_grid_and_no_dot_is_cut():
    frames = DotGrid(9, 3, 3).series((40, 30))
    places = {
        (round(u, 3), round(v, 3))
        for f in frames
        for u in dot_centres(f, (40, 30))[0]
        for v in dot_centres(f, (40, 30))[1]
    }
    xs = sorted({u for u, _ in places})
    assert np.diff(xs) == pytest.approx(3.0, abs=0.01) and (20.0, 15.0) in places
    assert xs[0] >= 1.5 and xs[-1] <= 38.5 and len(places) == len(xs) * len({v for _, v in places})
    with pytest.raises(
        ValueError, match="diameter 9, pitch 9 pixels: must be above 0, and the diameter below the pitch"
    ):
        DotGrid(9, 9)
    with pytest.raises(ValueError, match="shifts = 0"):
        DotGrid(9, 3, 0)
