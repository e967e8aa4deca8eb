"""Device paths ray by ray against an independent float64 tracer, and that tracer against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from lopsided import lopsided
from oracle import tracer
from oracle_rays import adjoint_rays, forward_rays
from scenes import CURVATURES, SEQUENTIAL, with_part
from scenes import scene_of as scene_by_name

from irtscots_cl.scene.presets import load_scene

SCENES = [*SEQUENTIAL, "lopsided", *CURVATURES]


def scene_of(name):
    """Of a mirror that is not concave hardly any ray would pass the camera's aperture: it is wider here."""
    scene = scene_by_name(name)
    wide = {"sideways": 10.0}.get(name, 60.0)
    return with_part(scene, "camera", aperture_diameter_mm=wide) if name in CURVATURES else scene


LANDING_MM = {"fp32": 1e-3, "fp64": 1e-6}  # 1 um and 1 nm: 1/200 and 1/200,000 of a screen pixel
MIRROR_MM = {"fp32": 1e-3, "fp64": 1e-6}  # the same: 1/10,000 of a detector pixel's footprint
WEIGHT = {"fp32": 1e-6, "fp64": 1e-14}  # of 1: ten roundings


def worst(difference):
    return np.linalg.norm(difference, axis=-1).max()


def ground(oracle):
    """Where the rays' lines to the mirror cross z = 0, [n, 2] mm."""
    start, end = oracle.start, oracle.mirror
    return (start + (end - start) * (start[:, 2:] / (start[:, 2:] - end[:, 2:])))[:, :2]


def rim_distance(scene, points):
    """How far mirror points [n, 3] are from the nearest edge of the mirror's aperture [mm]."""
    radius = np.hypot(points[:, 0], points[:, 1])
    edges = np.array([scene.mirror.diameter_mm, scene.mirror.obscuration_mm]) / 2
    return np.abs(radius[:, None] - edges).min(1)


@pytest.mark.parametrize("name", SCENES)
def test_forward_paths(device, precision, name):
    scene = scene_of(name)
    rays = forward_rays(device, scene, precision)
    # lines that pass a metre beside the aperture lose more of their digits
    tolerance = (2 if name in CURVATURES else 1) * LANDING_MM[precision]
    paths, oracle = rays.paths, rays.oracle
    met = oracle.on_mirror
    # the aim covers the mirror closely, or where pixels are large against it less so
    assert len(paths) >= 10_000 and met.mean() > (0.6 if name in CURVATURES else 0.9)
    assert worst((paths[:, 0:2] - ground(oracle))[met]) < MIRROR_MM[precision]
    assert worst((paths[:, 2:5] - oracle.mirror)[met]) < MIRROR_MM[precision]
    assert worst((paths[:, 5:7] - oracle.aperture)[met]) < tolerance
    # A slope times the distance in focus is a place on the mirror, which the image shows.
    assert worst((paths[:, 7:9] - oracle.slopes)[met]) * tracer.focus_distance(scene.camera) < tolerance

    clear = rim_distance(scene, oracle.mirror) > tolerance
    np.testing.assert_array_equal(rays.marks[clear, 0], oracle.on_mirror[clear])
    rim = np.hypot(*oracle.aperture.T) - scene.camera.aperture_diameter_mm / 2
    clear &= np.abs(rim) > tolerance
    assert clear.mean() > 0.99 and oracle.through[clear].any() and not oracle.through[clear].all()
    np.testing.assert_array_equal(rays.marks[clear, 1], oracle.through[clear])


