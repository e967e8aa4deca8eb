"""Triangulated slopes against the law of reflection, the paper's equation and their signs; means over pixels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from irtscots_cl.measurement.slopes import deconvolve_pixel, half_vector_slopes

ROUNDING = 1e-12  # rad; directions of unit length carry 1e-16
WITHIN = st.floats(-0.3, 0.3)
RADIUS = 4166.747


def normal_of(slope_x, slope_y):
    normal = np.array([-slope_x, -slope_y, 1.0])
    return normal / np.linalg.norm(normal)


@given(
    slope=st.tuples(WITHIN, WITHIN),
    to_camera=st.tuples(WITHIN, WITHIN),
    point=st.tuples(WITHIN, WITHIN, WITHIN),
    camera_away=st.floats(1.0, 1e4),
    screen_away=st.floats(1.0, 1e4),
)
def test_the_slopes_of_a_reflecting_facet_are_recovered(slope, to_camera, point, camera_away, screen_away):
    mirror = 1000.0 * np.array(point)
    to_camera = np.array([*to_camera, 1.0])
    camera = mirror + camera_away * to_camera
    normal = normal_of(*slope)
    reflected = -to_camera + 2.0 * (to_camera @ normal) * normal  # of a ray that comes from the camera
    screen = mirror + screen_away * reflected
    found = half_vector_slopes(mirror, screen, camera)
    scale = np.abs(mirror).max() / min(camera_away, screen_away)  # places far from 0 round the directions
    np.testing.assert_allclose(found, slope, rtol=0, atol=ROUNDING * (1 + 10 * scale))


def test_it_is_the_paper_s_equation_3():
    random = np.random.default_rng(6)
    (x_m, y_m), w = random.uniform(-500, 500, (2, 50)), random.uniform(0, 30, 50)
    x_screen, y_screen, z_screen = random.uniform(200, 220, 50), random.uniform(-2, 2, 50), 4161.0
    x_camera, y_camera, z_camera = -218.0, 3.0, 4160.0
    d_screen = np.sqrt((x_m - x_screen) ** 2 + (y_m - y_screen) ** 2 + (z_screen - w) ** 2)
    d_camera = np.sqrt((x_m - x_camera) ** 2 + (y_m - y_camera) ** 2 + (z_camera - w) ** 2)
    below = (z_screen - w) / d_screen + (z_camera - w) / d_camera
    w_x = ((x_m - x_screen) / d_screen + (x_m - x_camera) / d_camera) / below
    w_y = ((y_m - y_screen) / d_screen + (y_m - y_camera) / d_camera) / below
    screen = np.stack([x_screen, y_screen, np.full(50, z_screen)], -1)
    found = half_vector_slopes(np.stack([x_m, y_m, w], -1), screen, np.array([x_camera, y_camera, z_camera]))
    np.testing.assert_allclose(found, [w_x, w_y], rtol=0, atol=ROUNDING)


def test_a_mirror_that_rises_to_plus_x_sends_the_light_to_minus_x():
    """slope_x > 0 leans the normal to -x; the reflected ray turns by twice the angle, over R: -2 R slope."""
    mirror, camera, centre = np.zeros(3), np.array([0.0, 0.0, RADIUS]), np.array([0.0, 0.0, RADIUS])
    slope = 1e-6
    for axis in (0, 1):
        moved = centre.copy()
        moved[axis] -= 2 * RADIUS * slope
        found = half_vector_slopes(mirror, moved, camera)
        assert abs(found[axis] - slope) < 1e-15  # the cube of the angle and rounding
        assert found[1 - axis] == 0.0


def test_a_millimetre_on_the_paper_s_screen_is_120_microradians():
    angle = np.radians(3.0)
    screen, camera = (RADIUS * np.array([side * np.sin(angle), 0.0, np.cos(angle)]) for side in (1, -1))
    step = np.array([0.0, 1.0, 0.0])
    slope = half_vector_slopes(np.zeros(3), screen + step, camera)[1]
    # over cos 3 degrees: the normal's z is that much shorter than the rays
    np.testing.assert_allclose(slope, -1 / (2 * RADIUS * np.cos(angle)), rtol=1e-6)  # the square of the angle
    np.testing.assert_allclose(slope, -1 / 8333.5, rtol=2e-3)  # without the cosine


def test_shapes_and_one_camera_for_all():
    mirror = np.random.default_rng(7).uniform(-1, 1, (4, 3, 3))
    screen = np.stack([mirror[..., 0], mirror[..., 1], mirror[..., 2] + 100], -1)
    for slope in half_vector_slopes(mirror, screen, np.array([0.0, 0.0, 100.0])):
        assert slope.shape == (4, 3)


# --- means over pixels --------------------------------------------------------------------------------------

NAN = np.nan


def grid(size, pitch=1.0):
    """Centres x, y [size, size] of square pixels around the origin."""
    at = (np.arange(size) - (size - 1) / 2) * pitch
    return np.meshgrid(at, at)


def polynomial(coefficients, x, y):
    """sum of c x^i y^k of coefficients {(i, k): c}, and its mean over the unit square around each point."""
    value, mean = np.zeros_like(x), np.zeros_like(x)
    for (i, k), c in coefficients.items():
        value += c * x**i * y**k
        of_x, of_y = (((v + 0.5) ** (n + 1) - (v - 0.5) ** (n + 1)) / (n + 1) for v, n in ((x, i), (y, k)))
        mean += c * of_x * of_y
    return value, mean


def random_polynomial(order, seed):
    random = np.random.default_rng(seed)
    return {(i, k): random.normal() for i in range(order + 1) for k in range(order + 1 - i)}


@pytest.mark.parametrize("seed", range(3))
def test_a_cubic_s_values_follow_exactly_from_its_means(seed):
    value, mean = polynomial(random_polynomial(3, seed), *grid(9))
    found = deconvolve_pixel(mean, np.ones((9, 9), bool))
    assert np.abs(value - mean).max() > 0.1  # there is something to take away
    inner = np.s_[1:-1, 1:-1]
    np.testing.assert_allclose(found[inner], value[inner], rtol=0, atol=1e-12)  # rounding of numbers near 100
    assert np.abs((found - value)[0, 1:-1]).max() > 1e-3  # at the edge the neighbour's second difference differs


@pytest.mark.parametrize("seed", range(3))
def test_a_quadratic_s_values_follow_exactly_up_to_the_edge(seed):
    """On a disk with a hole: every row and column of a pixel is three pixels long somewhere next to it."""
    x, y = grid(21)
    mask = (np.hypot(x, y) < 9.2) & (np.hypot(x, y) > 2.9)
    value, mean = polynomial(random_polynomial(2, seed), x, y)
    found = deconvolve_pixel(mean, mask)
    long_enough = [_run_lengths(m) >= 3 for m in (mask, mask.T)]
    known = mask & long_enough[0] & long_enough[1].T
    assert known.sum() > 0.95 * mask.sum()
    np.testing.assert_allclose(found[known], value[known], rtol=0, atol=1e-12)  # rounding of numbers near 100
    np.testing.assert_array_equal(np.isnan(found), ~mask)


def _run_lengths(mask):
    """Of each pixel, how many neighbours in its row are joined to it, itself included."""
    lengths = np.zeros(mask.shape, int)
    for row, line in enumerate(mask):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], line, [0]])))
        for first, last in edges.reshape(-1, 2):
            lengths[row, first:last] = last - first
    return lengths


def test_its_error_falls_with_the_fourth_power_of_the_pitch():
    """Of sin(x + y / 2) over one square, whose means over pixels are known."""
    largest = []
    for size in (10, 20, 40):
        pitch = 4.0 / size
        x, y = grid(size, pitch)
        value = np.sin(x + y / 2)
        mean = value * np.sinc(pitch / 2 / np.pi) * np.sinc(pitch / 4 / np.pi)
        found = deconvolve_pixel(mean, np.ones_like(value, bool))
        largest.append(np.abs(found - value)[1:-1, 1:-1].max())
        assert largest[-1] < np.abs(mean - value).max() / 10  # smaller than what it takes away
    order = np.log2(np.divide(largest[:-1], largest[1:]))
    np.testing.assert_allclose(order, 4, atol=0.1)  # the sixth power; the largest value moves with the grid


def test_a_pixel_at_the_edge_borrows_its_neighbour_s_second_difference():
    line = np.array([[1.0, 5.0, 2.0, 9.0, 4.0]])  # second differences -7, 10, -12
    found = deconvolve_pixel(line, np.ones_like(line, bool))
    np.testing.assert_allclose(found, line - np.array([[-7, -7, 10, -12, -12]]) / 24, rtol=1e-15)  # rounding
    np.testing.assert_array_equal(deconvolve_pixel(line.T, np.ones_like(line.T, bool)), found.T)


def test_pixels_outside_the_mask_have_no_say():
    line = np.array([[1.0, 5.0, 2.0, 100.0, 7.0, 9.0, 4.0, NAN, 6.0]])
    mask = np.array([[True, True, True, False, True, True, True, False, True]])
    expected = line - np.array([[-7, -7, -7, 0, -7, -7, -7, 0, 0]]) / 24
    expected[~mask] = NAN
    np.testing.assert_allclose(deconvolve_pixel(line, mask), expected, rtol=1e-15)  # rounding


def test_lone_pixels_and_pairs_keep_their_mean():
    slope = np.random.default_rng(1).normal(size=(6, 7))
    mask = np.zeros((6, 7), bool)
    mask[1, 1] = mask[3, 3] = mask[3, 4] = mask[5, 0] = mask[4, 1] = True  # a pair along a row, two at a corner
    found = deconvolve_pixel(slope, mask)
    np.testing.assert_array_equal(found, np.where(mask, slope, NAN))


def test_a_row_alone_is_corrected_along_itself():
    slope = np.random.default_rng(2).normal(size=(3, 8))
    mask = np.zeros((3, 8), bool)
    mask[1] = True
    found = deconvolve_pixel(slope, mask)
    np.testing.assert_array_equal(found[1], deconvolve_pixel(slope[1:2], mask[1:2])[0])
    assert (found[1] != slope[1]).all() and np.isnan(found[[0, 2]]).all()


def test_leading_axes_are_maps_of_their_own():
    random = np.random.default_rng(3)
    slopes, mask = random.normal(size=(2, 4, 9, 8)), random.random((9, 8)) < 0.8
    before = slopes.copy()
    found = deconvolve_pixel(slopes, mask)
    assert found.shape == slopes.shape
    for k in np.ndindex(2, 4):
        np.testing.assert_array_equal(found[k], deconvolve_pixel(slopes[k], mask))
    np.testing.assert_array_equal(slopes, before)  # what was given is left alone
    assert deconvolve_pixel(slopes[:0], mask).shape == (0, 4, 9, 8)  # no replicates


def test_a_constant_and_a_tilted_plane_have_nothing_to_take_away():
    x, y = grid(7)
    plane = 0.3 + 2.0 * x - y
    np.testing.assert_allclose(deconvolve_pixel(plane, np.ones_like(x, bool)), plane, atol=1e-14)  # rounding
