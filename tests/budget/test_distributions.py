"""Values of the sources by quantiles of their distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.budget.distributions import quantile
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
