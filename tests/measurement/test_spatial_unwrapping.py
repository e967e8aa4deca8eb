"""Phases unwrapped over images: islands, holes, missing values."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.measurement.spatial_unwrapping import unwrap_image

ROWS, COLUMNS = 60, 80


def smooth():
    row, column = np.mgrid[:ROWS, :COLUMNS]
    return 0.4 * column - 0.25 * row + 0.004 * (row - 30) ** 2 + 50.0


def wrapped(phase):
    return np.angle(np.exp(1j * phase))


def two_islands():
    mask = np.zeros((ROWS, COLUMNS), bool)
    mask[5:55, 5:35] = mask[10:50, 45:75] = True
    mask[20:30, 15:25] = False  # a hole
    return mask


def test_each_island_gets_the_order_that_the_design_predicts():
    true, mask = smooth(), two_islands()
    found = unwrap_image(wrapped(true), mask, true + 0.8)
    np.testing.assert_allclose(found.phase_rad[mask], true[mask], atol=1e-9)
    assert np.isnan(found.phase_rad[~mask]).all()
    assert [island.pixels for island in found.islands] == [int((found.number == k).sum()) for k in (1, 2)]
    assert all(island.gap_turns == pytest.approx(0.8 / (2 * np.pi)) for island in found.islands)


def test_a_prediction_off_by_a_period_is_followed_never_an_arbitrary_one():
    true, mask = smooth(), two_islands()
    predicted = np.where(np.arange(COLUMNS) < 40, true, true + 2 * np.pi)
    found = unwrap_image(wrapped(true), mask, predicted)
    np.testing.assert_allclose(found.phase_rad[mask], predicted[mask], atol=1e-9)
    doubtful = unwrap_image(wrapped(true), mask, true + np.pi * 0.9)
    assert all(island.gap_turns == pytest.approx(0.45) for island in doubtful.islands)


def test_pixels_without_a_phase_and_thin_islands():
    true, mask = smooth(), two_islands()
    phase = wrapped(true)
    phase[40, 10:20] = np.nan
    mask[0, 3:30] = True  # one row
    mask[58, 70] = True  # one pixel
    found = unwrap_image(phase, mask, true)
    known = mask & np.isfinite(phase)
    np.testing.assert_allclose(found.phase_rad[known], true[known], atol=1e-9)
    assert np.isnan(found.phase_rad[40, 10:20]).all() and len(found.islands) == 4


def test_it_repeats_to_the_bit():
    true, mask = smooth() + np.random.default_rng(1).normal(size=(ROWS, COLUMNS)), two_islands()
    first, second = (unwrap_image(wrapped(true), mask, true).phase_rad for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_an_island_without_a_prediction_is_refused():
    true, mask = smooth(), two_islands()
    predicted = np.where(np.arange(COLUMNS) < 40, true, np.nan)
    with pytest.raises(ValueError, match="island 2 of the mask, at row 10, column 45: no phase is predicted there"):
        unwrap_image(wrapped(true), mask, predicted)
