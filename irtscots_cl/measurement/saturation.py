"""The ceiling of a camera's values, found in its images."""

from __future__ import annotations

import math

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.maths.arrays import FloatArray

LEVELS = 4  # highest values below the ceiling that it is compared with
CROWDED = 8.0  # times as many samples at the ceiling as at those: light that changes smoothly has at most 3
MIN_SAMPLES = 20  # at the ceiling: symmetric scenes have a few equal samples
BITS = range(8, 17)  # of a camera's values, right- or left-justified in 8 or 16 bits


def find_ceiling(stack: ImageStack) -> float:
    """The value at which samples of both scans are cut off, in the images' unit; infinite where there is none.

    A ceiling is the highest value, if far more samples have it than the values next to it; or if it is the highest code
    of a camera and all samples are whole numbers: such a sample may have been any higher value.
    """
    top = [_highest(scan.flux_w) for scan in (stack.x, stack.y)]
    values, counts = max(top, key=lambda found: float(found[0][0]) if len(found[0]) else -math.inf)
    if not len(values) or values[0] <= 0:
        return math.inf
    whole = all(_are_whole(scan.flux_w) for scan in (stack.x, stack.y))
    codes = {float((2**bits - 1) << shift) for bits in BITS for shift in (0, 16 - bits)}
    if whole and float(values[0]) in codes:
        return float(values[0])
    if counts[0] >= MIN_SAMPLES and counts[0] > CROWDED * np.mean(counts[1 : 1 + LEVELS] if len(counts) > 1 else 0.0):
        return float(values[0])
    return math.inf


def _highest(samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The highest different values, in falling order, and how many samples have each."""
    flat = samples.ravel()
    top = np.nanmax(flat, initial=-math.inf)
    # so many that the ceiling's neighbours are among them, however many samples lie at the ceiling itself
    below = flat[(flat > 0.9 * top) & (flat < top)]
    values, counts = np.unique(below, return_counts=True)
    at_top = float(np.count_nonzero(flat == top))
    return np.append(top, values[::-1][:LEVELS]), np.append(at_top, counts[::-1][:LEVELS])


def _are_whole(samples: FloatArray) -> bool:
    known = samples[np.isfinite(samples)]
    return bool(known.size) and bool(np.all(known == np.rint(known)))
