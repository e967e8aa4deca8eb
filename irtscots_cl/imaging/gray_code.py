"""A Gray code on the screen: planes of black and white stripes that number the cells of an axis.

Neighbouring cells differ in one plane only, so that a pixel whose light lies on a cell's edge is off by one cell at
most (F. Gray, US patent 2632058 (1953)). Plane 0 is the coarsest. A plane may be shown a second time inverted: the
difference of both needs no threshold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.shown_frames import GRAY, ShownFrame
from irtscots_cl.maths.arrays import FloatArray, IntArray

MAX_CELLS = 2.0**20


@dataclass(frozen=True)
class GraySet:
    """The planes of one axis. cells: over the screen, a whole number or not; the first begins at its -x (-y) edge.

    Raises ValueError for what is not allowed.
    """

    axis: str
    cells: float
    inverted: bool = True

    def __post_init__(self) -> None:
        if self.axis not in ("x", "y"):
            raise ValueError(f'Gray code: axis = {self.axis!r}: must be "x" or "y"')
        if not 1 < self.cells <= MAX_CELLS:
            raise ValueError(f"Gray code: cells = {self.cells:g}: must be above 1, at most {MAX_CELLS:g}")

    @property
    def count(self) -> int:
        """Cells, the last of which may lie on the screen in part."""
        return math.ceil(self.cells - 1e-9)

    @property
    def planes(self) -> int:
        return max(1, (self.count - 1).bit_length())

    def cell(self, fraction: FloatArray) -> IntArray:
        """Numbers [n] of the cells at fractions of the screen."""
        return np.clip(np.floor(fraction * self.cells + 1e-9), 0, self.count - 1).astype(np.int64)

    def plane(self, bit: int, cell: IntArray) -> IntArray:
        """What a plane shows in cells: 0 or 1."""
        return (gray(cell) >> (self.planes - 1 - bit)) & 1

    def values(self, fraction: FloatArray) -> FloatArray:
        """What the planes show at fractions: [planes, n]."""
        cell = self.cell(fraction)
        return np.stack([self.plane(bit, cell) for bit in range(self.planes)]).astype(float)

    def number(self, bits: IntArray) -> IntArray:
        """Cells [n] of bits [planes, n]; at or above `count` where no cell has them."""
        code = np.zeros(bits.shape[1:], np.int64)
        for plane in bits:
            code = (code << 1) | plane
        return from_gray(code)

    def series(self) -> list[ShownFrame]:
        """Its frames: planes from the coarsest on, each inverted one after its own."""
        kinds = (False, True) if self.inverted else (False,)
        return [
            ShownFrame(GRAY, self.axis, cells=self.cells, bit=bit, inverted=kind)
            for bit in range(self.planes)
            for kind in kinds
        ]


def gray(number: IntArray) -> IntArray:
    """Gray codes of numbers."""
    return number ^ (number >> 1)


def from_gray(code: IntArray) -> IntArray:
    """Numbers of Gray codes below 2^32."""
    number = code.copy()
    for shift in (16, 8, 4, 2, 1):
        number ^= number >> shift
    return number


def gray_sets(frames: tuple[ShownFrame, ...]) -> dict[str, tuple[GraySet, dict[tuple[int, bool], int]]]:
    """By axis: the code that frames show, and their numbers by (bit, inverted).

    Raises ValueError for planes that are missing or shown twice, and for unequal numbers of cells.
    """
    found: dict[str, tuple[GraySet, dict[tuple[int, bool], int]]] = {}
    for axis in "xy":
        own = [(k, frame) for k, frame in enumerate(frames) if frame.shows == GRAY and frame.axis == axis]
        if not own:
            continue
        cells = own[0][1].cells
        numbers: dict[tuple[int, bool], int] = {}
        for k, frame in own:
            if frame.cells != cells:
                raise ValueError(f"frames[{k}].cells = {frame.cells:g}: must be {cells:g}, as of the planes before it")
            if (frame.bit, frame.inverted) in numbers:
                raise ValueError(f"frames[{k}]: {frame.text} is shown twice; must be shown once")
            numbers[frame.bit, frame.inverted] = k
        code = GraySet(axis, cells, any(inverted for _, inverted in numbers))
        wanted = {(frame.bit, frame.inverted) for frame in code.series()}
        for bit, inverted in sorted(wanted ^ set(numbers)):
            how = "missing" if (bit, inverted) in wanted else f"no plane of {cells:g} cells"
            raise ValueError(f"frames: {ShownFrame(GRAY, axis, bit=bit, inverted=inverted).text}: {how}")
        found[axis] = code, numbers
    return found
