"""What an error source is: by how much its value changes the places that pixels see.

A *parameter* has one value in a test, drawn from its distribution: a camera that is off, a screen brighter at one side.
A *constant* acts in every test alike, in full: diffraction. A *process* makes many random numbers in a test, and its
value is their size: the noise of pixels, vibration. Those of a *fixed pattern* are the same in all measurements of a
test: pixels of a screen that differ.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.counter_random import normal, uniform


@dataclass(frozen=True)
class Draw:
    """Which random numbers of a process: those of a trial, by seed; the process's own stream comes from its name.

    repeat: number of the measurement in a trial that has several; always 0 for what stays the same in all of them.
    """

    seed: int
    trial: int
    repeat: int = 0

    def normal(self, name: str, *shape: int) -> FloatArray:
        """Standard normal numbers of that shape, of the process of that name."""
        return normal(self.seed, stream_of(name), (self.trial, self.repeat), math.prod(shape)).reshape(shape)

    def uniform(self, name: str, *shape: int) -> FloatArray:
        """Numbers in (0, 1) of that shape, of the process of that name."""
        return uniform(self.seed, stream_of(name), (self.trial, self.repeat), math.prod(shape)).reshape(shape)


def stream_of(name: str) -> int:
    """The stream of random numbers of a process, from its name: the same whatever else is on."""
    return zlib.crc32(name.encode())


class Kind(Enum):
    """What the value of a source is."""

    PARAMETER = "parameter"
    CONSTANT = "constant"
    FIXED_PATTERN = "fixed pattern"
    PROCESS = "process"

    @property
    def is_random(self) -> bool:
        """Whether a value is the size of random numbers."""
        return self in (Kind.FIXED_PATTERN, Kind.PROCESS)

    @property
    def stays(self) -> bool:
        """Whether it is the same in every measurement of a test, not another draw."""
        return self is not Kind.PROCESS


class Source(Protocol):
    """name: as in [budget.sources], such as "camera.x_mm". unit: of its value; "" for a number. text: what it is.

    usual: a value of the usual size, without calibration.
    """

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def usual(self) -> float: ...
    @property
    def kind(self) -> Kind: ...

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places by a value; of random numbers, by one draw of that size.

        NaN for pixels that it leaves without light.
        """


def lit_changes(source: Source, design: MeasuredDesign, value: float, draw: Draw) -> tuple[FloatArray, BoolArray]:
    """Changes (du, dv) [2, n] of the places, 0 for pixels that a source leaves without light; and which [n] have it."""
    changes = source.changes_mm(design, value, draw)
    lit: BoolArray = np.isfinite(changes).all(0)
    return np.where(lit, changes, 0.0), lit
