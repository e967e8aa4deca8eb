"""Steps found from images whose own steps were not the nominal ones."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.fringes import equal_steps
from irtscots_cl.measurement.harmonics import wrapped
from irtscots_cl.measurement.phase_steps import find_steps

PIXELS = 1000


def samples_of(steps, span=1.0, seed=1, noise=1.0):
    random = np.random.default_rng(seed)
    phase = 2 * np.pi * span * random.uniform(0, 1, PIXELS)
    offset = random.uniform(80, 120, PIXELS)
    clean = offset * (1 + 0.9 * np.cos(phase - np.asarray(steps)[:, None]))
    return clean + noise * random.normal(size=clean.shape)


@pytest.mark.parametrize("span", [1.0, 0.3])
def test_sixteen_images_with_fifteenths_are_noticed(span):
    """The first and the last image of a full turn: steps of 2 pi / 15, said to be of 2 pi / 16."""
    true = 2 * np.pi * np.arange(16) / 15
    found = find_steps(samples_of(true, span), np.array(equal_steps(16)))
    assert found.wrong.size > 8
    np.testing.assert_allclose(wrapped(found.found_rad - true), 0, atol=0.03)
    assert np.diff(found.found_rad).mean() == pytest.approx(2 * np.pi / 15, rel=4e-3)


@pytest.mark.parametrize("count", [5, 8, 16])
def test_right_steps_are_confirmed_within_their_errors(count):
    nominal = np.array(equal_steps(count))
    pulls = []
    for seed in range(30):
        found = find_steps(samples_of(nominal, seed=seed), nominal)
        assert not found.wrong.size
        pulls.append(found.difference_rad / found.standard_error_rad)
    # at least 30 x 3 independent numbers: chance of failure below 1e-6
    assert np.mean(np.square(pulls)) == pytest.approx(1.0, abs=5 * np.sqrt(2 / (30 * (count - 2))))


def test_a_single_wrong_frame_is_named():
    nominal = np.array(equal_steps(8))
    true = nominal.copy()
    true[5] += 0.6
    found = find_steps(samples_of(true), nominal)
    assert 5 in found.wrong and np.argmax(np.abs(found.difference_rad)) == 5
    # apart from the common step, which is shared out
    np.testing.assert_allclose(np.ptp(wrapped(found.found_rad - true)), 0, atol=0.15)


@pytest.mark.parametrize("count", [8, 16])
def test_a_repeated_step_leaves_the_others_where_they_were_said(count):
    """No part of its error is taken for a step common to all frames: that would move all places."""
    true = np.array(equal_steps(count))
    true[2] = true[1]
    found = find_steps(samples_of(true), np.array(equal_steps(count)))
    assert list(found.wrong) == [2]
    np.testing.assert_allclose(wrapped(found.found_rad - true), 0, atol=0.01)  # noise: 0.002 rad


def test_what_images_cannot_tell_is_not_said():
    nominal = np.array(equal_steps(4))
    assert find_steps(samples_of(nominal), nominal) is None
    steps = np.array(equal_steps(8))
    assert find_steps(samples_of(steps)[:, :10], steps) is None
    even = np.broadcast_to(100 + 90 * np.cos(0.4 - steps[:, None]), (8, PIXELS))
    assert find_steps(even, steps) is None  # one phase for all pixels
