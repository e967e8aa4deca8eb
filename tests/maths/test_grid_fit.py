"""Zernike terms of all pixels of a grid, against the fit by the terms' values at the pixels."""

import numpy as np
import pytest

from irtscots_cl.maths.map_figures import zernike_figures
from irtscots_cl.maths.zernike.fit import separable_terms
from irtscots_cl.maths.zernike.grid_fit import grid_fit
from irtscots_cl.maths.zernike.indices import fringe_to_nm, nm_to_noll

NOLLS = sorted(nm_to_noll(*fringe_to_nm(j)) for j in range(1, 38))


def a_map(rows=60, columns=47, seed=3):
    """Places, rough heights of 1 mm with a tilt of 10, and the pixels of an off-centre annulus with a notch."""
    u, v = np.linspace(-1.3, 1, columns), np.linspace(-1, 1.2, rows)
    x, y = np.meshgrid(u, v)
    used = (x * x + y * y <= 1) & (np.hypot(x - 0.1, y) > 0.3) & ~((x > 0.5) & (np.abs(y) < 0.1))
    heights = np.random.default_rng(seed).standard_normal(x.shape) + 10 * x
    return u, v, x, y, used, heights


def test_it_is_the_fit_by_the_values_at_the_pixels():
    u, v, x, y, used, heights = a_map()
    found = grid_fit(u, v, used, NOLLS)
    wanted = separable_terms(x[used], y[used], NOLLS)
    assert found.nolls == wanted.nolls and found.dropped == wanted.dropped
    expected = wanted.coefficients(heights[used])
    np.testing.assert_allclose(found.coefficients(heights), expected, atol=1e-13)  # of heights of 10
    np.testing.assert_allclose(found.values(expected)[used], wanted.basis @ expected, atol=1e-12)


def test_invalid_heights_beside_the_used_ones_do_not_matter():
    u, v, _, _, used, heights = a_map()
    fit = grid_fit(u, v, used, NOLLS)
    expected = fit.coefficients(heights)
    assert (fit.coefficients(np.where(used, heights, np.nan)) == expected).all()


def test_terms_that_few_pixels_cannot_separate_are_left_out_as_by_the_other_fit():
    u, v, x, y, used, _ = a_map()
    for mask in (used & (np.abs(y) < 0.06), used & (np.cumsum(used).reshape(used.shape) <= 5), used & (x > 0.6)):
        found, wanted = grid_fit(u, v, mask, NOLLS), separable_terms(x[mask], y[mask], NOLLS)
        assert found.nolls == wanted.nolls and found.dropped == wanted.dropped and found.dropped
    with pytest.raises(ValueError, match="at least one term and one pixel"):
        grid_fit(u, v, used & False, NOLLS)


def test_a_small_defect_of_a_large_map_counts():
    """28 pixels of 100 nm in a map of 600 x 600: rms 0.88 nm, which the terms hardly take up."""
    x, y = np.meshgrid(np.arange(600.0), np.arange(600.0))
    heights = np.where(np.hypot(x - 301, y - 200) < 3, 1e-4, 0.0)
    found = zernike_figures(heights, x, y, "piston_tilt")
    assert found.fitted_pixels == 360_000
    assert found.rest_rms_mm == pytest.approx(heights.std(), rel=0.01)
    assert found.pvr_mm >= 3 * found.rest_rms_mm
