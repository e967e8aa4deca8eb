"""Random numbers by counter: a pure function of seed, stream, place and index, with the right distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.maths.counter_random import normal, uniform

COUNT = 100_000
CHANCE = 1e-4  # of a test of a distribution to fail by luck; the seeds are fixed, so it fails always or never


def test_the_same_key_gives_the_same_numbers_whatever_was_drawn_before():
    first = uniform(1, 2, (3, 4), 50)
    uniform(9, 9, (9, 9), 7)
    np.testing.assert_array_equal(uniform(1, 2, (3, 4), 50), first)
    np.testing.assert_array_equal(uniform(1, 2, (3, 4), 10), first[:10])  # fewer are the first of more


@pytest.mark.parametrize(
    "other",
    [(2, 2, (3, 4)), (1, 3, (3, 4)), (1, 2, (4, 4)), (1, 2, (3, 5)), (1, 2, (4, 3)), (2**63, 2, (3, 4))],
)
def test_another_seed_stream_or_place_gives_unrelated_numbers(other):
    one, two = uniform(1, 2, (3, 4), COUNT), uniform(*other, COUNT)
    assert abs(np.corrcoef(one, two)[0, 1]) < 4 / COUNT**0.5  # 4 sigma: chance 6e-5
    assert len(np.intersect1d(one, two)) == 0  # no shifted copy: of 2^53 values 1e10 pairs share one with 1e-6


def philox(counter: list[int], key: list[int]) -> list[int]:
    """Philox4x64-10 as published, in plain integers."""
    full = 2**64 - 1
    (a, b, c, d), (k, m) = counter, key
    for _ in range(10):
        one, two = a * 0xD2E7470EE14C6C93, c * 0xCA5A826395121157
        a, b, c, d = (two >> 64) ^ b ^ k, two & full, (one >> 64) ^ d ^ m, one & full
        k, m = (k + 0x9E3779B97F4A7C15) & full, (m + 0xBB67AE8584CAA73B) & full
    return [a, b, c, d]


def test_the_words_are_those_of_philox():
    """The published answer for zeros, and our layout: seed and stream as key; block, place, 0 as counter, from 1."""
    published = [0x16554D9ECA36314C, 0xDB20FE9D672D0FDC, 0xD7E772CEE186176B, 0x7E68B68AEC7BA23B]
    assert philox([0] * 4, [0] * 2) == published
    words = [word for block in (1, 2) for word in philox([block, 2**40 + 3, 5, 0], [2**63, 7])]
    expected = [((word >> 11) + 0.5) / 2**53 for word in words]
    np.testing.assert_array_equal(uniform(2**63, 7, (2**40 + 3, 5), 8), expected)


def test_numbers_are_uniform_and_never_0_or_1():
    values = uniform(5, 1, (0, 0), COUNT)
    assert stats.kstest(values, "uniform").pvalue > CHANCE
    assert values.min() > 0 and values.max() < 1


def test_normal_numbers_are_standard_normal():
    assert stats.kstest(normal(5, 1, (0, 1), COUNT), "norm").pvalue > CHANCE
