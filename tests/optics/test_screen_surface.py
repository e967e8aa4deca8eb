"""Where the pixels of a bent screen are: its sag written out, measured points met, and folds refused."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.optics.screen_surface import PolynomialSag, screen_surface
from irtscots_cl.scene.instrument import Screen
from irtscots_cl.scene.screen_shape import ScreenShape
from irtscots_cl.scene.validation import SceneError

PIXELS, PITCH, OFFSET = (40, 30), (0.5, 0.6), (1.5, -2.0)  # 20 x 18 mm
HALF = (10.0, 9.0)


def screen(shape: ScreenShape) -> Screen:
    return Screen(position_mm=(0.0, 0.0, 100.0), pixels=PIXELS, pitch_mm=PITCH, centre_offset_mm=OFFSET, shape=shape)


def places(count: int = 300, reach: float = 1.0, seed: int = 1):
    """Places (u, v) on the grid, in mm."""
    x, y = np.random.default_rng(seed).uniform(-reach, reach, (2, count))
    return x * HALF[0] + OFFSET[0], y * HALF[1] + OFFSET[1]


def bent(fx, fy):
    """A smooth screen [x, y, z] by fractions of the grid: unequal scales, a keystone, a bow."""
    fx, fy = np.asarray(fx), np.asarray(fy)
    x = 20.4 * (fx - 0.5) * (1 + 0.03 * (fy - 0.5)) + OFFSET[0] + 0.02 * np.sin(3 * fy)
    y = 17.8 * (fy - 0.5) + OFFSET[1] + 0.05 * (fx - 0.5) ** 2
    return np.stack([x, y, 0.4 * (fx - 0.4) ** 2 - 0.3 * fx * fy + 0.1 * np.cos(2 * fy)], -1)


def regular(columns: int, rows: int, low=0.0, high=1.0):
    fx, fy = np.meshgrid(np.linspace(low, high, columns), np.linspace(low, high, rows))
    return fx.ravel(), fy.ravel()


def scattered(count: int):
    """A low-discrepancy cloud, with the corners."""
    k = np.arange(1, count)
    return np.r_[(k * 0.754877666) % 1, 0, 0, 1, 1], np.r_[(k * 0.569840296) % 1, 0, 1, 0, 1]


def shape_of(fx, fy, points, **more) -> ScreenShape:
    return ScreenShape(
        fractions=tuple(zip(map(float, fx), map(float, fy), strict=True)),
        points_mm=tuple(tuple(map(float, p)) for p in points),
        **more,
    )


def at_places(surface, fx, fy):
    """Points of the surface at fractions of the grid."""
    return surface.points((2 * fx - 1) * HALF[0] + OFFSET[0], (2 * fy - 1) * HALF[1] + OFFSET[1])


# --- sag ----------------------------------------------------------------------------------------------------


def test_a_sag_is_the_sum_of_its_terms_about_the_grid_s_middle():
    surface = screen_surface(screen(ScreenShape(sag_mm=((2, 0, 0.3), (1, 3, -0.2), (0, 1, 0.05)))))
    u, v = places()
    s, t = (u - 1.5) / 10.0, (v + 2.0) / 9.0
    expected = np.stack([u, v, 0.3 * s**2 - 0.2 * s * t**3 + 0.05 * t], -1)
    np.testing.assert_allclose(surface.points(u, v), expected, atol=1e-15)
    assert surface.points(1.5, -2.0).shape == (3,)
    # on the grid's edge u = U the first term is its whole coefficient
    assert surface.points(11.5, -2.0)[2] == pytest.approx(0.3)


@pytest.mark.parametrize("order", [0, 1, 5, 10])
def test_every_power_has_its_own_derivatives(order):
    terms = tuple((i, order - i, 0.1 * (i + 1)) for i in range(order + 1))
    check_tangents(PolynomialSag(terms, HALF, OFFSET), reach=1.2)


def check_tangents(surface, reach=0.9, atol=2e-8):
    u, v = places(100, reach)
    along = surface.tangents(u, v)
    step = 1e-5
    for k, (a, b) in enumerate(((step, 0.0), (0.0, step))):
        differ = (surface.points(u + a, v + b) - surface.points(u - a, v - b)) / (2 * step)
        np.testing.assert_allclose(along[k], differ, atol=atol)  # rounding 1e-14 / 1e-5, third derivatives 1e-10


# --- measured points ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("grid", [(9, 7), (2, 2), (2, 9), (33, 3)])
@pytest.mark.parametrize("interpolation", ["smooth", "linear"])
def test_a_grid_of_points_is_met_exactly_in_any_order(grid, interpolation):
    fx, fy = regular(*grid)
    order = np.random.default_rng(2).permutation(len(fx))
    points = bent(fx, fy)
    surface = screen_surface(screen(shape_of(fx[order], fy[order], points[order], interpolation=interpolation)))
    np.testing.assert_allclose(at_places(surface, fx, fy), points, atol=1e-12)
    check_tangents(surface, atol=1e-6 if interpolation == "smooth" else 2.0)


def test_fractions_with_rounding_errors_are_still_a_grid():
    """Fractions as a calibration writes them, with errors of 1e-9: neighbours in a column must not change places."""
    fx, fy = regular(8, 6)
    noise = np.random.default_rng(3).normal(0, 1e-9, (2, len(fx)))
    points = bent(fx, fy)
    surface = screen_surface(screen(shape_of(fx + noise[0], fy + noise[1], points)))
    np.testing.assert_allclose(at_places(surface, fx, fy), points, atol=1e-7)


def test_between_the_points_of_a_grid_a_smooth_screen_is_near():
    fx, fy = regular(11, 9)
    surface = screen_surface(screen(shape_of(fx, fy, bent(fx, fy))))
    x, y = np.random.default_rng(4).uniform(0.02, 0.98, (2, 400))
    np.testing.assert_allclose(at_places(surface, x, y), bent(x, y), atol=2e-4)  # mm; sampled 2 mm apart
    linear = screen_surface(screen(shape_of(fx, fy, bent(fx, fy), interpolation="linear")))
    off = np.abs(at_places(linear, x, y) - bent(x, y)).max()
    assert 2e-4 < off < 5e-3  # chords: d^2 / 8 of the curvature


def test_flat_points_make_a_flat_screen():
    fx, fy = regular(5, 4)
    points = bent(fx, fy)[:, :2]
    surface = screen_surface(screen(shape_of(fx, fy, points)))
    found = at_places(surface, fx, fy)
    np.testing.assert_allclose(found[:, :2], points, atol=1e-12)
    assert np.all(found[:, 2] == 0.0)


@pytest.mark.parametrize("count", [40, 200])
def test_scattered_points_are_met_by_a_thin_plate(count):
    fx, fy = scattered(count)
    surface = screen_surface(screen(shape_of(fx, fy, bent(fx, fy))))
    at = at_places(surface, fx, fy)
    np.testing.assert_allclose(at, bent(fx, fy), atol=2e-3)  # a table of 33 x 33 nodes of the plate
    x, y = np.random.default_rng(5).uniform(0.05, 0.95, (2, 300))
    np.testing.assert_allclose(at_places(surface, x, y), bent(x, y), atol=6e-3 if count == 40 else 2e-3)
    check_tangents(surface, atol=1e-6)


def test_beyond_the_measured_points_the_screen_goes_on_straight():
    fx, fy = regular(7, 7, 0.2, 0.8)
    surface = screen_surface(screen(shape_of(fx, fy, bent(fx, fy))))
    u = np.array([1.0, 2.0, 4.0]) + OFFSET[0] + 0.6 * HALF[0]
    points = surface.points(u, np.full(3, OFFSET[1]))
    np.testing.assert_allclose((points[2] - points[1]) / 2, points[1] - points[0], atol=1e-12)
    check_tangents(surface, reach=1.4, atol=1e-6)


# --- refused ------------------------------------------------------------------------------------------------


def folded(points):
    with pytest.raises(SceneError) as caught:
        screen_surface(screen(points))
    text = str(caught.value)
    assert text.isprintable()
    return text


@pytest.mark.parametrize("cloud", [regular(9, 9), scattered(80)])
def test_points_that_fold_over_are_refused_with_the_place(cloud):
    fx, fy = cloud
    x = 20 * (fx + 0.25 * np.sin(8 * fx))  # turns back near fx = 0.33
    text = folded(shape_of(fx, fy, np.stack([x, 18 * fy], -1)))
    assert text.startswith("screen.shape.points_mm: fold over near the place [")
    place = float(text.split("[")[1].split(",")[0])
    slope = 1 + 2 * np.cos(8 * place)
    assert slope < 0.3  # where it does


def test_a_mirrored_screen_is_refused():
    fx, fy = regular(4, 4)
    assert "fold over" in folded(shape_of(fx, fy, np.stack([-20 * fx, 18 * fy], -1)))


def test_a_screen_stretched_and_turned_a_little_is_not_folded():
    fx, fy = regular(6, 6)
    points = np.stack([30 * fx - 2 * fy, 10 * fy + 3 * fx], -1)
    screen_surface(screen(shape_of(fx, fy, points)))


@pytest.mark.parametrize("line", [(np.full(5, 0.3), np.linspace(0, 1, 5)), (np.linspace(0, 1, 6), np.linspace(0, 1, 6))])
def test_places_on_a_line_are_refused(line):
    text = folded(shape_of(*line, np.stack([20 * line[0], 18 * line[1]], -1)))
    assert text == "screen.shape.fractions: all places lie on a line; must span the screen in both directions"
