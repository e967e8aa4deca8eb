"""Random numbers that are a pure function of (seed, stream, place, index): the same in any order and any split.

Philox4x64-10 (Salmon, Moraes, Dror, Shaw: Parallel random numbers: as easy as 1, 2, 3; SC'11) as NumPy has it: seed and
stream are its key, the place is in its counter, and index k is the k-th word from there. Normal and other variates come
from one word each by the inverse of their distribution, so that no number depends on another one's value.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from irtscots_cl.maths.arrays import FloatArray


def uniform(seed: int, stream: int, place: tuple[int, int], count: int) -> FloatArray:
    """`count` numbers in (0, 1), multiples of 2^-54: neither end is reached.

    place: two integers from 0 to 2^64 - 1; seed and stream likewise.
    """
    # The lowest of the counter's four words numbers the blocks of four random words.
    generator = np.random.Philox(counter=_words(0, *place, 0), key=_words(seed, stream))
    return ((generator.random_raw(count) >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53


def normal(seed: int, stream: int, place: tuple[int, int], count: int) -> FloatArray:
    """`count` standard normal numbers, each from one word; arguments as of `uniform`."""
    values: FloatArray = ndtri(uniform(seed, stream, place, count))
    return values


def _words(*values: int) -> NDArray[np.uint64]:
    return np.array(values, np.uint64)
