"""In which order frames are shown."""

from __future__ import annotations

import re

import pytest

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.line_pictures import LineSet
from irtscots_cl.imaging.sequences import TimeOrder, fringe_series, in_order

FRINGES = {axis: fringe_series(FringeSet.equal(axis, (0.9, 3.0), 3)) for axis in "xy"}


def told(frames):
    """D, W, or axis and number of periods (or first pixel) of each frame."""
    short = {"dark": "D", "white": "W"}
    return " ".join(short.get(f.shows) or f"{f.axis}{f.periods or f.first_px[0]:g}" for f in frames)


def test_as_it_always_was():
    frames = in_order(FRINGES)
    assert told(frames) == "D W x0.9 x0.9 x0.9 x3 x3 x3 y0.9 y0.9 y0.9 y3 y3 y3"
    assert frames[0].picture == "00-dark.png" and frames[-1].picture == "13-y-3-240.png"


@pytest.mark.parametrize(
    ("order", "wanted"),
    [
        (TimeOrder("y-then-x", white=()), "D y0.9 y0.9 y0.9 y3 y3 y3 x0.9 x0.9 x0.9 x3 x3 x3"),
        (TimeOrder("interleaved", dark=()), "W x0.9 y0.9 x0.9 y0.9 x0.9 y0.9 x3 y3 x3 y3 x3 y3"),
        (
            TimeOrder("interleaved", dark=("start", "between", "end"), white=("end",), dark_frames=2),
            "D D x0.9 y0.9 x0.9 y0.9 x0.9 y0.9 D D x3 y3 x3 y3 x3 y3 D D W",
        ),
    ],
)
def test_orders(order, wanted):
    assert told(in_order(FRINGES, order)) == wanted


def test_between_is_the_middle_of_a_single_series():
    series = {axis: [LineSet().series(axis, 3)] for axis in "xy"}
    order = TimeOrder("interleaved", dark=("between",), white=())
    assert told(in_order(series, order)) == "x0 y0 x1 D y1 x2 y2"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"axes": "z"}, "order = 'z': must be one of x-then-y, y-then-x, interleaved"),
        ({"dark": ("later",)}, "dark = ['later']: must be of start, between, end"),
        ({"white_frames": 0}, "white_frames = 0: must be from 1 to 1000"),
    ],
)
def test_what_is_not_allowed(arguments, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        TimeOrder(**arguments)
