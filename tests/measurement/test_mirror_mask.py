"""Masks of known shapes, from bright and dark signals."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.measurement.mirror_mask import largest_region, mirror_mask

ROWS, COLUMNS = 80, 100


def disk(hole=0.0):
    row, column = np.mgrid[:ROWS, :COLUMNS]
    radius = np.hypot(row - 40, column - 45)
    return (radius <= 30) & (radius >= hole)


def signal_of(mask, dark=2.0, bright=100.0, noise=3.0, seed=1):
    random = np.random.default_rng(seed)
    column = np.arange(COLUMNS) / COLUMNS
    return np.where(mask, bright * (1 - 0.4 * column), dark) + noise * random.normal(size=mask.shape)


@pytest.mark.parametrize("hole", [0.0, 8.0])
@pytest.mark.parametrize("dark", [0.0, 25.0])
def test_a_mirror_is_found_with_its_hole(hole, dark):
    mask = disk(hole)
    np.testing.assert_array_equal(mirror_mask(signal_of(mask, dark)), mask)


def test_smaller_bright_places_are_left_out():
    mask = disk()
    other = np.zeros_like(mask)
    other[5:10, 85:95] = True
    np.testing.assert_array_equal(mirror_mask(signal_of(mask | other)), mask)


def test_a_few_extreme_values_change_nothing():
    mask, signal = disk(), signal_of(disk())
    signal[0, :5] = 1e6
    np.testing.assert_array_equal(mirror_mask(signal) & mask, mask)


def test_pixels_without_a_signal_are_out():
    signal = signal_of(disk())
    signal[40, 45] = np.nan
    found = mirror_mask(signal)
    assert not found[40, 45] and found.sum() == disk().sum() - 1


def test_an_image_that_is_bright_everywhere_is_taken_whole():
    signal = signal_of(np.ones((ROWS, COLUMNS), bool))
    assert mirror_mask(signal).all()
    assert mirror_mask(np.full((ROWS, COLUMNS), 5.0)).all()


def test_images_without_fringes_are_refused():
    for signal in (np.zeros((ROWS, COLUMNS)), np.full((ROWS, COLUMNS), np.nan)):
        with pytest.raises(ValueError, match="no pixel sees fringes"):
            mirror_mask(signal)
    with pytest.raises(ValueError, match="the largest bright region has 1 pixels; must have 16 or more"):
        largest_region(np.eye(50, dtype=bool))