@pytest.mark.parametrize("name", SCENES)
def test_forward_paths_land_on_the_detector_pixel_that_the_lens_images_them_to(device, precision, name):
    scene = scene_of(name)
    rays = forward_rays(device, scene, precision)
    column, row = tracer.detector_pixel(scene.camera, rays.oracle.image)
    columns, rows = scene.camera.detector.pixels
    # landing error on the mirror's side, seen as a fraction of a pixel's footprint there
    footprint = (
        scene.camera.detector.pitch_mm * tracer.focus_distance(scene.camera) / tracer.image_distance(scene.camera)
    )
    # position and slope each within the landing tolerance; four times for rays that pass a metre beside the aperture
    margin = (8 if name in CURVATURES else 2) * LANDING_MM[precision] / footprint
    off_centre = np.maximum(np.abs(column - np.round(column)), np.abs(row - np.round(row)))
    clear = rays.oracle.on_mirror & (0.5 - off_centre > margin)
    column, row = np.floor(column + 0.5).astype(int), np.floor(row + 0.5).astype(int)
    on = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    expected = np.where(on, row * columns + column, -1)
    assert clear.sum() >= 7500 and len(np.unique(expected[clear])) > 2000
    np.testing.assert_array_equal(rays.marks[clear, 2], expected[clear])
    # the lop-sided mirror's image is larger than the detector; others' rays pass far beside the aperture
    assert (name in ("lopsided", "convex", "flat", "lopsided-convex")) == bool((expected[clear] < 0).any())


@pytest.mark.parametrize("name", SCENES)
def test_adjoint_paths(device, precision, name):
    scene = scene_of(name)
    rays = adjoint_rays(device, scene, precision)
    paths, oracle = rays.paths, rays.oracle
    # a nearly level ray may pass the mirror and meet the far side of its sphere, which the oracle tells by nothing else
    met = oracle.on_mirror & (np.abs(oracle.mirror[:, 2]) < scene.mirror.diameter_mm / 4)
    assert met.sum() >= (1500 if name == "sideways" else 10_000)  # most of its pixels see the mirror at their edge
    assert worst((paths[:, 0:2] - ground(oracle))[met]) < MIRROR_MM[precision]
    assert worst((paths[:, 2:5] - oracle.mirror)[met]) < MIRROR_MM[precision]
    assert worst((paths[:, 5:7] - oracle.screen)[met]) < LANDING_MM[precision]
    assert np.abs(paths[:, 7] - oracle.cosine4).max() < WEIGHT[precision]
    clear = rim_distance(scene, oracle.mirror) > LANDING_MM[precision]
    assert clear.mean() > 0.99 and not met[clear].all()
    np.testing.assert_array_equal(rays.marks[clear, 0], met[clear])
    assert oracle.ahead.all() and rays.marks[met, 1].all()


# --- the oracle itself -------------------------------------------------------------------------------------


def test_oracle_orders_zernike_terms_by_the_published_tables():
    # Noll 1976, table I: (n, m), even numbers are cosines
    noll = {
        1: (0, 0),
        2: (1, 1),
        3: (1, -1),
        4: (2, 0),
        5: (2, -2),
        6: (2, 2),
        7: (3, -1),
        8: (3, 1),
        9: (3, -3),
        10: (3, 3),
        11: (4, 0),
        12: (4, 2),
        13: (4, -2),
        22: (6, 0),
    }
    assert {j: tracer.zernike_order(j, "noll") for j in noll} == noll
    osa = {
        0: (0, 0),
        1: (1, -1),
        2: (1, 1),
        3: (2, -2),
        4: (2, 0),
        5: (2, 2),
        8: (3, 1),
        12: (4, 0),
        17: (5, -1),
    }
    assert {j: tracer.zernike_order(j, "osa") for j in osa} == osa
    fringe = {
        1: (0, 0),
        2: (1, 1),
        3: (1, -1),
        4: (2, 0),
        5: (2, 2),
        6: (2, -2),
        7: (3, 1),
        9: (4, 0),
        16: (6, 0),
    }
    assert {j: tracer.zernike_order(j, "fringe") for j in fringe} == fringe


def test_oracle_zernike_terms_are_orthonormal():
    radius, weight = np.polynomial.legendre.leggauss(12)  # exact to degree 23 in rho; the terms need 13
    rho, angle = np.meshgrid((radius + 1) / 2, np.arange(32) * np.pi / 16, indexing="ij")
    area = (weight / 2 * (radius + 1) / 2)[:, None] / 16 * np.ones_like(angle)  # rho d(rho) d(angle) / pi
    orders = [(n, m) for n in range(7) for m in range(-n, n + 1, 2)]
    terms = np.stack([tracer.zernike_polar(n, m, rho, angle)[0] for n, m in orders])
    gram = np.einsum("iab,jab,ab->ij", terms, terms, area)
    np.testing.assert_allclose(gram, np.eye(len(orders)), rtol=0, atol=1e-12)  # rounding of sums of 384


