"""Streams of random numbers for what a camera and a screen do: each effect has its own, so that none follows another.

A number depends on (seed, stream, place, index); see maths/counter_random.py. The place of a frame is its exposure, its
number among the averaged frames, its scan and its line.
"""

from __future__ import annotations

from enum import IntEnum


class Stream(IntEnum):
    """What the numbers are for. Numbers keep their meaning: a change would change the noise of old seeds."""

    SHOT = 1
    READ = 2
    PRNU = 3
    DEAD_PIXEL = 4
    HOT_PIXEL = 5
    SCREEN_JITTER = 6
    SCREEN_DEAD_PIXEL = 7
    SCREEN_DEAD_COLUMN = 8
    SCREEN_DEAD_ROW = 9


SCANS = ("x", "y", "dark")  # dark: frames without light
EVERYWHERE = (0, 0)  # the place of what belongs to pixels and not to frames


def place_of(scan: str, line: int, exposure: int = 0, frame: int = 0) -> tuple[int, int]:
    """The place of a frame; each number is below 2^32."""
    return exposure << 32 | frame, SCANS.index(scan) << 32 | line
