"""All trials, against the linear prediction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from small_budget import SOURCES, small_trials

from irtscots_cl.budget.linear import linear_budget
from irtscots_cl.budget.monte_carlo import monte_carlo
from irtscots_cl.budget.sensitivity import DRAWS, sensitivities

LINEAR = {name: given for name, given in SOURCES.items() if name != "screen.tilt_x_rad"}  # its cosine matters soon


@pytest.fixture(scope="module")
def trials():
    return small_trials(trials=400, sources=LINEAR, pixels=31)


@pytest.fixture(scope="module")
def linear(trials):
    found = {one.source.name: one for one in sensitivities(trials.design, trials.sources, DRAWS)}
    return linear_budget(trials.design, found, trials.budget.sources)


@pytest.fixture(scope="module")
def spread(trials):
    return monte_carlo(trials)


def test_the_covariance_of_the_trials_is_the_predicted_one(trials, linear, spread):
    """Within 4.4 sigma: one false alarm in 800 for 120 numbers. Sobol points vary less than random ones do."""
    found, told = spread.zernike_covariance_nm2, linear.zernike_covariance_nm2
    variance = np.diag(told)
    sigma = np.sqrt((told**2 + np.outer(variance, variance)) / trials.budget.trials)
    noise = np.sqrt(np.outer(variance, variance) * 2 / DRAWS)  # what the draws of the process leave, at most
    assert np.all(np.abs(found - told) < 4.4 * np.hypot(sigma, noise))


def test_the_trials_rms_is_the_root_of_the_sum_of_squares(linear, spread):
    assert np.sqrt(np.mean(spread.rms_nm**2, axis=0)) == pytest.approx(linear.total_nm, rel=0.12)
    inside = linear.deviation_mm > 0
    assert np.mean(spread.deviation_mm[inside] / linear.deviation_mm[inside]) == pytest.approx(1, rel=0.1)


def test_sobol_indices_are_those_of_scipy(trials, linear):
    """Of the linear test's mean square, by Saltelli's estimator of scipy."""
    names = [source.name for source in trials.parameters]
    found = {one.source.name: one for one in sensitivities(trials.design, trials.parameters)}
    without = trials.design.response.without
    maps = np.stack([without(found[name].height_mm, "piston_tilt") for name in names]) * 1e6
    given = {name: trials.budget.sources[name] for name in names}
    only = linear_budget(trials.design, {name: found[name] for name in names}, given)
    shapes = {"normal": lambda s: stats.norm(scale=s), "uniform": lambda s: stats.uniform(-s, 2 * s),
              "triangular": lambda s: stats.triang(0.5, loc=-s, scale=2 * s)}  # fmt: skip
    indices = stats.sobol_indices(
        func=lambda x: np.mean((x.T @ maps) ** 2, axis=-1)[None],
        n=2**11,
        dists=[shapes[given[name].kind](given[name].size) for name in names],
        rng=np.random.default_rng(1),
    )
    for k, name in enumerate(names):
        assert only.first[name] == pytest.approx(indices.first_order[k], abs=0.05)
        assert only.total[name] == pytest.approx(indices.total_order[k], abs=0.05)


def test_shares_are_whole(linear):
    assert set(linear.first) == set(LINEAR)
    assert sum(linear.first.values()) < 1 < sum(linear.total.values())  # sources mix in a mean square


def test_the_same_trials_again_have_the_same_bits():
    first, second = (monte_carlo(small_trials(trials=20)) for _ in range(2))
    assert np.array_equal(first.rms_nm, second.rms_nm) and np.array_equal(first.mean_mm, second.mean_mm)
