"""Sums as bytes: the same numbers again, few bytes for dark bins, and nothing from what was not packed."""

from __future__ import annotations

import io

import numpy as np
import pytest

from irtscots_cl.execution.packed_sums import BLOCK, packed, unpack

LARGEST = 2**64 - 1


def again(array: np.ndarray) -> np.ndarray:
    found = np.zeros_like(array)
    file = io.BytesIO(b"".join(packed(array)))
    unpack(file.read, found)
    assert file.read() == b""
    return found


@pytest.mark.parametrize("top", [1, 255, 256, 2**24, 2**31, 2**40, LARGEST])
@pytest.mark.parametrize("shape", [(0,), (1,), (7, 3), (2, BLOCK), (3, BLOCK // 2 + 1)])
def test_the_same_numbers_come_back(top, shape):
    random = np.random.default_rng(1)
    values = random.integers(0, top, shape, np.uint64, endpoint=True)
    values[random.uniform(size=shape) < 0.5] = 0
    np.testing.assert_array_equal(again(values), values)


def test_dark_bins_take_an_eighth_of_a_byte_and_sums_the_bytes_that_they_need():
    values = np.zeros(3 * BLOCK, np.uint64)
    values[BLOCK : BLOCK + 100] = 2**31
    assert len(b"".join(packed(values))) == 3 + BLOCK // 8 + 4 * 100


@pytest.mark.parametrize("data", [b"\x09" + bytes(100), b"\x01\x01\x07"])
def test_what_was_not_packed_is_refused(data):
    with pytest.raises(ValueError, match="bytes of a value|bits beyond"):
        unpack(io.BytesIO(data).read, np.zeros(3, np.uint64))
