"""Phases unwrapped over images: islands, holes, missing values."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.measurement.spatial_unwrapping import unwrap_image

ROWS, COLUMNS = 60, 80
TAU = 2 * np.pi
SURE = 0.05 * TAU


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
    found = unwrap_image(wrapped(true), mask, true + 0.8, SURE)
    np.testing.assert_allclose(found.phase_rad[mask], true[mask], atol=1e-9)
    assert np.isnan(found.phase_rad[~mask]).all()
    assert [island.pixels for island in found.islands] == [int((found.number == k).sum()) for k in (1, 2)]
    assert all(island.gap_turns == pytest.approx(0.8 / TAU) and island.wrong < 1e-12 for island in found.islands)
    assert [(island.row, island.column) for island in found.islands] == [(5, 5), (10, 45)]
    np.testing.assert_array_equal(found.wrong[~mask], 1)


def test_a_prediction_off_by_a_period_is_followed_never_an_arbitrary_one():
    true, mask = smooth(), two_islands()
    predicted = np.where(np.arange(COLUMNS) < 40, true, true + 2 * np.pi)
    found = unwrap_image(wrapped(true), mask, predicted, SURE)
    np.testing.assert_allclose(found.phase_rad[mask], predicted[mask], atol=1e-9)


def test_a_prediction_between_two_orders_leaves_them_in_doubt():
    """At 0.45 of a period, with an error of 0.1: the other order is less likely by exp((0.55^2 - 0.45^2) / 0.02)."""
    true, mask = smooth(), two_islands()
    found = unwrap_image(wrapped(true), mask, true + 0.45 * TAU, 0.1 * TAU)
    odds = np.exp(-(0.55**2 - 0.45**2) / 0.02)
    assert [island.wrong for island in found.islands] == pytest.approx([odds / (1 + odds)] * 2)
    half = unwrap_image(wrapped(true), mask, true + 0.4999 * TAU, 0.1 * TAU)
    assert [island.wrong for island in half.islands] == pytest.approx([0.5] * 2, abs=0.01)


def test_orders_are_wrong_as_often_as_predicted():
    """4000 islands of one pixel, a prediction with an error of 0.3 periods: limits of 5 standard errors, 1e-6."""
    random, error = np.random.default_rng(5), 0.3
    mask = np.zeros((2, 8000), bool)
    mask[0, ::2] = True
    true = random.uniform(-30, 30, mask.shape)
    found = unwrap_image(wrapped(true), mask, true + random.normal(size=mask.shape) * error * TAU, error * TAU)
    wrong = np.abs(found.phase_rad - true)[mask] > 1
    told = found.wrong[mask]
    assert len(found.islands) == 4000 and 0.05 < told.mean() < 0.2
    assert abs(wrong.sum() - told.sum()) < 5 * np.sqrt((told * (1 - told)).sum())
    sure = told < 0.02
    assert sure.sum() > 500 and wrong[sure].mean() < 0.03


def test_a_prediction_of_another_shape_is_believed_less():
    """Where the surface departs from the design by half a period over an island, a gap is less sure than stated."""
    true, mask = smooth(), two_islands()
    bent = true + 0.3 * TAU + 0.3 * TAU * np.sin(np.mgrid[:ROWS, :COLUMNS][1] / 4)
    same, other = (unwrap_image(wrapped(true), mask, p, 0.02 * TAU) for p in (true + 0.3 * TAU, bent))
    assert max(island.wrong for island in same.islands) < 1e-12
    assert min(island.wrong for island in other.islands) > 0.01
    np.testing.assert_allclose(other.phase_rad[mask], true[mask], atol=1e-9)


def test_pixels_beside_a_jump_are_left_out():
    """Around two points the phase turns by 2 pi, as beside an edge, or where pixels are coarse: no orders fit."""
    true, mask = smooth(), two_islands()
    row, column = np.mgrid[:ROWS, :COLUMNS]
    for sign, place in ((1, 50.5), (-1, 62.5)):
        true += sign * np.arctan2(row - 30.5, column - place)
    found = unwrap_image(wrapped(true), mask, true, SURE)
    known = np.isfinite(found.phase_rad)
    assert 0.95 < known[mask].mean() < 1 and (found.wrong[mask & ~known] == 1).all()
    with np.errstate(invalid="ignore"):
        for axis in (0, 1):
            assert not (np.abs(np.diff(found.phase_rad, axis=axis)) > np.pi).any()


def test_pixels_without_a_phase_and_thin_islands():
    true, mask = smooth(), two_islands()
    phase = wrapped(true)
    phase[40, 10:20] = np.nan
    mask[0, 3:30] = True  # one row
    mask[58, 70] = True  # one pixel
    found = unwrap_image(phase, mask, true, SURE)
    known = mask & np.isfinite(phase)
    np.testing.assert_allclose(found.phase_rad[known], true[known], atol=1e-9)
    assert np.isnan(found.phase_rad[40, 10:20]).all() and len(found.islands) == 4


def test_it_repeats_to_the_bit():
    true, mask = smooth() + np.random.default_rng(1).normal(size=(ROWS, COLUMNS)), two_islands()
    first, second = (unwrap_image(wrapped(true), mask, true, SURE).phase_rad for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_an_island_without_a_prediction_has_no_phase():
    true, mask = smooth(), two_islands()
    predicted = np.where(np.arange(COLUMNS) < 40, true, np.nan)
    found = unwrap_image(wrapped(true), mask, predicted, SURE)
    assert [island.wrong for island in found.islands] == [pytest.approx(0, abs=1e-12), 1.0]
    left = np.arange(COLUMNS) < 40
    np.testing.assert_allclose(found.phase_rad[mask & left], true[mask & left], atol=1e-9)
    assert np.isnan(found.phase_rad[mask & ~left]).all() and (found.wrong[mask & ~left] == 1).all()
