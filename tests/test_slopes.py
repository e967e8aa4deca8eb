"""Triangulated slopes against the law of reflection, the paper's equation and their signs."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from irtscots_cl.slopes import half_vector_slopes

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