@pytest.mark.parametrize("name", SCENES)
def test_oracle_meets_the_surface_and_its_normal_is_the_slope(name):
    surface = tracer.OracleMirror(scene_of(name).mirror)
    generator = np.random.default_rng(3)
    half = surface.mirror.diameter_mm / 2 / np.sqrt(2)
    xy = generator.uniform(-half, half, (200, 2))
    down = np.tile([0.0, 0.0, -1.0], (200, 1))

    def height(x, y):
        return surface.meet(np.stack([x, y, np.full_like(x, 900.0)], -1), down)[:, 2]

    z = height(*xy.T)
    points = np.column_stack([xy, z])
    assert np.abs(surface.implicit(points)[0]).max() < 1e-12  # mm: rounding at 1 m
    _, gradient = surface.implicit(points)
    step = 1e-2  # mm: rounding 1e-13 / 1e-2, third derivatives 1e-2^2 x 1e-9
    slope_x = (height(xy[:, 0] + step, xy[:, 1]) - height(xy[:, 0] - step, xy[:, 1])) / (2 * step)
    slope_y = (height(xy[:, 0], xy[:, 1] + step) - height(xy[:, 0], xy[:, 1] - step)) / (2 * step)
    np.testing.assert_allclose(-gradient[:, 0] / gradient[:, 2], slope_x, rtol=0, atol=1e-10)  # of the step, above
    np.testing.assert_allclose(-gradient[:, 1] / gradient[:, 2], slope_y, rtol=0, atol=1e-10)  # of the step, above


def test_oracle_sphere_returns_light_from_its_centre():
    scene = load_scene("sphere")
    surface = tracer.OracleMirror(scene.mirror)
    centre = np.array([0.0, 0.0, scene.mirror.radius_mm])
    directions = np.array([[0.0, 0.0, -1.0], [0.1, 0.02, -1.0], [-0.05, 0.12, -1.0]])
    points = surface.meet(np.tile(centre, (3, 1)), directions)
    np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), scene.mirror.radius_mm, rtol=1e-15)  # rounding
    np.testing.assert_allclose(surface.reflect(points, directions), -directions, rtol=0, atol=1e-14)  # rounding


def test_oracle_parabola_collects_parallel_light_in_the_focus():
    mirror = load_scene("off-axis").mirror
    parabola = tracer.OracleMirror(type(mirror)(radius_mm=2000.0, conic=-1.0, off_axis_mm=300.0, diameter_mm=200.0))
    tilt = np.arctan(300.0 / 2000.0)  # of the parent's axis against the segment's normal: slope of the parent there
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    in_plane = np.array([np.cos(tilt), 0.0, -np.sin(tilt)])
    vertex = -300.0 * in_plane - 300.0**2 / 4000.0 * axis
    focus = vertex + 1000.0 * axis
    start = np.array([[x, y, 500.0] for x in (-60.0, 0.0, 70.0) for y in (-50.0, 20.0)])
    points = parabola.meet(start, np.tile(-axis, (6, 1)))
    outgoing = parabola.reflect(points, np.tile(-axis, (6, 1)))
    miss = np.linalg.norm(np.cross(focus - points, outgoing), axis=1)
    assert miss.max() < 1e-10  # mm: rounding at 1 m


def test_oracle_lens_is_sharp_in_focus_and_upright():
    camera = lopsided().camera
    x, y, z = tracer.device_axes(camera.position_mm, camera.look_at_mm)
    object_point = np.asarray(camera.position_mm) + 30.0 * x - 12.0 * y - tracer.focus_distance(camera) * z
    image = tracer.upright_image(camera, object_point)
    assert image[0] > 0 > image[1]
    np.testing.assert_allclose(tracer.focus_point(camera, image), object_point, rtol=0, atol=1e-11)  # rounding at 1.5 m
    # Behind the lens a ray at aperture point a has slope p - a / f; all meet at the inverted image.
    distance = tracer.image_distance(camera)
    for a in (-1.5, 0.0, 1.2):
        slope = (a - 30.0) / tracer.focus_distance(camera)
        assert a + distance * (slope - a / camera.focal_length_mm) == pytest.approx(-image[0], abs=1e-13)  # rounding
