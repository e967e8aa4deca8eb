"""A plane through values with outliers."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.calibration.robust_plane import robust_plane


def test_exact_values_give_the_exact_plane():
    x, y = np.random.default_rng(1).uniform(-600, 600, (2, 50))
    np.testing.assert_allclose(robust_plane(x, y, 3e-3 - 2e-6 * x + 5e-6 * y), [3e-3, -2e-6, 5e-6], rtol=1e-12)


def test_outliers_do_not_pull_it():
    """A tenth of the values is off by ten standard deviations to one side; the plane stays within its own error."""
    random = np.random.default_rng(2)
    x, y = random.uniform(-600, 600, (2, 4000))
    values = 1e-3 + 4e-6 * x + 1e-5 * random.standard_normal(4000)
    bad = values.copy()
    bad[::10] += 1e-4
    found = robust_plane(x, y, bad)
    level = 1e-5 / np.sqrt(4000)
    assert abs(found[0] - 1e-3) < 5 * level  # 5 sigma; least squares is off by 60
    assert abs(np.mean(bad - 4e-6 * x) - 1e-3) > 50 * level


def test_without_outliers_it_is_nearly_as_good_as_least_squares():
    """Scatter of the level over 400 fits: 95 % efficient (Holland and Welsch 1977), so 1.026 times that of the mean."""
    random = np.random.default_rng(3)
    x, y = random.uniform(-1, 1, (2, 100))
    terms = np.stack([np.ones(100), x, y], -1)
    noise = random.standard_normal((400, 100))
    robust = np.std([robust_plane(x, y, one)[0] for one in noise])
    least = np.std([np.linalg.lstsq(terms, one, rcond=None)[0][0] for one in noise])
    assert robust / least == pytest.approx(1.026, abs=0.08)  # the two are correlated: 4 sigma
