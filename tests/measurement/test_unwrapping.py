"""Places on the screen from phases of several numbers of periods: pulls, and how often the orders are wrong."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.measurement.unwrapping import Prior, phase_floor, refined, unwrap

PIXELS = 100_000
FAILURE_CHANCE = 1e-6
Z = float(stats.norm.isf(FAILURE_CHANCE / 4))
SOFAST = (0.9, 3.9, 15.9, 63.9)


def measured(periods, sigma, pixels=PIXELS, seed=1):
    """Places [n], phases [series, n] with normal errors, and their error bars."""
    random = np.random.default_rng(seed)
    place = random.uniform(0, 1, pixels)
    errors = np.broadcast_to(np.reshape(sigma, (-1, 1)), (len(periods), pixels)).copy()
    phase = 2 * np.pi * np.array(periods)[:, None] * place + random.normal(size=errors.shape) * errors
    return place, np.angle(np.exp(1j * phase)), errors


def orders_differ(place, found, phases, periods):
    p = np.array(periods)[:, None]
    return (np.rint(p * place - phases / (2 * np.pi)) != np.rint(p * found - phases / (2 * np.pi))).any(0)


@pytest.mark.parametrize(
    "periods", [SOFAST, (0.9, 7.0), (0.5,), (63.9, 0.9, 15.9, 3.9), (9.0, 10.0, 11.3), (17.0, 23.0, 28.5)], ids=str
)
def test_places_are_normal_with_their_error_bars(periods):
    place, phases, errors = measured(periods, 0.02)
    found = unwrap(phases, errors, periods)
    pull = (found.fraction - place) / found.standard_error
    assert abs(pull.mean()) < Z / np.sqrt(PIXELS) and abs(pull.var() - 1) < Z * np.sqrt(2 / PIXELS)
    expected = 0.02 / (2 * np.pi * np.sqrt(np.sum(np.square(periods))))  # weights of all series together
    np.testing.assert_allclose(found.standard_error, expected, rtol=1e-12)
    assert found.wrong.max() < 1e-3
    # chi-square of one degree of freedom less than series
    freedom = len(periods) - 1
    np.testing.assert_array_equal(found.freedom, freedom)
    assert abs(found.misfit.mean() - freedom) < Z * np.sqrt(2 * max(freedom, 1e-30) / PIXELS) + 1e-12


@pytest.mark.parametrize(
    ("periods", "sigma"),
    [
        ((0.9, 3.9, 15.9), 0.3),
        ((0.9, 15.9), 0.08),
        ((0.8, 4.3, 20.0), (0.2, 0.6, 0.6)),
        ((9.0, 10.0, 11.0), 0.3),
        ((4.0, 5.5), 0.2),
    ],
    ids=str,
)
def test_orders_are_wrong_as_often_as_predicted(periods, sigma):
    place, phases, errors = measured(periods, sigma)
    found = unwrap(phases, errors, periods)
    wrong = orders_differ(place, found.fraction, phases, periods)
    predicted = found.wrong.mean()
    assert 0.003 < predicted < 0.5  # the test has something to count
    # the search allows places MARGIN beyond the screen's ends, where none are here: 4 % of the predicted failures
    limit = Z * np.sqrt(np.sum(found.wrong * (1 - found.wrong))) / PIXELS
    assert abs(wrong.mean() - predicted) < limit + 0.04 * predicted
    # and pixel by pixel: those said to be doubtful are those that are wrong
    doubtful = found.wrong > 0.2
    assert wrong[doubtful].mean() == pytest.approx(found.wrong[doubtful].mean(), rel=0.1)
    assert wrong[~doubtful].mean() < 0.2


def test_all_orders_beat_one_order_after_the_other():
    """Maximum likelihood fails less often than rounding from series to series."""
    periods, sigma = (0.9, 4.9, 5.9), (0.3, 0.3, 0.3)
    place, phases, errors = measured(periods, sigma)
    found = unwrap(phases, errors, periods)
    by_rounding = 0.5 + (lambda t: t - np.rint(t))(phases[0] / (2 * np.pi) - 0.45) / 0.9
    for p, phase in zip(periods[1:], phases[1:], strict=True):
        by_rounding = (phase / (2 * np.pi) + np.rint(p * by_rounding - phase / (2 * np.pi))) / p
    failed = [np.mean(orders_differ(place, s, phases, periods)) for s in (found.fraction, by_rounding)]
    assert failed[0] < 0.9 * failed[1]


def test_a_prior_gives_the_order_of_a_single_series():
    place, phases, errors = measured((20.0,), 0.05)
    without = unwrap(phases, errors, (20.0,))
    assert without.wrong.mean() > 0.9  # 20 or 21 places fit equally well
    prior = Prior(place + np.random.default_rng(2).normal(size=PIXELS) * 0.005, np.full(PIXELS, 0.005))
    found = unwrap(phases, errors, (20.0,), prior)
    right = ~orders_differ(place, found.fraction, phases, (20.0,))
    assert right.mean() > 0.999
    pull = ((found.fraction - place) / found.standard_error)[right]
    assert abs(pull.var() - 1) < Z * np.sqrt(2 / PIXELS) + 1e-3


def test_series_without_a_phase_are_left_out():
    place, phases, errors = measured(SOFAST, 0.02, 1000)
    for j in range(4):
        gap = phases.copy()
        gap[j] = np.nan
        # without 0.9 too: 3.9, 15.9 and 63.9 have no common fringe on the screen
        np.testing.assert_allclose(unwrap(gap, errors, SOFAST).fraction, place, atol=2e-3)
    errors[3] = np.inf
    np.testing.assert_allclose(unwrap(phases, errors, SOFAST).fraction, place, atol=3e-3)
    nothing = unwrap(np.full_like(phases, np.nan), errors, SOFAST)
    assert np.isnan(nothing.fraction).all() and (nothing.wrong == 1).all()


def test_the_ends_of_the_screen_do_not_change_places():
    for place in (0.0, 1.0, -0.02, 1.02):
        phases = np.angle(np.exp(2j * np.pi * np.array(SOFAST)[:, None] * np.full(10, place)))
        found = unwrap(phases, np.full_like(phases, 0.01), SOFAST)
        np.testing.assert_allclose(found.fraction, place, atol=1e-12)


def test_what_noise_does_not_explain_is_found():
    _, phases, errors = measured(SOFAST, np.hypot(0.02, 0.05), 20_000)
    assert phase_floor(phases, np.full_like(errors, 0.02), SOFAST) == pytest.approx(0.05, rel=0.05)
    assert phase_floor(phases, errors, SOFAST) < 0.01
    assert phase_floor(phases[:1], errors[:1], SOFAST[:1]) == 0.0


def test_an_error_of_the_prior_is_not_taken_for_one_of_the_phases():
    """Phases as good as stated, a prior off by four of its errors in all pixels."""
    periods = (8.0, 16.0, 64.0)
    place, phases, errors = measured(periods, 0.02, 20_000)
    prior = Prior(place + 0.04, np.full(len(place), 0.01))
    assert phase_floor(phases, errors, periods, prior) < 0.005


def test_known_orders_give_the_weighted_mean_of_all_series():
    place, phases, errors = measured(SOFAST, 0.02, 1000)
    phases[3, :100] = np.nan
    near = place + 0.3 / 63.9
    near[0] = np.nan
    found = refined(phases, errors, SOFAST, near)
    expected = unwrap(phases, errors, SOFAST)
    assert np.isnan(found.fraction[0]) and np.isnan(found.standard_error[0])
    for name in ("fraction", "standard_error", "misfit", "freedom"):
        np.testing.assert_allclose(getattr(found, name)[1:], getattr(expected, name)[1:], rtol=1e-7, atol=1e-9)
