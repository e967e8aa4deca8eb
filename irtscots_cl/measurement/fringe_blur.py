"""Why modulation falls with the number of periods: how much of it the pixels' own size explains.

A pixel averages the fringes over the patch of the screen that it sees. Over a parallelogram with the steps (r, c) of
the fraction from row to row and from column to column a sinusoid of p periods keeps sinc(p r) sinc(p c) of itself. What
is lost beyond that is the blur of lens, focus and screen, and light that comes from elsewhere on the screen: the latter
shows already at few periods.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates

USEFUL = 0.02  # of the lowest series' amplitude that the pixels' size leaves: below, ratios to it say nothing


@dataclass(frozen=True)
class BlurFact:
    """Amplitudes of a series over those of the lowest, medians over pixels. measured; by_pixel: what the pixels' size
    makes it; left: measured over by_pixel, pixel by pixel: 1 where their size explains all. spread, measured_spread:
    relative half-widths (16 % to 84 %) of `left` and of `measured`: the former is smaller where the pixels' size
    explains how pixels differ."""

    periods: float
    measured: float
    by_pixel: float
    left: float
    spread: float
    measured_spread: float


def pixel_modulation(fraction: FloatArray, periods: float) -> FloatArray:
    """What a pixel's own size leaves of a sinusoid's amplitude [rows, columns]; NaN beside missing places."""
    rows, columns = (_steps(fraction, axis) for axis in (0, 1))
    left: FloatArray = np.abs(np.sinc(periods * rows) * np.sinc(periods * columns))
    return left


def _steps(fraction: FloatArray, axis: int) -> FloatArray:
    """Central differences from pixel to pixel; NaN at the ends."""
    steps = np.full(fraction.shape, np.nan)
    inner = [slice(None), slice(None)]
    inner[axis] = slice(1, -1)
    ahead, behind = list(inner), list(inner)
    ahead[axis], behind[axis] = slice(2, None), slice(None, -2)
    steps[tuple(inner)] = (fraction[tuple(ahead)] - fraction[tuple(behind)]) / 2
    return steps


def explain_modulation(found: AxisCoordinates) -> tuple[BlurFact, ...]:
    """The fall of modulation in each series beyond the lowest, in the order of their numbers of periods."""
    periods = found.fringes.periods
    lowest, *others = np.argsort(periods)
    base = pixel_modulation(found.fraction, periods[lowest])
    facts = []
    for k in others:
        by_pixel = pixel_modulation(found.fraction, periods[k]) / base
        with np.errstate(divide="ignore", invalid="ignore"):
            measured = np.asarray(found.amplitude[k], float) / found.amplitude[lowest]
        known = np.isfinite(by_pixel + measured) & (by_pixel > USEFUL)
        if not known.any():
            continue
        left = measured[known] / by_pixel[known]
        facts.append(
            BlurFact(
                float(periods[k]),
                float(np.median(measured[known])),
                float(np.median(by_pixel[known])),
                float(np.median(left)),
                _half_width(left),
                _half_width(measured[known]),
            )
        )
    return tuple(facts)


def _half_width(values: NDArray[Any]) -> float:
    low, middle, high = np.percentile(values, [16, 50, 84])
    return float((high - low) / 2 / middle)
