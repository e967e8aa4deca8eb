"""Chief rays at convex and flat mirrors against closed forms, and the geometries that cannot be measured."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import scene_of, with_part

from irtscots_cl.optics.chief_rays import ChiefRays, check_visible
from irtscots_cl.scene.validation import SceneError

ROUNDING_MM = 1e-9  # of a kilometre's worth of steps at 1 m: far above float64's 1e-13


def camera_rays(scene, count=400, seed=1):
    """Rows, columns, aperture points, and the rays' starts and directions [n, 3], from the lens's own definition."""
    random, camera = np.random.default_rng(seed), scene.camera
    columns, rows = camera.detector.pixels
    row, column = random.uniform(0, rows, count) - 0.5, random.uniform(0, columns, count) - 0.5
    a, b = random.uniform(-0.3, 0.3, (2, count)) * camera.aperture_diameter_mm
    z = np.subtract(camera.position_mm, camera.look_at_mm)
    focus = np.linalg.norm(z)
    z = z / focus
    x = np.array([1.0, 0.0, 0.0]) if z[0] == z[2] == 0 else np.array([z[2], 0.0, -z[0]]) / np.hypot(z[0], z[2])
    y = np.cross(z, x)
    magnification = focus / (1 / (1 / camera.focal_length_mm - 1 / focus))
    at_x = (column - (columns - 1) / 2) * camera.detector.pitch_mm * magnification
    at_y = (row - (rows - 1) / 2) * camera.detector.pitch_mm * magnification
    start = camera.position_mm + np.outer(a, x) + np.outer(b, y)
    sharp = camera.position_mm - focus * z + np.outer(at_x, x) + np.outer(at_y, y)
    return (row, column, a, b), start, sharp - start


def in_screen(scene, points):
    """(u, v) of points of the screen's plane; all screens here are parallel to the mirror or look along Y."""
    away = points - np.asarray(scene.screen.position_mm)
    return (away[:, 0], away[:, 2]) if scene.name == "sideways" else (away[:, 0], away[:, 1])


@pytest.mark.parametrize("name", ["flat", "sideways"])
def test_a_flat_mirror_shows_the_screen_where_its_image_point_is(name):
    """The camera's ray, gone straight on through the mirror, meets the screen's mirror image at the image point."""
    scene = scene_of(name).nominal()
    given, start, direction = camera_rays(scene)
    points, u, v = ChiefRays(scene).reverse(*given)
    down = direction[:, 2] < 0  # in a sideways camera half of the rays go up
    assert np.isnan(points[~down]).all() and np.isnan(u[~down]).all()
    start, direction = start[down], direction[down]
    ground = start - direction * (start[:, 2:] / direction[:, 2:])
    np.testing.assert_allclose(points[down], ground, rtol=0, atol=ROUNDING_MM * np.abs(ground).max())
    axis = 1 if name == "sideways" else 2
    image = np.asarray(scene.screen.position_mm) * [1, 1, -1]
    crossing = start + direction * ((image[axis] - start[:, axis]) / direction[:, axis])[:, None]
    u_image, v_image = in_screen(scene, crossing * [1, 1, -1])
    before = (ground - scene.screen.position_mm)[:, axis] * (-1 if axis == 2 else 1) > 0  # the screen's front
    assert before.sum() > 100 and np.isnan(u[down][~before]).all()
    size = max(1.0, np.abs([u_image, v_image])[:, before].max() / 1000)
    np.testing.assert_allclose(u[down][before], u_image[before], rtol=0, atol=ROUNDING_MM * size)
    np.testing.assert_allclose(v[down][before], v_image[before], rtol=0, atol=ROUNDING_MM * size)


def test_a_convex_sphere_reflects_as_a_ball_does():
    """Nearest crossing of a line with a ball about its centre behind the vertex, and the law of reflection."""
    scene = scene_of("convex").nominal()
    given, start, direction = camera_rays(scene)
    points, u, v = ChiefRays(scene).reverse(*given)
    way = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    from_centre = start - [0.0, 0.0, -3000.0]
    along = np.sum(from_centre * way, 1)
    room = along**2 - np.sum(from_centre**2, 1) + 3000.0**2
    met = start + way * (-along - np.sqrt(room))[:, None]
    normal = (met - [0.0, 0.0, -3000.0]) / 3000.0
    away = way - 2 * np.sum(way * normal, 1, keepdims=True) * normal
    landing = met + away * ((1000.0 - met[:, 2]) / away[:, 2])[:, None]
    assert (met[:, 2] <= 0).all() and np.ptp(landing[:, 0]) > 700
    np.testing.assert_allclose(points, met, rtol=0, atol=ROUNDING_MM)
    np.testing.assert_allclose([u, v], in_screen(scene, landing), rtol=0, atol=ROUNDING_MM)


# --- what cannot be measured -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["convex", "flat", "lopsided-convex", "sideways"])
def test_scenes_that_can_be_measured_pass(name):
    check_visible(ChiefRays(scene_of(name)), name)


def test_a_screen_that_is_too_small_and_beside_the_light_is_told_where_it_is_and_how_wide():
    scene = with_part(scene_of("convex"), "screen", pixels=(20, 20), centre_offset_mm=(-800.0, 0.0))
    with pytest.raises(SceneError) as caught:
        check_visible(ChiefRays(scene), "mine")
    message = str(caught.value)
    assert message.startswith("mine: screen.position_mm = [420.0, 0.0, 1000.0]: no detector pixel sees the screen")
    x, y = map(float, message.split("about ")[1].split(" mm")[0].split(", "))
    width, height = map(float, message.split("over ")[1].split(" mm")[0].split(" x "))
    assert (x, y) == pytest.approx((800.0, 0.0), abs=30.0) and (width, height) == pytest.approx((870, 850), abs=30)


def test_a_screen_that_the_light_passes_on_its_back_is_refused():
    """On the camera's side, where the mirror sends no light: all reflected rays run away from it."""
    scene = with_part(scene_of("convex"), "screen", position_mm=(-600.0, 0.0, 60.0), look_at_mm=(0.0, 0.0, 0.0))
    with pytest.raises(SceneError, match=r"screen.position_mm = \[-600.0, 0.0, 60.0\]: no ray from the detector"):
        check_visible(ChiefRays(scene), "mine")
