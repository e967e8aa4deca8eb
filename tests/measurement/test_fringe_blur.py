"""What the size of the pixels takes from fringes."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.measurement.fringe_blur import explain_modulation, pixel_modulation
from irtscots_cl.measurement.screen_coordinates import screen_coordinates

ROWS, COLUMNS, FINE = 40, 50, 8


def averaged(loss=0.0):
    """Images of pixels that average 8 x 8 places of a bent mapping; loss: share of the amplitude that veils take in
    the second series."""
    row, column = ((np.arange(n * FINE) + 0.5) / FINE - 0.5 for n in (ROWS, COLUMNS))
    place = 0.2 + 0.008 * row[:, None] + 1e-4 * row[:, None] ** 2 + 0.002 * column
    fringes = FringeSet.equal("x", (0.9, 30.0), 4)
    frames = fringes.values(place.ravel()).reshape(8, ROWS, FINE, COLUMNS, FINE).mean((2, 4))
    frames[4:] = 0.5 + (1 - loss) * (frames[4:] - 0.5)
    noise = 0.1 * np.random.default_rng(1).normal(size=frames.shape)
    return FringeStack((fringes,), 200 * frames + noise)


@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_what_the_pixels_size_takes_is_told_from_the_rest(loss):
    found = screen_coordinates(averaged(loss), mask=np.ones((ROWS, COLUMNS), bool)).x
    (fact,) = explain_modulation(found)
    assert fact.periods == 30.0 and fact.measured < 0.9 * (1 - loss)
    assert fact.left == pytest.approx(1 - loss, rel=0.01)
    assert fact.spread < 0.1 * fact.measured_spread  # the pixels' differences are explained too


def test_a_patch_of_a_whole_period_leaves_nothing():
    fraction = np.arange(20.0)[:, None] / 10 * np.ones(5)
    left = pixel_modulation(fraction, 10.0)
    assert np.isnan(left[0]).all() and np.isnan(left[:, 0]).all()
    np.testing.assert_allclose(left[1:-1, 1:-1], 0, atol=1e-12)
