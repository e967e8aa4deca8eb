"""Sums of a trace as bytes: most bins of a window get no light, and few sums need all of 64 bits.

A block of values is one byte, of how many bytes each value has (0: all are 0); then, unless that is 0, one bit for each
value, set where it is not 0, and these values. Bytes are in the machine's order, which the checkpoint's facts tell.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import numpy as np

BLOCK = 2**16  # values: half a megabyte in memory, whatever the array has


def packed(array: np.ndarray) -> Iterator[bytes]:
    """The array, of 64-bit integers, block by block."""
    values = array.reshape(-1).view(np.uint64)
    for first in range(0, values.size, BLOCK):
        block = values[first : first + BLOCK]
        size = (int(block.max()).bit_length() + 7) // 8
        yield bytes([size])
        if size:
            some = block != 0
            yield np.packbits(some).tobytes()
            yield _low(block[some], size).tobytes()


def unpack(read: Callable[[int], bytes], array: np.ndarray) -> None:
    """Fill the array, of zeros, by read(bytes). Raises ValueError for what `packed` cannot have written."""
    values = array.reshape(-1).view(np.uint64)
    for first in range(0, values.size, BLOCK):
        block = values[first : first + BLOCK]
        (size,) = read(1)
        if size > 8:
            raise ValueError(f"{size} bytes of a value")
        if size:
            bits = np.unpackbits(np.frombuffer(read(-(-block.size // 8)), np.uint8))
            if bits[block.size :].any():
                raise ValueError("bits beyond the block")
            some = bits[: block.size].astype(bool)
            found = np.zeros(np.count_nonzero(some), np.uint64)
            _low(found, size)[:] = np.frombuffer(read(found.size * size), np.uint8).reshape(-1, size)
            block[some] = found


def _low(values: np.ndarray, size: int) -> np.ndarray:
    """The low bytes [n, size] of 64-bit values [n]; a view of them."""
    of_each = values.view(np.uint8).reshape(-1, 8)
    return of_each[:, :size] if sys.byteorder == "little" else of_each[:, 8 - size :]
