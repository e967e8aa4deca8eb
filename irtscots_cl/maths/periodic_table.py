"""A function of an angle, tabulated at equal steps over a turn and interpolated linearly."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import FloatArray

TAU = 2 * np.pi


@dataclass(frozen=True)
class PeriodicTable:
    """values: [count + 1] at equal steps from -pi to pi, the last one as the first. rises: [count + 1] to the next."""

    values: FloatArray = field(repr=False)
    rises: FloatArray = field(repr=False)

    @classmethod
    def of(cls, values: FloatArray) -> PeriodicTable:
        """The table of values [count + 1]."""
        return cls(values, np.append(np.diff(values), values[1] - values[0]))

    def at(self, angle_rad: FloatArray) -> FloatArray:
        """Values [n] at any angles [n]; NaN where these are no numbers. Equal steps need no search."""
        count = len(self.values) - 1
        place = angle_rad * (1 / TAU)
        with np.errstate(invalid="ignore"):  # what is no number stands at any step: its place is none all the same
            place -= np.rint(place)
            place += 0.5
            place *= count
            step = place.astype(np.intp)
        place -= step
        place *= self.rises.take(step, mode="clip")
        place += self.values.take(step, mode="clip")
        return place
