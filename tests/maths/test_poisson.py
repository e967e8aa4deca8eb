"""Poisson numbers by inversion against SciPy's own quantiles and the distribution itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.maths.counter_random import uniform
from irtscots_cl.maths.poisson import SMALL_MEAN, poisson_quantile

MEANS = [1e-9, 1e-3, 0.3, 1.0, 5.0, 15.999, 16.0, 16.5, 20.0, 47.3, 300.0, 1e4, 1e6]


@pytest.mark.parametrize("mean", MEANS)
def test_every_quantile_is_scipys(mean):
    """Two independent ways to the same integer; the tails to 1e-15 on the left and 1e-12 on the right."""
    tails = np.logspace(-15, -1, 200)
    u = np.concatenate([uniform(1, 1, (0, 0), 20_000), tails, 1 - tails[tails > 1e-12]])
    np.testing.assert_array_equal(poisson_quantile(u, np.full(u.shape, mean)), stats.poisson.ppf(u, mean))


@pytest.mark.parametrize("mean", [0.05, 0.7, 3.0, 12.0, SMALL_MEAN, 30.0])
def test_counts_have_the_poisson_distribution(mean):
    """Pooled chi-square over all counts that are expected five times or more."""
    number = 200_000
    counts = poisson_quantile(uniform(7, 2, (1, 0), number), np.full(number, mean)).astype(int)
    values = np.arange(counts.max() + 1)
    expected = number * stats.poisson.pmf(values, mean)
    often = np.flatnonzero(expected >= 5)
    first, last = often[0], often[-1]
    edges = slice(first, last + 1)
    observed = np.bincount(np.clip(counts, first, last) - first, minlength=last - first + 1)
    wanted = expected[edges].copy()
    wanted[0] += number * stats.poisson.cdf(first - 1, mean)
    wanted[-1] += number * stats.poisson.sf(last, mean)
    assert stats.chisquare(observed, wanted).pvalue > 1e-4  # chance of a failure by luck; the seed is fixed


def test_large_means_keep_mean_variance_and_skewness():
    """Where others draw a normal number instead: the skewness 1 / sqrt(mean) is there, too."""
    number, mean = 2_000_000, 2000.0
    counts = poisson_quantile(uniform(3, 1, (0, 0), number), np.full(number, mean))
    assert abs(counts.mean() - mean) < 4 * (mean / number) ** 0.5  # 4 sigma
    assert abs(counts.var() / mean - 1) < 4 * (2 / number) ** 0.5  # 4 sigma
    assert abs(stats.skew(counts) - mean**-0.5) < 4 * (6 / number) ** 0.5  # 4 sigma: 0.007 of 0.0224


def test_more_light_never_gives_fewer_electrons():
    means = np.sort(np.concatenate([np.linspace(0, 60, 601), [SMALL_MEAN - 1e-9, SMALL_MEAN]]))
    for u in uniform(2, 2, (0, 0), 100):
        assert (np.diff(poisson_quantile(np.full(means.shape, u), means)) >= 0).all()


def test_each_sample_depends_on_its_own_number_and_mean_alone():
    u, means = uniform(4, 1, (0, 0), 1000), np.linspace(0, 100, 1000)
    whole = poisson_quantile(u, means)
    parts = [poisson_quantile(u[k : k + 1], means[k : k + 1])[0] for k in range(0, 1000, 37)]
    np.testing.assert_array_equal(whole[::37], parts)


def test_no_light_gives_no_electrons_and_very_much_light_is_taken():
    u = np.array([1e-16, 0.5, 1 - 1e-16])
    np.testing.assert_array_equal(poisson_quantile(u, np.zeros(3)), np.zeros(3))
    huge = poisson_quantile(u, np.full(3, 1e20))
    np.testing.assert_allclose(huge, 1e20, rtol=1e-8)  # ten times the relative noise of 1e-10, and more
