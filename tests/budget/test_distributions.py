"""Values of the sources by quantiles of their distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.budget.distributions import excess, quantile
from irtscots_cl.scene.error_sources import Distribution


@pytest.mark.parametrize(
    "given, same",
    [
        ({"normal": 0.3}, stats.norm(scale=0.3)),
        ({"uniform": 0.3}, stats.uniform(-0.3, 0.6)),
        ({"triangular": 0.3}, stats.triang(0.5, loc=-0.3, scale=0.6)),
    ],
)
def test_quantiles_and_standard_deviations_are_those_of_scipy(given, same):
    distribution, share = Distribution(**given), np.linspace(0.001, 0.999, 37)
    assert quantile(distribution, share) == pytest.approx(same.ppf(share), abs=1e-14)
    assert distribution.sigma == pytest.approx(same.std())
    assert excess(distribution) == pytest.approx(2 + same.stats("k"))


@pytest.mark.parametrize("kind", ["normal", "uniform", "triangular"])
@pytest.mark.parametrize("set_ups", [2, 3, 9, 24])
def test_several_set_ups_have_the_mean_of_as_many_values(kind, set_ups):
    """Against means of random values: quantiles to 4.4 sigma, and 8 of them."""
    distribution, count = Distribution(**{kind: 0.3}, set_ups=set_ups), 20000
    one = Distribution(**{kind: 0.3})
    means = quantile(one, np.random.default_rng(5).random((count, set_ups))).mean(1)
    share = np.array([0.01, 0.1, 0.3, 0.5, 0.6, 0.8, 0.95, 0.99])
    found = (means[:, None] < quantile(distribution, share)).mean(0)
    assert np.all(np.abs(found - share) < 4.4 * np.sqrt(share * (1 - share) / count))
    assert distribution.sigma == pytest.approx(one.sigma / np.sqrt(set_ups))
    even = (np.arange(2**14) + 0.5) / 2**14
    values = quantile(distribution, even)
    assert values.std() == pytest.approx(distribution.sigma, rel=2e-3)
    assert np.array_equal(values, np.sort(values)) and values == pytest.approx(-values[::-1], abs=1e-9)
    assert np.var(values**2) / distribution.sigma**4 == pytest.approx(excess(distribution), rel=0.02)


def test_the_mean_of_three_uniform_values_in_closed_form():
    share = np.array([1e-9, 0.001, 1 / 6])  # the sum s of three within (0, 1), below 1: s^3 / 6
    assert quantile(Distribution(uniform=1.0, set_ups=3), share) == pytest.approx(
        2 / 3 * np.cbrt(6 * share) - 1, abs=1e-9
    )
