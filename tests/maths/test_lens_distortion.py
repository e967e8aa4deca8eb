"""A lens's distortion: numbers worked out as fractions from OpenCV's formula, its derivatives, and the y axis turned."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.maths.lens_distortion import COEFFICIENTS, distort, distortion_matrix, flipped, full, towards

ALL = (-0.31, 0.12, 0.0013, -0.0021, 0.04, 0.02, -0.05, 0.013)
SOME = [(), (-0.2, 0.05, 0.001, -0.002), (0.1, -0.03, 0.0, 0.0, 0.02), ALL]


@pytest.mark.parametrize(
    ("point", "coefficients", "expected"),
    [
        # r^2 = 5/16: 1 + 1/32 - 5/256 = 259/256; 2 p1 x y = -1/400, p2 (r^2 + 2 x^2) = 13/800
        ((0.5, -0.25), (0.1, -0.2, 0.01, 0.02), (0.5 * 259 / 256 - 1 / 400 + 13 / 800,
                                                 -0.25 * 259 / 256 + 0.01 * (5 / 16 + 1 / 8) - 0.005)),
        # and k3 r^6 = 0.3 * 125 / 4096
        ((0.5, -0.25), (0.1, -0.2, 0.01, 0.02, 0.3), (0.5 * (259 / 256 + 37.5 / 4096) + 0.01375,
                                                      -0.25 * (259 / 256 + 37.5 / 4096) - 0.000625)),
        # r^2 = 1/4: (1 + 1/40 - 1/80 + 3/640) / (1 + 1/80 - 1/160 + 1/320) = (651/640) / (323/320) = 651/646
        ((-0.4, 0.3), (0.1, -0.2, 0.01, 0.02, 0.3, 0.05, -0.1, 0.2), (-0.4 * 651 / 646 - 0.0024 + 0.0114,
                                                                      0.3 * 651 / 646 + 0.0043 - 0.0048)),
    ],
)  # fmt: skip
def test_points_move_as_opencv_s_formula_says(point, coefficients, expected):
    np.testing.assert_allclose(distort(*point, full(coefficients)), expected, rtol=1e-14)


def test_the_order_of_the_coefficients_is_opencv_s():
    assert COEFFICIENTS == ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    assert full((1.0, 2.0, 3.0, 4.0)) == (1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("coefficients", SOME)
def test_the_matrix_is_that_of_the_differences(coefficients):
    x, y = np.random.default_rng(1).uniform(-0.7, 0.7, (2, 200))
    step, c = 1e-6, full(coefficients)
    xx, xy, yy = distortion_matrix(x, y, c)
    right, left, up, down = (distort(x + a, y + b, c) for a, b in ((step, 0), (-step, 0), (0, step), (0, -step)))
    for found, expected in ((xx, right[0] - left[0]), (xy, up[0] - down[0]), (xy, right[1] - left[1]),
                            (yy, up[1] - down[1])):  # fmt: skip
        np.testing.assert_allclose(found, expected / (2 * step), atol=1e-9)  # rounding 1e-16 / 1e-6


def test_without_coefficients_nothing_moves():
    x, y = np.random.default_rng(2).uniform(-1, 1, (2, 50))
    np.testing.assert_array_equal(distort(x, y, full(())), (x, y))


@pytest.mark.parametrize("coefficients", SOME)
def test_an_image_with_its_y_axis_turned_has_the_flipped_coefficients(coefficients):
    x, y = np.random.default_rng(3).uniform(-0.7, 0.7, (2, 200))
    down = distort(x, -y, full(coefficients))
    up = distort(x, y, flipped(coefficients))
    np.testing.assert_allclose(up, (down[0], -down[1]), atol=1e-16)


@pytest.mark.parametrize("coefficients", SOME)
def test_newton_s_steps_lead_back(coefficients):
    x, y = np.random.default_rng(4).uniform(-0.5, 0.5, (2, 200))
    goal = distort(x, y, full(coefficients))
    at_x, at_y = goal
    for _ in range(8):
        at_x, at_y, determinant = towards(at_x, at_y, *goal, full(coefficients))
    np.testing.assert_allclose((at_x, at_y), (x, y), atol=1e-15)
    assert np.all(determinant > 0)


@pytest.mark.parametrize("coefficients", [c for c in SOME if c])
def test_points_move_as_opencv_moves_them(coefficients):
    cv2 = pytest.importorskip("cv2")
    x, y = np.random.default_rng(5).uniform(-0.6, 0.6, (2, 100))
    points = np.stack([x, y, np.ones(100)], -1)
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))
    np.testing.assert_allclose(np.stack(distort(x, y, full(coefficients)), -1), expected[:, 0], atol=1e-14)
