"""The ceiling of a camera's values: found where samples are cut off, and nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from noisy_images import images_of, small, sparse_stack

from irtscots_cl.measurement.saturation import find_ceiling

SCENE = small(25)
IMAGES = images_of(SCENE)


def scaled(peak: float, noise: float = 0.002, seed: int = 1):
    """The images with noise, their peak at `peak`."""
    return IMAGES.noisy(noise, seed).each(lambda a: a / IMAGES.peak * peak)


@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.002, 0.02])
def test_images_that_are_not_cut_off_have_no_ceiling(noise):
    for seed in range(3):
        assert find_ceiling(scaled(1.0, noise, seed).stack()) == math.inf


def test_neither_have_a_simulation_s():
    assert find_ceiling(sparse_stack(SCENE)) == math.inf
    assert find_ceiling(sparse_stack(SCENE.nominal())) == math.inf  # many pixels alike


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize("peak", [12, 20, 40, 150, 200, 3000, 4000, 50_000])
def test_whole_numbers_below_every_camera_s_ceiling_have_none(peak, noise):
    """Coarse steps put many samples on the highest value."""
    assert find_ceiling(scaled(peak, noise).each(np.rint).stack()) == math.inf


@pytest.mark.parametrize("ceiling", [1.0, 0.37, 12_345.6])
def test_a_ceiling_of_any_value_is_found(ceiling):
    cut = scaled(1.5 * ceiling).each(lambda a: np.minimum(a, ceiling))
    assert find_ceiling(cut.stack()) == ceiling


@pytest.mark.parametrize(("bits", "shift"), [(8, 0), (8, 8), (10, 0), (12, 0), (12, 4), (14, 2), (16, 0)])
@pytest.mark.parametrize("over", [2.0, 1.02])
def test_the_highest_code_of_a_camera_is_a_ceiling(bits, shift, over):
    top = 2**bits - 1
    cut = scaled(over * top).each(lambda a: np.clip(np.rint(a), 0, top) * 2**shift)
    assert find_ceiling(cut.stack()) == top * 2**shift


def test_a_single_sample_at_the_highest_code_is_enough():
    images = scaled(3000).each(np.rint)
    x = images.x.copy()
    x[10, 12, 12] = 4095
    assert find_ceiling(replace(images, x=x).stack()) == 4095


def test_one_scan_alone_may_be_cut_off():
    images = scaled(1.0)
    assert find_ceiling(replace(images, y=np.minimum(images.y, 0.6), x=0.5 * images.x).stack()) == 0.6


def test_missing_samples_and_a_few_equal_ones_do_not_matter():
    random = np.random.default_rng(2)
    images = scaled(1.5).each(lambda a: np.where(random.random(a.shape) < 0.1, np.nan, np.minimum(a, 1)))
    assert find_ceiling(images.stack()) == 1.0
    few = scaled(1.0)
    x = few.x.copy()
    x[10, 12, 8:14] = 1.2  # six equal samples at the top, as of a symmetric scene
    assert find_ceiling(replace(few, x=x).stack()) == math.inf


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_images_without_light_have_no_ceiling(value):
    assert find_ceiling(IMAGES.each(lambda a: np.full(a.shape, value)).stack()) == math.inf


def test_exposures_are_looked_at_one_by_one():
    """The mean of cut-off and whole samples is below the ceiling."""
    images = IMAGES.each(lambda a: a / IMAGES.peak * 0.9).noisy(0.1, 3, exposures=4)
    assert find_ceiling(images.each(lambda a: np.minimum(a, 1.0)).stack()) == 1.0
