"""The screen between its grid and the world: flat, bent, behind glass; there and back, and against exact geometry."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.optics.screen_model import ScreenModel
from irtscots_cl.scene.instrument import Screen
from irtscots_cl.scene.screen_shape import CoverGlass, ScreenShape

HALF = (60.0, 45.0)
PLACES = np.random.default_rng(1).uniform(-1, 1, (2, 400)) * np.array(HALF)[:, None]


def grid_shape(points_of, columns=13, rows=11) -> ScreenShape:
    fx, fy = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows)))
    return shape_of(fx, fy, points_of)


def shape_of(fx, fy, points_of) -> ScreenShape:
    u, v = (2 * fx - 1) * HALF[0], (2 * fy - 1) * HALF[1]
    return ScreenShape(
        fractions=tuple(zip(fx.tolist(), fy.tolist(), strict=True)),
        points_mm=tuple(map(tuple, np.stack(points_of(u, v), -1).tolist())),
    )


def bowl(u, v):
    return u + 0.3 * np.sin(v / 40), 1.01 * v, 0.0012 * u**2 - 0.0007 * u * v + 0.5 * np.cos(v / 30)


def cloud() -> ScreenShape:
    k = np.arange(300)
    return shape_of((k * 0.754877666) % 1, (k * 0.569840296) % 1, bowl)


SHAPES = {
    "flat": lambda: None,
    "sag": lambda: ScreenShape(sag_mm=((2, 0, 4.0), (1, 1, -1.5), (0, 4, 0.8))),
    "grid": lambda: grid_shape(bowl),
    "cloud": cloud,
}


def model(shape=None, glass=None, **changes) -> ScreenModel:
    keys = {"position_mm": (50.0, -80.0, 900.0), "look_at_mm": (10.0, 5.0, 0.0), "clocking_deg": 7.0} | changes
    return ScreenModel.of(Screen(pixels=(240, 180), pitch_mm=0.5, shape=shape, cover_glass=glass, **keys))


def senders(count: int = 400) -> np.ndarray:
    """Points [count, 3] of a mirror."""
    x, y = np.random.default_rng(2).uniform(-200, 200, (2, count))
    return np.stack([x, y, (x**2 + y**2) / 2000], -1)


# --- there and back -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("glass", [None, CoverGlass(thickness_mm=3.0, index=1.52)])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_ray_to_where_a_place_is_seen_lights_that_place(shape, glass):
    of = model(SHAPES[shape](), glass)
    assert of.is_plain == (shape == "flat" and glass is None)
    start = senders()
    seen = of.seen_from(start, *PLACES)
    u, v = of.arrive(start, seen - start)
    np.testing.assert_allclose((u, v), PLACES, atol=1e-9)
    # and a single one
    u, v = of.arrive(start[0], (seen - start)[0])
    assert (u, v) == pytest.approx((PLACES[0, 0], PLACES[1, 0]), abs=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_tangents_are_those_of_the_world_points(shape):
    of, step = model(SHAPES[shape]()), 1e-4
    u, v = 0.9 * PLACES
    along_u, along_v = of.tangents(u, v)
    np.testing.assert_allclose(along_u, (of.to_world(u + step, v) - of.to_world(u - step, v)) / (2 * step), atol=1e-6)
    np.testing.assert_allclose(along_v, (of.to_world(u, v + step) - of.to_world(u, v - step)) / (2 * step), atol=1e-6)


def test_a_clocked_screen_turns_about_its_normal_from_x_towards_y():
    straight, turned = model(clocking_deg=0.0), model(clocking_deg=90.0)
    np.testing.assert_allclose(turned.to_world(5.0, 0.0), straight.to_world(0.0, 5.0), atol=1e-12)
    np.testing.assert_allclose(turned.to_world(0.0, 5.0), straight.to_world(-5.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(turned.frame.axes[2], straight.frame.axes[2], atol=1e-15)


def test_a_flat_shape_is_the_flat_screen():
    flat, start = model(), senders()
    towards = flat.to_world(*PLACES) - start
    for shape in (ScreenShape(sag_mm=((2, 0, 0.0),)), grid_shape(lambda u, v: (u, v))):
        np.testing.assert_allclose(model(shape).arrive(start, towards), PLACES, atol=1e-10)


def test_a_ray_that_misses_a_bent_screen_lights_nothing():
    of = model(ScreenShape(sag_mm=((2, 0, 30.0),)))  # a deep trough
    in_frame = of.frame.axes
    sideways = in_frame[1] + 1e-9 * in_frame[2]  # along v, past its open side
    u, v = of.arrive(of.frame.position_mm - 500.0 * in_frame[2], sideways)
    assert np.isnan(u) and np.isnan(v) or abs(v) > 1e6


# --- exact geometry -----------------------------------------------------------------------------------------


def test_a_cylinder_is_met_where_the_exact_line_meets_it():
    """Points on a cylinder of radius R along v, at its arc lengths: x = R sin(u / R), z = -R (1 - cos(u / R))."""
    radius = 500.0

    def cylinder(u, v):
        return radius * np.sin(u / radius), v, -radius * (1 - np.cos(u / radius))

    of = model(grid_shape(cylinder, 61, 3))
    start, (u, v) = senders(), PLACES
    frame = of.frame
    goal = frame.position_mm + np.stack(cylinder(u, v), -1) @ frame.axes
    aside = goal - start
    found = of.arrive(start, aside)
    # exact: the quadratic of the line and x^2 + (z + R)^2 = R^2 in the screen's frame, its hit nearer to the screen
    origin, along = (start - frame.position_mm) @ frame.axes.T, aside @ frame.axes.T
    a = along[:, 0] ** 2 + along[:, 2] ** 2
    b = origin[:, 0] * along[:, 0] + (origin[:, 2] + radius) * along[:, 2]
    c = origin[:, 0] ** 2 + (origin[:, 2] + radius) ** 2 - radius**2
    root = np.sqrt(b**2 - a * c)
    hits = [origin + t[:, None] * along for t in ((-b - root) / a, (-b + root) / a)]
    hit = np.where((hits[0][:, 2] > -radius)[:, None] & (np.abs(hits[0][:, 2]) < np.abs(hits[1][:, 2]))[:, None], *hits)
    exact = radius * np.arcsin(hit[:, 0] / radius), hit[:, 1]
    np.testing.assert_allclose(exact, (u, v), atol=1e-9)  # the test's own geometry
    np.testing.assert_allclose(found, exact, atol=5e-8)  # mm: splines through points 2 mm apart, radius 500


def test_a_polynomial_is_met_where_bisection_meets_it():
    shape = ScreenShape(sag_mm=((2, 0, 3.0), (0, 3, -1.0)))
    of, start = model(shape), senders(60)
    frame = of.frame
    aside = of.frame.to_world(*(0.7 * PLACES[:, :60])) - start
    origin, along = (start - frame.position_mm) @ frame.axes.T, aside @ frame.axes.T

    def above(t):
        x, y, z = (origin + t[:, None] * along).T
        return z - 3.0 * (x / HALF[0]) ** 2 + (y / HALF[1]) ** 3

    low, high = np.full(60, 0.9), np.full(60, 1.1)
    assert np.all(above(low) < 0) and np.all(above(high) > 0)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = np.where(above(middle) < 0, middle, low), np.where(above(middle) < 0, high, middle)
    hit = origin + low[:, None] * along
    np.testing.assert_allclose(of.arrive(start, aside), hit[:, :2].T, atol=1e-10)


@pytest.mark.parametrize("index", [1.0, 1.33, 1.52, 3.0])
@pytest.mark.parametrize("degrees", [0.0, 10.0, 45.0, 75.0])
def test_a_plate_shifts_a_ray_as_snell_says(index, degrees):
    """In the plane of incidence: entering at the glass's front, t before the pixels, refracted, to the pixels."""
    thickness = 2.5
    of = model(glass=CoverGlass(thickness_mm=thickness, index=index), clocking_deg=0.0)
    x_axis, y_axis, z_axis = of.frame.axes
    angle = np.radians(degrees)
    azimuth = np.array([0.6, -0.8])
    way = np.sin(angle) * (azimuth[0] * x_axis + azimuth[1] * y_axis) + np.cos(angle) * z_axis
    entry = of.frame.position_mm - thickness * z_axis + 4.0 * x_axis
    inside = np.arcsin(np.sin(angle) / index)
    expected = np.array([4.0, 0.0]) + azimuth * thickness * np.tan(inside)
    np.testing.assert_allclose(of.arrive(entry - 300.0 * way, way), expected, atol=1e-10)


