"""Turbulence of von Karman's spectrum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from irtscots_cl.maths.von_karman import fields, phase_rms, slopes, spectrum, structure_function

OUTER = 320.0


def numbers(seed: int, size: int = 256):
    random = np.random.default_rng(seed)
    return random.standard_normal((size, size)) + 1j * random.standard_normal((size, size))


def test_structure_function_of_the_fields():
    """24 fields, 8 outer scales wide: some 1500 independent places, 4 % of a mean square; 3 sigma."""
    made = np.concatenate([fields(numbers(seed), 10.0, OUTER) for seed in range(12)])
    for steps in (2, 4, 8, 16, 32):
        for axis in (1, 2):
            found = np.mean((np.roll(made, steps, axis) - made) ** 2)
            assert found == pytest.approx(structure_function(10.0 * steps, OUTER), rel=0.1), steps
    assert abs(np.mean(made[::2] * made[1::2])) < 0.05  # two of a pair are independent


def test_variance_is_one():
    whole, _ = quad(lambda k: 2 * np.pi * k * spectrum(k, OUTER), 0, np.inf)
    assert whole == pytest.approx(1, rel=1e-6)
    assert structure_function(100 * OUTER, OUTER) == pytest.approx(2, rel=1e-9)


def test_fried_parameter():
    """Far below the outer scale: 6.88 (r / r0)^(5/3), less the share 1.485 (r / L0)^(1/3) (Hardy, 3.4)."""
    distance, fried, outer = 1.0, 50.0, 1e6
    found = phase_rms(fried, outer) ** 2 * structure_function(distance, outer)
    kolmogorov = 6.88388 * (distance / fried) ** (5 / 3)
    assert found / kolmogorov == pytest.approx(1 - 1.485 * (distance / outer) ** (1 / 3), abs=1e-3)
    assert phase_rms(100.0, 1000.0) == pytest.approx(0.0863**0.5 * 10 ** (5 / 6), rel=1e-3)


def test_slopes_are_those_of_the_fields():
    step, smooth = 4.0, 20.0
    made, derived = (call(numbers(3), step, OUTER, smooth) for call in (fields, slopes))
    for k in range(2):
        for axis, along in enumerate((1, 0)):  # by x: from column to column
            told = (np.roll(made[k], -1, along) - np.roll(made[k], 1, along)) / (2 * step)
            assert np.abs(derived[k, ..., axis] - told).max() < 0.03 * np.abs(told).max()
