"""In which order a screen shows its frames: x then y or interleaved, dark and white frames among them.

A series is a list of frames that belong together: the steps of one number of periods, the lines of a scan, the planes
of a Gray code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.shown_frames import DARK, FRINGES, WHITE, ShownFrame

ORDERS = ("x-then-y", "y-then-x", "interleaved")
PLACES = ("start", "between", "end")
MAX_REFERENCES = 1000
Series = Sequence[ShownFrame]


@dataclass(frozen=True)
class TimeOrder:
    """axes: of ORDERS; interleaved: x and y frames take turns. dark, white: where such frames are, of PLACES;
    "between": between the series, and in the middle of a single one. dark_frames, white_frames: at each of these.

    Raises ValueError for what is not allowed.
    """

    axes: str = "x-then-y"
    dark: tuple[str, ...] = ("start",)
    white: tuple[str, ...] = ("start",)
    dark_frames: int = 1
    white_frames: int = 1

    def __post_init__(self) -> None:
        if self.axes not in ORDERS:
            raise ValueError(f"order = {self.axes!r}: must be one of {', '.join(ORDERS)}")
        for name in ("dark", "white"):
            places, count = getattr(self, name), getattr(self, f"{name}_frames")
            if not set(places) <= set(PLACES):
                raise ValueError(f"{name} = {list(places)}: must be of {', '.join(PLACES)}")
            if not 1 <= count <= MAX_REFERENCES:
                raise ValueError(f"{name}_frames = {count}: must be from 1 to {MAX_REFERENCES}")

    def references(self, place: str) -> list[ShownFrame]:
        """The dark, then the white frames at a place."""
        dark = self.dark_frames if place in self.dark else 0
        white = self.white_frames if place in self.white else 0
        return [ShownFrame(DARK)] * dark + [ShownFrame(WHITE)] * white


def in_order(series: Mapping[str, Sequence[Series]], order: TimeOrder | None = None) -> tuple[ShownFrame, ...]:
    """All frames in their order, with names for their pictures. series: by axis, "" for what has none."""
    order = order or TimeOrder()
    axes = [axis for axis in ("yx" if order.axes == "y-then-x" else "xy") if axis in series]
    axes += [axis for axis in series if axis not in axes]
    if order.axes == "interleaved":
        blocks = [
            [frame for frame in chain(*zip_longest(*(one or () for one in together))) if frame is not None]
            for together in zip_longest(*(series[axis] for axis in axes))
        ]
    else:
        blocks = [list(one) for axis in axes for one in series[axis]]
    between = order.references("between")
    if len(blocks) == 1 and between:
        half = len(blocks[0]) // 2
        blocks = [blocks[0][:half], blocks[0][half:]]
    frames = order.references("start")
    for k, block in enumerate(blocks):
        frames += (between if k else []) + block
    return named(frames + order.references("end"))


def named(frames: Sequence[ShownFrame]) -> tuple[ShownFrame, ...]:
    """The frames with names of their pictures, which begin with their numbers."""
    width = len(str(len(frames) - 1))
    return tuple(replace(frame, picture=f"{k:0{width}d}-{frame.file_stem}.png") for k, frame in enumerate(frames))


def fringe_series(fringes: FringeSet) -> list[list[ShownFrame]]:
    """The frames of a set of fringes: a series for each number of periods."""
    return [
        [ShownFrame(FRINGES, fringes.axis, periods, _degrees(step)) for step in steps]
        for periods, steps in zip(fringes.periods, fringes.steps_rad, strict=True)
    ]


def _degrees(step_rad: float) -> float:
    """To the rounding of its last digits, so that a quarter of a turn is 90."""
    return round(math.degrees(step_rad), 11)
