"""A series of fringes that repeats over the screen: its phase unwrapped over the image, island by island.

Each island of the mask gets its own multiple of 2 pi, its order, which nothing in its phases tells. A prior for the
place, as a design's, tells it, and how sure it is: the gap between prediction and phase, in periods, is the prior's
error less a whole number; for normal errors of this size each whole number has its probability.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import find_objects
from scipy.stats import norm
from skimage.measure import label
from skimage.restoration import unwrap_phase

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray

TAU = 2 * np.pi
ROUNDS = 4  # of leaving out pixels beside jumps
ORDERS = np.arange(-8, 9)  # beside the nearest one, that are compared
MAD = float(1 / norm.isf(0.25))  # standard deviation of a normal distribution over its median absolute deviation


@dataclass(frozen=True)
class Island:
    """pixels: number of them. row, column: of the first one. order: multiple of 2 pi that was added. gap_turns: median
    difference from the prediction after that, in periods. wrong: probability that the order is another one; 1 where
    nothing is predicted for the island."""

    pixels: int
    row: int
    column: int
    order: int
    gap_turns: float
    wrong: float


@dataclass(frozen=True)
class UnwrappedImage:
    """phase_rad: [rows, columns], NaN outside the islands, and where nothing is predicted for one. number: [rows,
    columns] of the islands, 0 outside."""

    phase_rad: FloatArray = field(repr=False)
    number: IntArray = field(repr=False)
    islands: tuple[Island, ...]

    @property
    def wrong(self) -> FloatArray:
        """Probability [rows, columns] that a pixel's order is wrong; 1 outside the islands."""
        chances: FloatArray = np.array([1.0, *(island.wrong for island in self.islands)])[self.number]
        return chances


def unwrap_image(
    phase_rad: FloatArray, mask: BoolArray, predicted_rad: FloatArray, error_rad: FloatArray | float
) -> UnwrappedImage:
    """The phase [rows, columns] without jumps of 2 pi inside the islands of a mask (skimage.restoration.unwrap_phase).

    predicted_rad: [rows, columns] the phase that a design predicts, error_rad: its standard error, common to the pixels
    of an island. Pixels without a phase are left out, and so are those beside a jump of more than pi that no order
    takes away: an edge of the surface, or fringes finer than the pixels.
    """
    whole, number = _without_jumps(phase_rad, mask & np.isfinite(phase_rad))
    result = np.full(phase_rad.shape, np.nan)
    error_turns = np.broadcast_to(error_rad, phase_rad.shape) / TAU
    islands = []
    for k, box in enumerate(find_objects(number), start=1):
        inside = number[box] == k
        first = int(np.flatnonzero(inside)[0])
        row, column = (int(a + b.start) for a, b in zip(np.unravel_index(first, inside.shape), box, strict=True))
        gap = (predicted_rad[box][inside] - whole[box][inside]) / TAU
        order, rest, wrong = _order(gap, error_turns[box][inside])
        if wrong < 1:
            result[box][inside] = whole[box][inside] + order * TAU
        islands.append(Island(int(inside.sum()), row, column, order, rest, wrong))
    return UnwrappedImage(result, number, tuple(islands))


def _order(gap_turns: FloatArray, error_turns: FloatArray) -> tuple[int, float, float]:
    """Order of an island, the gap that it leaves, and the probability that it is wrong, from gaps [n] with the standard
    error [n] of the prediction.

    Where the gaps scatter, the surface is not the predicted one: the prediction's error is that large at least.
    """
    known = np.isfinite(gap_turns) & np.isfinite(error_turns)
    if not known.any():
        return 0, float("nan"), 1.0
    gap = float(np.median(gap_turns[known]))
    scatter = MAD * float(np.median(np.abs(gap_turns[known] - gap)))
    error = max(float(np.hypot(np.median(error_turns[known]), scatter)), 1e-6)
    order = int(np.rint(gap))
    rest = gap - order
    others = ORDERS[ORDERS != 0]
    odds = float(np.exp(-(np.square(rest - others) - rest**2) / (2 * error**2)).sum())
    return order, rest, odds / (1 + odds)


def _without_jumps(phase_rad: FloatArray, known: BoolArray) -> tuple[FloatArray, IntArray]:
    """Phases unwrapped island by island, and the islands' numbers [rows, columns], 0 outside."""
    known = known.copy()
    for _ in range(ROUNDS):
        number: IntArray = label(known, connectivity=1)
        whole = np.full(phase_rad.shape, np.nan)
        for k, box in enumerate(find_objects(number), start=1):
            inside = number[box] == k
            # finite values and a mask only, one island at a time, and no seed: with one, it does not repeat to the bit
            values = np.ma.masked_array(np.where(inside, phase_rad[box], 0.0), ~inside)
            whole[box][inside] = values.data[inside] if inside.sum() < 2 else _unwrapped(values)[inside]
        jumps = _beside_jumps(whole)
        if not jumps.any():
            return whole, number
        known &= ~jumps
    whole[~known] = np.nan
    return whole, label(known, connectivity=1)


def _beside_jumps(phase_rad: FloatArray) -> BoolArray:
    """Pixels [rows, columns] that differ from a neighbour by more than pi."""
    beside = np.zeros(phase_rad.shape, bool)
    with np.errstate(invalid="ignore"):
        rows, columns = (np.abs(np.diff(phase_rad, axis=axis)) > np.pi for axis in (0, 1))
    beside[1:] |= rows
    beside[:-1] |= rows
    beside[:, 1:] |= columns
    beside[:, :-1] |= columns
    return beside


def _unwrapped(values: np.ma.MaskedArray) -> FloatArray:
    """Unwrapped phases; images of one row or column as lines, which unwrap_phase refuses as images."""
    if 1 in values.shape:
        return np.unwrap(values.data.ravel()).reshape(values.shape)
    return np.asarray(np.ma.getdata(unwrap_phase(values)), float)
