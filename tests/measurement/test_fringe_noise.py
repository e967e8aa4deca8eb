"""Noise from residuals, series that have another cause, and errors from the agreement of series."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.measurement.fringe_noise import (
    errors_of_agreement,
    estimate_noise,
    excess_errors,
    series_variance,
)
from irtscots_cl.measurement.unwrapping import unwrap

N = 20_000


def test_read_and_photon_noise_are_told_apart():
    random = np.random.default_rng(1)
    signal = random.uniform(10, 200, N)
    square = (4.0 + 0.2 * signal) * random.chisquare(5, N)
    square[: N // 20] *= 50  # motion
    found = estimate_noise(square, np.full(N, 5.0), signal)
    for level in (20.0, 100.0, 180.0):
        assert found.variance(np.array(level)) == pytest.approx(4 + 0.2 * level, rel=0.12)  # the trimmed share
    assert estimate_noise(square, np.zeros(N), signal) is None


def test_a_series_variance_is_its_median():
    random = np.random.default_rng(2)
    square = 3.0 * random.chisquare(2, N)
    square[: N // 20] = 1e6
    assert series_variance(square, np.full(N, 2.0)) == pytest.approx(3.0, rel=0.15)
    assert np.isnan(series_variance(square, np.zeros(N)))


def test_series_that_are_no_noise_count_less_or_not_at_all():
    amplitude = np.array([100.0, 90.0, 60.0, 0.5])
    factor = excess_errors(np.array([1.0, 100.0, 900.0, 1e-9]), amplitude)
    np.testing.assert_allclose(factor, [1, 10, np.inf, np.inf])
    # less than 1 % of the fringes is nothing to speak of, and nothing is said of what is not known
    np.testing.assert_array_equal(excess_errors(np.array([1e-20, 1e-3, np.nan]), amplitude[:3]), 1)
    np.testing.assert_array_equal(excess_errors(np.full(3, np.nan), amplitude[:3]), 1)


def test_errors_of_agreement_are_those_of_noise_that_all_samples_share():
    """Also where the series differ in amplitude; of a single series nothing is known."""
    random, periods = np.random.default_rng(3), (0.9, 1.7, 2.9)
    amplitude = np.array([1.0, 0.7, 0.3])[:, None] * np.ones(N)
    place = random.uniform(0.2, 0.8, N)
    true = 0.01 / amplitude
    phase = 2 * np.pi * np.array(periods)[:, None] * place + true * random.standard_normal((3, N))
    errors = errors_of_agreement(phase, amplitude, periods)
    np.testing.assert_allclose(errors, true, rtol=0.05)  # of the median of 8000: 2 %
    pulls = (unwrap(phase, errors, periods).fraction - place) / unwrap(phase, errors, periods).standard_error
    assert np.std(pulls) == pytest.approx(1, abs=0.05)
    np.testing.assert_array_equal(errors_of_agreement(phase[:1], amplitude[:1], periods[:1]), 0)
