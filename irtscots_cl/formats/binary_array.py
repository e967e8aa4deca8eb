"""Numbers in binary files: an array that begins at a byte."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def binary_array(path: Path, dtype: np.dtype[Any], start: int, rows: int, columns: int) -> NDArray[Any]:
    """The numbers [rows, columns] that begin at byte `start`. Raises ValueError where the file ends before them."""
    count = rows * columns
    with open(path, "rb") as file:
        file.seek(start)
        data = file.read(count * dtype.itemsize)
    if len(data) < count * dtype.itemsize:
        raise ValueError(f"{path}: {len(data)} of {count * dtype.itemsize} bytes at {start}: cut off or broken")
    return np.frombuffer(data, dtype).reshape(rows, columns)
