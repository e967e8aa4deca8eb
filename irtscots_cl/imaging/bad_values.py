"""Values in arrays of images that are no measurement: NaN, infinities, and what would overflow."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

MAX_VALUE = 1e100  # of images and positions from files: squares of their sums stay finite


def first_bad_value(values: ArrayLike, nan_allowed: bool = False) -> tuple[int, ...] | None:
    """Index of the first value, in C order, that is not finite or beyond MAX_VALUE in size; None if there is none.

    nan_allowed: NaN marks a missing sample, and is no bad value.
    """
    array = np.asarray(values)
    if array.size == 0 or array.dtype.kind != "f":  # integers are finite, and at most 2^64
        return None
    low, high = (np.fmin.reduce, np.fmax.reduce) if nan_allowed else (np.min, np.max)  # without further arrays
    lowest, highest = float(low(array, axis=None)), float(high(array, axis=None))
    if (lowest >= -MAX_VALUE and highest <= MAX_VALUE) or (nan_allowed and np.isnan(lowest)):
        return None
    bad = np.isinf(array) if nan_allowed else ~np.isfinite(array)
    if float(np.finfo(array.dtype).max) > MAX_VALUE:
        bad |= np.abs(array) > MAX_VALUE
    return tuple(int(k) for k in np.unravel_index(np.argmax(bad), array.shape))


def check_values(name: str, values: ArrayLike, nan_allowed: bool = False, first: tuple[int, ...] = ()) -> None:
    """Raise ValueError, naming the array, the index and the value, for the first bad value.

    first: index in the named array of the values' first one, if they are a part of it.
    """
    index = first_bad_value(values, nan_allowed)
    if index is not None:
        value, whole = (
            np.asarray(values)[index],
            [a + b for a, b in zip(index, first or (0,) * len(index), strict=True)],
        )
        place = f"[{', '.join(map(str, whole))}]" if index else ""
        raise ValueError(f"{name}{place} = {float(value)}: must be a finite number within {MAX_VALUE:g}")