def test_glass_of_index_one_is_none():
    start = senders()
    for shape in ("flat", "sag", "grid"):
        bare, glazed = model(SHAPES[shape]()), model(SHAPES[shape](), CoverGlass(thickness_mm=5.0, index=1.0))
        towards = bare.to_world(*PLACES) - start
        np.testing.assert_allclose(glazed.arrive(start, towards), bare.arrive(start, towards), atol=1e-11)


def test_glass_on_a_tilted_plane_is_that_of_the_tilted_plane():
    """A sag of one linear term is a plane: the shift is Snell's about its own normal, and not about the frame's z."""
    slope = 0.2
    of = model(ScreenShape(sag_mm=((1, 0, slope * HALF[0]),)), CoverGlass(thickness_mm=2.0, index=1.5))
    bare = model(ScreenShape(sag_mm=((1, 0, slope * HALF[0]),)))
    x_axis, y_axis, z_axis = of.frame.axes
    normal = (z_axis - slope * x_axis) / np.hypot(1, slope)
    tangent = (x_axis + slope * z_axis) / np.hypot(1, slope)
    for degrees in (-30.0, 0.0, 40.0):
        angle = np.radians(degrees)
        way = np.cos(angle) * normal + np.sin(angle) * tangent
        start = bare.to_world(3.0, -4.0) - 200.0 * way
        moved = 2.0 * (np.tan(np.arcsin(np.sin(angle) / 1.5)) - np.tan(angle))  # along the plane
        u, v = of.arrive(start, way)
        assert (u, v) == pytest.approx((3.0 + moved / np.hypot(1, slope), -4.0), abs=1e-9)
