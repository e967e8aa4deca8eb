"""Brightness maps and frame factors of a real screen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.screen_response import brightness_map, frame_factors, shown
from irtscots_cl.scene.screen_response import ScreenResponse

PIXELS = (40, 30)  # columns, rows
ROUNDING = 1e-12  # relative


def test_an_even_screen_is_1_everywhere():
    np.testing.assert_array_equal(brightness_map(ScreenResponse(), PIXELS), np.ones((30, 40)))


def test_the_polynomial_in_x_and_y_from_minus_1_to_1_over_the_screen():
    found = brightness_map(ScreenResponse(brightness_polynomial=(0.1, -0.2, -0.3, 0.05, 0.04)), PIXELS)
    x, y = (5 + 0.5) / 20 - 1, (27 + 0.5) / 15 - 1  # the centre of column 5, row 27
    expected = 1 + 0.1 * x - 0.2 * y - 0.3 * x * x + 0.05 * x * y + 0.04 * y * y
    assert found[27, 5] == pytest.approx(expected, rel=ROUNDING)
    assert found.shape == (30, 40)


def test_a_polynomial_that_falls_below_0_is_refused_with_the_place():
    with pytest.raises(ValueError, match="brightness_polynomial") as caught:
        brightness_map(ScreenResponse(brightness_polynomial=(1.2, 0, 0, 0, 0)), PIXELS)
    text = "[1.2, 0.0, 0.0, 0.0, 0.0]: is -0.17 at column 0, row 0; must be at least 0 everywhere on the screen"
    assert str(caught.value) == f"screen.response.brightness_polynomial = {text}"


def test_a_map_and_a_polynomial_multiply(tmp_path):
    path = tmp_path / "b.npy"
    given = np.random.default_rng(1).uniform(0.5, 1.0, (30, 40))
    np.save(path, given)
    found = brightness_map(ScreenResponse(brightness_map=str(path)), PIXELS)
    np.testing.assert_array_equal(found, given)
    both = brightness_map(ScreenResponse(brightness_map=str(path), brightness_polynomial=(0.1, 0, 0, 0, 0)), PIXELS)
    alone = brightness_map(ScreenResponse(brightness_polynomial=(0.1, 0, 0, 0, 0)), PIXELS)
    np.testing.assert_allclose(both, given * alone, rtol=ROUNDING)


def test_dead_pixels_and_lines_are_dark_and_nothing_else():
    found = brightness_map(ScreenResponse(dead_pixels=((3, 4), (39, 29)), dead_columns=(7,), dead_rows=(0, 2)), PIXELS)
    expected = np.ones((30, 40))
    expected[4, 3] = expected[29, 39] = 0
    expected[:, 7] = 0
    expected[[0, 2]] = 0
    np.testing.assert_array_equal(found, expected)


def test_shares_of_dead_pixels_and_lines():
    large = (1000, 800)
    pixels = brightness_map(ScreenResponse(dead_pixel_share=0.01), large) == 0
    assert abs(pixels.mean() - 0.01) < 4.5 * (0.01 * 0.99 / pixels.size) ** 0.5  # 4.5 sigma
    lines = brightness_map(ScreenResponse(dead_line_share=0.05), large) == 0
    columns, rows = lines.all(0), lines.all(1)
    np.testing.assert_array_equal(lines, columns[None, :] | rows[:, None])
    for dead in (columns, rows):
        assert abs(dead.mean() - 0.05) < 4.5 * (0.05 * 0.95 / dead.size) ** 0.5  # 4.5 sigma
    other = brightness_map(ScreenResponse(dead_pixel_share=0.01, seed=2), large) == 0
    assert (pixels & other).sum() < 200  # 80 by chance; the same pixels would be 8000


def test_drift_is_linear_over_a_scan_and_about_1_in_its_middle():
    response = ScreenResponse(drift=0.05)
    found = [frame_factors(response, "x", line, 21)[0] for line in range(21)]
    np.testing.assert_allclose(found, np.linspace(0.975, 1.025, 21), rtol=ROUNDING)
    assert frame_factors(response, "y", 0, 1) == [1.0]  # a scan of one line


def test_gamma_acts_on_grey_levels_alone():
    assert frame_factors(ScreenResponse(gamma=2.2), "x", 3, 9) == [1.0]
    assert frame_factors(ScreenResponse(grey_level=0.5, gamma=2.2), "x", 3, 9)[0] == pytest.approx(0.5**2.2)
    assert frame_factors(ScreenResponse(grey_level=0.5), "x", 3, 9) == [0.5]


def test_jitter_is_normal_and_independent_from_frame_to_frame():
    response = ScreenResponse(jitter=0.03, seed=4)
    found = np.array(
        [[[frame_factors(response, axis, line, 50, e, 20) for line in range(50)] for e in range(5)] for axis in "xy"]
    )
    number = found.size
    assert abs(found.mean() - 1) < 4.5 * 0.03 / number**0.5  # 4.5 sigma
    assert abs(found.std() / 0.03 - 1) < 4.5 / (2 * number) ** 0.5  # 4.5 sigma
    for axis in range(4):  # neighbouring scans, exposures, lines and frames
        one, two = np.moveaxis(found, axis, 0)[0].ravel(), np.moveaxis(found, axis, 0)[1].ravel()
        assert abs(np.corrcoef(one, two)[0, 1]) < 4.5 / one.size**0.5  # 4.5 sigma
    again = frame_factors(response, "y", 31, 50, 2, 20)
    np.testing.assert_array_equal(again, found[1, 2, 31])  # whatever was drawn before
    np.testing.assert_array_equal(frame_factors(response, "y", 31, 50, 2, 5), found[1, 2, 31, :5])


def test_a_screen_is_never_darker_than_dark():
    found = frame_factors(ScreenResponse(jitter=1.0), "x", 0, 2, 0, 1000)
    assert found.min() == 0.0 and (found == 0).mean() < 0.25  # 16 % of a normal distribution lie below -1 sigma


def test_a_camera_without_noise_sees_the_factors_in_its_light_curves():
    """Windows start at different lines; one reaches past the last line, where it is dark."""
    flux = np.array([[[1.0, 2.0, 3.0], [4.0, 5.0, 0.0]], [[2.0, 4.0, 6.0], [8.0, 10.0, 0.0]]])
    scan = Scan("y", np.arange(5) * 0.1, (1, 2), np.array([0, 1]), np.array([1, 3]), flux, np.ones(2), np.full(2, 9.0))
    response = ScreenResponse(grey_level=0.5, drift=0.2, jitter=0.1)
    factor = [frame_factors(response, "y", line, 5)[0] for line in range(5)]
    expected = flux * np.array([[factor[1], factor[2], factor[3]], [factor[3], factor[4], 1.0]])
    found = shown(ImageStack(dataclasses.replace(scan, axis="x"), scan), response).y
    np.testing.assert_allclose(found.flux_w, expected, rtol=ROUNDING)
    assert (found.unit, found.saturation_w) == ("W", np.inf)
    np.testing.assert_array_equal(found.hits, scan.hits)
