"""A colour mosaic in grey images is named; grey cameras' images are not."""

import numpy as np
import pytest

from irtscots_cl.measurement.colour_mosaic import check_mosaic

ROW, COLUMN = np.mgrid[:41, :50]
MIRROR = ((ROW - 20) ** 2 + (COLUMN - 25) ** 2 < 300) * (1000.0 + 8 * COLUMN)


def noisy(light):
    return light + np.random.default_rng(1).normal(0, 30, light.shape)


def test_a_grey_camera_s_image_passes():
    """Also with a brightness that changes, a dead pixel and missing ones."""
    light = noisy(MIRROR)
    light[20, 20:30] = 0
    light[10, 20] = np.nan
    found = check_mosaic(light)
    assert found.level == "ok" and found.value < 0.03


@pytest.mark.parametrize("gains", [(0.5, 1, 1, 0.7), (1, 0.8, 0.8, 1), (1, 1.2, 1, 1.2)])
def test_a_mosaic_is_named_with_the_light_of_its_places(gains):
    mosaic = np.tile(np.reshape(gains, (2, 2)), (21, 25))[:41]
    found = check_mosaic(noisy(MIRROR * mosaic))
    assert found.level == "warning"
    shares = np.array(gains) / np.mean(gains)
    told = found.text.split("have ")[1].split(" of its light")[0]
    assert [float(share) for share in told.split(", ")] == pytest.approx(shares, abs=0.02)
    assert found.value == pytest.approx(np.ptp(shares), abs=0.02)


def test_darkness_is_no_mosaic():
    assert check_mosaic(np.zeros((8, 8))).level == check_mosaic(np.full((8, 8), np.nan)).level == "ok"
