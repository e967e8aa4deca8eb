"""The statistics helpers against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from significance import chi_square_p, poisson_ratio_p, pooled, sidak_p, sidak_z


def test_sidak_limit_of_one_test_is_the_plain_two_sided_one():
    assert sidak_z(1, 0.05) == pytest.approx(1.959964, abs=1e-6)  # the table's 1.96


@pytest.mark.parametrize("tests", [2, 1000, 10**6])
def test_sidak_limit_holds_for_all_tests_at_once(tests):
    for chance in (1e-6, 0.1):
        all_pass = (1 - 2 * stats.norm.sf(sidak_z(tests, chance))) ** tests
        assert 1 - all_pass == pytest.approx(chance, rel=1e-4)  # float64 in the power: 1e6 x 1e-16 of 1e-6
        assert -np.expm1(tests * np.log1p(-sidak_p(tests, chance))) == pytest.approx(chance, rel=1e-9)  # rounding


def test_poisson_ratio_is_twice_the_smaller_binomial_tail():
    first, second, share = np.array([3, 9, 50]), np.array([7, 0, 40]), np.array([0.5, 0.5, 0.4])
    tails = [
        [stats.binomtest(int(a), int(a + b), s, alternative=side).pvalue for side in ("less", "greater")]
        for a, b, s in zip(first, second, share, strict=True)
    ]
    result = poisson_ratio_p(first, second, share)
    np.testing.assert_allclose(result, np.minimum(2 * np.min(tails, axis=1), 1), rtol=1e-12)  # rounding
    assert result[1] == pytest.approx(2 * 0.5**9, rel=1e-12)  # closed form of nine heads in nine; rounding
    assert poisson_ratio_p(np.array([0]), np.array([0]), np.array([0.3]))[0] == 1.0


def test_poisson_ratio_keeps_its_chance_at_low_counts():
    generator = np.random.default_rng(5)
    mean_first, mean_second = 0.7, 2.1
    first, second = generator.poisson(mean_first, 200_000), generator.poisson(mean_second, 200_000)
    p = poisson_ratio_p(first, second, np.full(200_000, mean_first / (mean_first + mean_second)))
    for chance in (0.1, 0.01, 1e-3):
        false_alarms, limit = (p <= chance).sum(), chance * 200_000
        assert false_alarms <= limit + 5 * np.sqrt(limit)  # 5 sigma: 3e-7
    # and it can alarm: the means stand otherwise
    assert poisson_ratio_p(np.array([40]), np.array([10]), np.array([0.5]))[0] < 1e-4


def test_pooling_keeps_all_counts_and_reaches_the_least():
    observed, expected = np.arange(7.0), np.array([4.0, 6.0, 12.0, 1.0, 1.0, 9.0, 3.0])
    joined, wanted = pooled(observed, expected)
    np.testing.assert_array_equal(wanted, [10, 12, 14])
    np.testing.assert_array_equal(joined, [1, 2, 3 + 4 + 5 + 6])
    with pytest.raises(ValueError, match="less than 10"):
        pooled(np.ones(2), np.ones(2))


def test_chi_square_agrees_with_scipy_and_is_uniform():
    observed, expected = np.array([18.0, 25.0, 17.0]), np.array([20.0, 20.0, 20.0])
    reference = stats.chisquare(observed, expected).pvalue
    assert chi_square_p(observed, expected, fitted=1) == pytest.approx(reference, rel=1e-12)  # rounding
    generator = np.random.default_rng(6)
    p = [chi_square_p(generator.poisson(40.0, 60), np.full(60, 40.0)) for _ in range(2000)]
    assert stats.kstest(p, "uniform").pvalue > 1e-4  # seeded; a wrong number of freedoms gives below 1e-30
