"""Frames of the devices and the quadric form of conics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from irtscots_cl.maths.frame import Frame, aim_of
from irtscots_cl.maths.quadric import Quadric

coordinate = st.floats(-5000, 5000)
ROUNDING = 1e-12


@settings(max_examples=200, deadline=None)
@given(
    st.tuples(coordinate, coordinate, st.floats(100, 5000)),
    st.tuples(coordinate, coordinate, st.floats(-50, 50)),
)
def test_axes_are_orthonormal_right_handed_and_look_back(position, look_at):
    frame = Frame.looking(position, look_at)
    np.testing.assert_allclose(frame.axes @ frame.axes.T, np.eye(3), rtol=0, atol=ROUNDING)
    assert np.linalg.det(frame.axes) == pytest.approx(1, abs=ROUNDING)  # right-handed: x x y = z
    back = np.subtract(position, look_at)
    assert frame.axes[2] @ back == pytest.approx(np.linalg.norm(back), rel=ROUNDING)
    assert abs(frame.axes[0, 1]) < ROUNDING  # x is level: no component along world Y
    assert frame.axes[0, 0] > 0  # above the mirror, x runs with the world's
    assert frame.axes[1, 1] > 0  # and so does y


def test_a_device_straight_above_has_the_worlds_axes():
    frame = Frame.looking((10.0, -20.0, 4000.0), (10.0, -20.0, 0.0))
    np.testing.assert_array_equal(frame.axes, np.eye(3))
    np.testing.assert_array_equal(frame.to_world(3.0, 5.0), [13.0, -15.0, 4000.0])


def test_a_device_to_the_right_turns_about_y():
    angle = np.radians(3.0)
    frame = Frame.looking((4000 * np.sin(angle), 0.0, 4000 * np.cos(angle)), (0.0, 0.0, 0.0))
    expected = [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    np.testing.assert_allclose(frame.axes, expected, rtol=0, atol=1e-15)  # rounding


@settings(max_examples=200, deadline=None)
@given(
    st.tuples(coordinate, coordinate, st.floats(100, 5000)),
    st.tuples(coordinate, coordinate, st.floats(-50, 50)),
    st.floats(-3.1, 3.1),
    st.floats(1, 1e4),
)
def test_aim_of_undoes_looking(position, look_at, turn, distance):
    frame = Frame.looking(position, look_at, turn)
    place, other_look_at, other_turn = aim_of(frame, distance)
    again = Frame.looking(place, other_look_at, other_turn)
    np.testing.assert_array_equal(again.position_mm, frame.position_mm)
    np.testing.assert_allclose(again.axes, frame.axes, rtol=0, atol=1e-8)  # rounding of a place at 5 m, seen from 1 mm
    assert np.linalg.norm(place - other_look_at) == pytest.approx(distance)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("off", [0.0, 1e-11, -3e-10])  # mm: at most 1e-12 rad
def test_a_device_that_looks_along_y_has_the_worlds_x(sign, off):
    frame = Frame.looking((40.0 + off, sign * 700.0, 30.0 - off), (40.0, 0.0, 30.0))
    np.testing.assert_array_equal(frame.axes, [[1, 0, 0], [0, 0, -sign], [0, sign, 0]])
    assert np.linalg.det(frame.axes) == 1  # right-handed


def test_a_device_that_nearly_looks_along_y_has_the_x_axis_of_the_rule():
    """No rounding disturbs it: from 1e-9 mm beside the line of 700 mm the axis is that from 100 mm beside it."""
    for angle in np.radians([10.0, 130.0, 250.0, 359.0]):
        far, near = (Frame.looking((size * np.sin(angle), 700.0, size * np.cos(angle)), (0.0, 0.0, 0.0))
                     for size in (100.0, 1e-9))  # fmt: skip
        np.testing.assert_allclose(near.axes[0], far.axes[0], rtol=0, atol=1e-15)  # rounding
        np.testing.assert_allclose(near.axes @ near.axes.T, np.eye(3), rtol=0, atol=1e-15)


def test_a_device_that_turns_from_z_to_y_keeps_its_x_axis():
    for angle in np.radians([0.0, 60.0, 89.9999, 90.0]):
        frame = Frame.looking((5.0, 900 * np.sin(angle), 900 * np.cos(angle)), (5.0, 0.0, 0.0))
        np.testing.assert_array_equal(frame.axes[0], [1.0, 0.0, 0.0])


def test_rays_that_do_not_come_onto_a_devices_front_do_not_arrive():
    frame = Frame.looking((0.0, 0.0, 1000.0), (0.0, 0.0, 0.0))  # its front looks down
    starts = np.array([[3.0, 4.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 1500.0], [3.0, 4.0, 1500.0]])
    directions = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    u, v = frame.arrive(starts, directions, in_front=True)
    np.testing.assert_array_equal(u, [3.0, np.nan, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(v, [4.0, np.nan, np.nan, np.nan, np.nan])


def test_to_world_and_arrive_undo_each_other():
    frame = Frame.looking((300.0, -150.0, 2000.0), (5.0, 40.0, -3.0))
    generator = np.random.default_rng(2)
    u, v = generator.uniform(-50, 50, (2, 4, 5))
    starts = generator.uniform(-300, 300, (4, 5, 3)) * [1, 1, 0.01]
    world = frame.to_world(u, v)
    assert world.shape == (4, 5, 3)
    directions = (world - starts) * generator.uniform(0.1, 3, (4, 5, 1))  # of any length
    np.testing.assert_allclose(
        frame.arrive(starts, directions), (u, v), rtol=0, atol=1e-10
    )  # mm: rounding at 2 m, amplified


CONICS = [
    (1000.0, 0.0, 0.0),
    (1000.0, -1.0, 0.0),
    (1500.0, -2.5, 0.0),
    (2000.0, 0.7, 0.0),
    (1000.0, -1.0, 200.0),
    (4166.747, -0.7154, 1087.74),
    (1500.0, 0.4, 300.0),
    (1000.0, 0.0, 250.0),
    (-1000.0, 0.0, 0.0),
    (-1500.0, -2.5, 0.0),
    (-2000.0, 0.7, 0.0),
    (-1000.0, -1.0, 200.0),
    (-1500.0, -4.0, 300.0),
]


@pytest.mark.parametrize(("radius", "conic", "off_axis"), CONICS)
def test_quadric_is_the_parent_conic(radius, conic, off_axis):
    """Points of the quadric, carried into the parent's frame, obey X^2 + Y^2 + (1 + k) Z^2 = 2 R Z."""
    quadric = Quadric.conic(radius, conic, off_axis)
    height = off_axis**2 / radius / (1 + np.sqrt(1 - (1 + conic) * (off_axis / radius) ** 2))
    slope = off_axis / (radius - (1 + conic) * height)  # of the parent at the segment's centre, dZ/dX
    x_axis, z_axis = np.array([1.0, 0.0, slope]), np.array([-slope, 0.0, 1.0])
    x_axis, z_axis = x_axis / np.hypot(1, slope), z_axis / np.hypot(1, slope)
    generator = np.random.default_rng(1)
    x, y = generator.uniform(-80, 80, (2, 100))
    z = quadric.meet(x, y, 0.0, 0.0)
    parent = (
        np.array([off_axis, 0, height])
        + np.multiply.outer(x, x_axis)
        + np.multiply.outer(y, [0.0, 1.0, 0.0])
        + np.multiply.outer(z, z_axis)
    )
    across = np.hypot(parent[:, 0], parent[:, 1])
    sag = across**2 / radius / (1 + np.sqrt(1 - (1 + conic) * (across / radius) ** 2))
    np.testing.assert_allclose(parent[:, 2], sag, rtol=0, atol=1e-11)  # mm: rounding at 1 m


