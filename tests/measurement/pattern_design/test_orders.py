"""The probability of wrong fringe orders before there are images, against counted failures of unwrapping."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.measurement.pattern_design.orders import wrong_orders
from irtscots_cl.measurement.unwrapping import unwrap

COUNT = 40_000


def counted(periods, errors_rad, seed=0):
    """Share of pixels all over the screen whose place is wrong by half a fringe of the highest number of periods."""
    random = np.random.default_rng(seed)
    place = random.random(COUNT)
    p, error = np.array(periods)[:, None], np.broadcast_to(np.array(errors_rad)[:, None], (len(periods), COUNT))
    phase = np.angle(np.exp(1j * (2 * np.pi * p * place + error * random.standard_normal(error.shape))))
    found = unwrap(phase, error, periods)
    return place, error, float(np.mean(np.abs(found.fraction - place) * periods[-1] > 0.5))


@pytest.mark.parametrize(
    ("periods", "errors_rad"),
    [
        ((0.9, 5.0), (0.2, 0.2)),
        ((0.9, 5.4, 32.4), (0.2, 0.19, 0.2)),
        ((0.9, 23.82, 28.93), (0.162, 0.162, 0.18)),
        ((0.9, 19.8, 26.1, 28.9), (0.12, 0.336, 0.336, 0.36)),
    ],
)
def test_failures_are_counted_as_predicted(periods, errors_rad):
    """Around one in a hundred: 400 failures, whose scatter is 5 %; the sum over all others is up to 10 % too high.
    Beyond 4 sigma and 15 %: 1 in 10000."""
    place, error, share = counted(periods, errors_rad)
    predicted = float(wrong_orders(periods, error, place).mean())
    assert 0.003 < share < 0.03
    assert abs(share - predicted) < 4 * np.sqrt(share / COUNT) + 0.15 * predicted


def test_two_series_have_a_closed_form():
    """The phase of 0.9 periods says where in 5: wrong where the difference is beyond half a fringe."""
    from scipy.special import erfc

    sigma = np.hypot(0.15 * 5 / 0.9, 0.2) / (2 * np.pi)
    found = wrong_orders((0.9, 5.0), np.array([[0.15], [0.2]]), np.array([0.5]))
    assert found[0] == pytest.approx(erfc(0.5 / sigma / np.sqrt(2)), rel=1e-3)


def test_order_of_the_series_does_not_matter_and_no_phase_is_no_order():
    errors = np.array([[0.3], [0.2], [0.25]])
    place = np.array([0.4])
    one = wrong_orders((0.9, 4.0, 20.0), errors, place)
    assert wrong_orders((20.0, 0.9, 4.0), errors[[2, 0, 1]], place) == pytest.approx(one)
    assert wrong_orders((0.9, 4.0), np.array([[np.inf], [0.1]]), place) == 1.0


def test_a_single_series_below_one_period_is_one_place_and_others_are_not():
    error, place = np.array([[0.1]]), np.array([0.5])
    assert wrong_orders((0.9,), error, place) == 0.0
    assert wrong_orders((3.0,), error, place) >= 0.5
