"""Maps from NPY files: one number for each pixel of a detector or a screen."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.validation import problem


def read_map(path: str, key: str, shape: tuple[int, int]) -> FloatArray:
    """The map [rows, columns] of an NPY file that a scene names under `key`.

    Raises SceneError for a file that cannot be read, or whose values are not numbers, finite and at least 0, of this
    shape.
    """
    try:
        # The header alone is read: the shape is checked first. Objects, which could run code, are refused.
        values = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or "it is not an NPY file with one array of numbers"
        raise problem(path, (), f"{key}: cannot be read: {reason}") from None
    if values.dtype.kind not in "fiu":
        raise problem(path, (), f"{key}: holds values of type {values.dtype}; must be numbers")
    if values.shape != shape:
        raise problem(path, (), f"{key}: has shape {values.shape}; must be [rows, columns] = {list(shape)}")
    numbers: FloatArray = np.array(values, np.float64)
    wrong = np.argwhere(~(np.isfinite(numbers) & (numbers >= 0)))
    if len(wrong):
        row, column = wrong[0]
        place = f"row {row}, column {column}"
        raise problem(path, (), f"{key}: {numbers[row, column]} at {place}; must be finite and at least 0")
    return numbers