@pytest.mark.parametrize(("radius", "conic", "off_axis"), CONICS)
def test_quadric_gradient_is_the_difference_quotient(radius, conic, off_axis):
    quadric = Quadric.conic(radius, conic, off_axis)
    x, y = np.random.default_rng(4).uniform(-80, 80, (2, 50))
    slope_x, slope_y = quadric.gradient(x, y, quadric.meet(x, y, 0.0, 0.0))
    h = 0.05  # mm: rounding 1e-14 / h, third derivatives of 6e-7 times h^2 / 6
    by_x = (quadric.meet(x + h, y, 0.0, 0.0) - quadric.meet(x - h, y, 0.0, 0.0)) / (2 * h)
    by_y = (quadric.meet(x, y + h, 0.0, 0.0) - quadric.meet(x, y - h, 0.0, 0.0)) / (2 * h)
    np.testing.assert_allclose([slope_x, slope_y], [by_x, by_y], rtol=0, atol=5e-10)  # of the step, above
    assert quadric.gradient(0.0, 0.0, 0.0) == (0.0, 0.0)  # +Z is the normal at the origin


def test_off_axis_radii_are_the_closed_ones():
    """Sagittal R sqrt(1 - k s^2), tangential R (1 - k s^2)^(3/2), s = distance / R."""
    radius, conic, distance = 4166.747, -0.7154, 1087.74
    quadric = Quadric.conic(radius, conic, distance)
    stretch = 1 - conic * (distance / radius) ** 2
    assert 1 / quadric.q_yy == pytest.approx(radius * stretch**0.5, rel=1e-14)  # rounding
    assert 1 / quadric.q_xx == pytest.approx(radius * stretch**1.5, rel=1e-14)  # rounding
    assert 1 / quadric.q_yy == pytest.approx(4267.1, abs=0.1)  # last printed digit
    assert 1 / quadric.q_xx == pytest.approx(4475.2, abs=0.1)  # last printed digit


def test_a_line_beside_the_surface_misses_it():
    sphere = Quadric.conic(100.0)
    assert np.isnan(sphere.meet(100.001, 0.0, 0.0, 0.0)) and np.isfinite(sphere.meet(99.999, 0.0, 0.0, 0.0))
    assert sphere.meet(60.0, 0.0, 0.0, 0.0) == pytest.approx(20.0, abs=1e-13)  # 3-4-5, the root next to the vertex
