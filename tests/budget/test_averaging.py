"""What averaging leaves."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.budget.averaging import left_by_exposures, left_by_turns
from irtscots_cl.maths.zernike.indices import nm_to_noll
from irtscots_cl.maths.zernike.polynomials import zernike


@pytest.mark.parametrize("turns", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("m", range(-12, 13))
def test_only_multiples_of_the_turns_stay(turns, m):
    """By the mean of the term itself over turned places, for every order to 12."""
    noll = nm_to_noll(12 + (m % 2), m)
    x, y = 0.8 * np.cos(np.arange(40)), 0.8 * np.sin(np.arange(40)) * np.linspace(0.1, 1, 40)
    mean = 0.0
    for k in range(turns):
        c, s = np.cos(2 * np.pi * k / turns), np.sin(2 * np.pi * k / turns)
        mean = mean + zernike(noll, c * x - s * y, s * x + c * y) / turns
    (left,) = left_by_turns([noll], turns)
    assert np.abs(mean - left * zernike(noll, x, y)).max() < 1e-12
    assert left == (m % turns == 0)


def test_exposures_and_refusals():
    assert left_by_exposures(4) == 0.5
    for call in (lambda: left_by_exposures(0), lambda: left_by_turns([4], 0)):
        with pytest.raises(ValueError, match="must be at least 1"):
            call()
