"""One series of fringes without any other: its phase unwrapped over the image, island by island.

Each island of the mask gets its own multiple of 2 pi, which nothing in its phases tells. The design's prediction of the
phase tells it; without one, the islands have no places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skimage.measure import label
from skimage.restoration import unwrap_phase

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray

TAU = 2 * np.pi


@dataclass(frozen=True)
class Island:
    """pixels: number of them. order: multiple of 2 pi that was added. gap_turns: median difference from the prediction
    after that, in periods: beyond 0.25 of a period, the order is in doubt."""

    pixels: int
    order: int
    gap_turns: float


@dataclass(frozen=True)
class UnwrappedImage:
    """phase_rad: [rows, columns], NaN outside the mask. number: [rows, columns] of the islands, 0 outside."""

    phase_rad: FloatArray
    number: IntArray
    islands: tuple[Island, ...]


def unwrap_image(phase_rad: FloatArray, mask: BoolArray, predicted_rad: FloatArray) -> UnwrappedImage:
    """The phase [rows, columns] without jumps of 2 pi inside the islands of a mask (skimage.restoration.unwrap_phase).

    predicted_rad: [rows, columns] the phase that the design predicts. Pixels without a phase are left out. Raises
    ValueError where the prediction is missing for a whole island.
    """
    number: IntArray = label(mask & np.isfinite(phase_rad), connectivity=1)
    result = np.full(phase_rad.shape, np.nan)
    islands = []
    for k in range(1, int(number.max()) + 1):
        rows, columns = np.nonzero(number == k)
        box = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
        inside = number[box] == k
        # finite values and a mask only, one island at a time, and no seed: with one, it does not repeat to the bit
        values = np.ma.masked_array(np.where(inside, phase_rad[box], 0.0), ~inside)
        whole = values.data[inside] if inside.sum() < 2 else _unwrapped(values)[inside]
        gap = (predicted_rad[box][inside] - whole) / TAU
        if not np.isfinite(gap).any():
            place = f"row {rows[0]}, column {columns[0]}"
            raise ValueError(f"island {k} of the mask, at {place}: no phase is predicted there")
        order = int(np.rint(np.nanmedian(gap)))
        result[box][inside] = whole + order * TAU
        islands.append(Island(int(inside.sum()), order, float(np.nanmedian(gap) - order)))
    return UnwrappedImage(result, number, tuple(islands))


def _unwrapped(values: np.ma.MaskedArray) -> FloatArray:
    """Unwrapped phases; images of one row or column as lines, which unwrap_phase refuses as images."""
    if 1 in values.shape:
        return np.unwrap(values.data.ravel()).reshape(values.shape)
    return np.asarray(np.ma.getdata(unwrap_phase(values)), float)
