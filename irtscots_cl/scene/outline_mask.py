"""The picture of a mirror's outline of shape "mask"."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.mask_values import check_two_values, picture_values
from irtscots_cl.maths.arrays import BoolArray

MAX_PIXELS = 2**24  # of a mask: on a device it takes a fourth of a byte for each, in single precision
MAX_PER_AXIS = 2**14  # single precision tells its pixels apart by 1/1000


def outline_mask(outline: Any) -> BoolArray:
    """Where the mirror is [rows, columns], of an Outline of shape "mask": row 0 has the lowest y.

    Raises ValueError, with a message of one line, for a file that is no mask.
    """
    path = Path(outline.file)
    changed = path.stat().st_mtime_ns if path.is_file() else 0
    return _read(path, changed)


@functools.lru_cache(maxsize=4)
def _read(path: Path, changed: int) -> BoolArray:
    what = f"mirror.outline.file = {str(path)!r}"
    values = picture_values(path, what)
    if values.ndim != 2 or values.size > MAX_PIXELS or max(values.shape) > MAX_PER_AXIS:
        size = " x ".join(map(str, values.shape[::-1])) or "one value"
        raise ValueError(
            f"{what}: has {size} pixels; must be a picture of at most {MAX_PIXELS} pixels, {MAX_PER_AXIS} along an axis"
        )
    check_two_values(values, what, "the mirror is not")
    mask: BoolArray = np.ascontiguousarray(values != 0)
    mask.setflags(write=False)
    return mask
