"""Noise against light: gain and read noise come out with their errors; other laws are seen."""

from __future__ import annotations

import numpy as np
import pytest
from fringe_stacks import disk, fringe_stack

from irtscots_cl.measurement.fringe_factors import frame_factors
from irtscots_cl.measurement.photon_transfer import photon_transfer


def samples(variance, seed=1, count=40_000):
    random = np.random.default_rng(seed)
    light = random.uniform(0, 1000, count)
    return random.standard_normal(count) ** 2 * variance(light), light


def test_gain_and_read_noise_are_free_of_bias():
    """20 seeds: the mean pull is known to 0.22; 5 sigma are 6e-7."""
    pulls = []
    for seed in range(20):
        found = photon_transfer(*samples(lambda light: 9 + 0.25 * light, seed))
        assert found is not None and found.chance > 1e-6 and found.read_noise == pytest.approx(3, abs=1.2)
        pulls.append((found.gain - 0.25) / found.gain_error)
    assert abs(np.mean(pulls)) < 5 / np.sqrt(20) and 0.4 < np.std(pulls) < 2.0


def test_no_electrons_without_noise_of_light_and_a_curve_is_no_line():
    found = photon_transfer(*samples(lambda light: 9 + 0 * light))
    assert found is not None and np.isnan(found.electrons_per_count)
    bent = photon_transfer(*samples(lambda light: 9 + 1e-3 * light**2))
    assert bent is not None and bent.chance < 1e-6 and bent.departs() > 0.3
    assert photon_transfer(np.ones(20), np.ones(20)) is None


def test_electrons_of_fringe_images():
    """Harmonics of a gamma are not taken for noise."""
    for gamma in (1.0, 2.2):
        found = frame_factors(fringe_stack(gamma=gamma, electrons=4.0, uneven=0.9), disk()).transfer
        assert found is not None
        assert found.gain > 5 * found.gain_error
        assert found.gain == pytest.approx(1 / 4.0, abs=4 * found.gain_error)
