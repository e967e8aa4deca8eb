"""The mirror's surface in float64 against closed forms, and the device's twin against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from device_kernels import SmallKernel, kernel_text
from lopsided import lopsided
from scenes import CURVATURES, SEQUENTIAL, with_part
from scenes import scene_of as preset_or_lopsided

from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.presets import load_scene

SCENES = [*SEQUENTIAL, "lopsided", "conic", "mapped", *CURVATURES]


def scene_of(name):
    if name == "conic":
        return with_part(lopsided(), "mirror", off_axis_mm=0.0)
    return preset_or_lopsided(name)


def points_inside(mirror, count, seed, share=0.98):
    """Uniform points [count] of the mirror's aperture, not nearer to an edge than a share of the radius."""
    generator = np.random.default_rng(seed)
    inner, outer = mirror.obscuration_mm / 2 / share, mirror.diameter_mm / 2 * share
    radius = np.sqrt(generator.uniform(inner**2, outer**2, count))
    angle = generator.uniform(0, 2 * np.pi, count)
    return radius * np.cos(angle), radius * np.sin(angle)


def test_sag_of_a_sphere():
    surface = Surface.of(load_scene("sphere").mirror)
    x, y = points_inside(load_scene("sphere").mirror, 200, 1)
    np.testing.assert_allclose(
        surface.sag(x, y), 4166.747 - np.sqrt(4166.747**2 - x * x - y * y), rtol=0, atol=2e-12
    )  # ulp of R


@pytest.mark.parametrize("conic", [-1.0, -0.7154, 0.0, 1.3, -4.0])
def test_sag_of_a_conic(conic):
    mirror = Mirror(radius_mm=1500.0, conic=conic, diameter_mm=400.0)
    x, y = points_inside(mirror, 200, 2)
    r2 = x * x + y * y
    sag = r2 / 1500.0 / (1 + np.sqrt(1 - (1 + conic) * r2 / 1500.0**2))
    np.testing.assert_allclose(Surface.of(mirror).sag(x, y), sag, rtol=0, atol=1e-13)  # mm: rounding at 13 mm


def test_an_off_axis_sphere_is_the_sphere():
    on, off = (Surface.of(Mirror(radius_mm=1500.0, diameter_mm=400.0, off_axis_mm=d)) for d in (0.0, 310.0))
    x, y = points_inside(Mirror(radius_mm=1500.0, diameter_mm=400.0), 100, 3)
    np.testing.assert_allclose(off.sag(x, y), on.sag(x, y), rtol=0, atol=1e-12)  # mm: rounding at 1.5 m


def test_deviations_add_up_over_tables_and_orderings():
    base = Mirror(radius_mm=1500.0, diameter_mm=200.0)
    terms = [
        ZernikeTerms(radius_mm=120.0, ordering=o, coefficients_um={j: c})
        for o, j, c in [("noll", 8, 1.5), ("osa", 8, 0.5), ("fringe", 7, -3.0), ("noll", 4, 2.0)]
    ]
    x, y = points_inside(base, 100, 4)
    each = sum(Surface.of(replace(base, zernike=(t,))).deviation_at(x, y)[0] for t in terms)
    open_pool = Surface.of(replace(base, zernike=tuple(terms))).deviation_at(x, y)[0]
    np.testing.assert_allclose(open_pool, each, rtol=0, atol=1e-17)  # mm: rounding of micrometres
    rho2 = (x * x + y * y) / 120.0**2
    coma = np.sqrt(8) * (3 * rho2 - 2) * x / 120.0  # the same term three times: 1.5 + 0.5 - 3.0 um
    power = np.sqrt(3) * (2 * rho2 - 1)
    np.testing.assert_allclose(open_pool, -1.0e-3 * coma + 2.0e-3 * power, rtol=0, atol=1e-16)  # mm: rounding


@pytest.mark.parametrize("name", SCENES)
def test_gradient_is_the_difference_quotient_of_the_sag(name):
    mirror = scene_of(name).mirror
    surface = Surface.of(mirror)
    x, y = points_inside(mirror, 200, 5)
    h = 0.05  # mm: rounding 1e-13 / h, third derivatives 1e-7 h^2 at the most (of the Zernike terms)
    by_x = (surface.sag(x + h, y) - surface.sag(x - h, y)) / (2 * h)
    by_y = (surface.sag(x, y + h) - surface.sag(x, y - h)) / (2 * h)
    np.testing.assert_allclose(surface.gradient(x, y), [by_x, by_y], rtol=0, atol=2e-10)  # of the step, above


@pytest.mark.parametrize("name", SCENES)
def test_meet_lies_on_the_surface_and_obeys_the_law_of_reflection(name):
    mirror = scene_of(name).mirror
    surface = Surface.of(mirror)
    aim_x, aim_y = points_inside(mirror, 500, 6)
    start = np.array([-120.0, 90.0, 2500.0]) + np.random.default_rng(7).uniform(-80, 80, (500, 3))
    directions = 0.3 * (np.stack([aim_x, aim_y, surface.sag(aim_x, aim_y)], -1) - start)
    points, outgoing = surface.meet(start, directions)
    x, y, z = points.T
    np.testing.assert_allclose(
        [x, y], [aim_x, aim_y], rtol=0, atol=1e-8
    )  # mm: two Newton steps from 40 um of deviation
    np.testing.assert_allclose(z, surface.sag(x, y), rtol=0, atol=1e-8)  # mm: the same
    slope_x, slope_y = surface.gradient(x, y)
    normal = np.stack([-slope_x, -slope_y, np.ones(500)], -1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    length = np.linalg.norm(directions, axis=1)
    np.testing.assert_allclose(np.linalg.norm(outgoing, axis=1), length, rtol=1e-14)  # rounding
    tolerance = 1e-12  # rad: 1e-8 mm along a curvature of 1e-3 / mm makes 1e-11 mm / mm at the very most
    turn = (outgoing - directions) / length[:, None]
    assert np.abs(np.cross(turn, normal)).max() < tolerance  # it turns about the normal
    assert np.abs(np.sum((outgoing + directions) * normal, -1) / length).max() < tolerance  # by equal angles
    assert (outgoing[:, 2] > 0).all()


def test_meet_says_nan_where_the_surface_is_missed():
    surface = Surface.of(load_scene("sphere").mirror)
    points, _ = surface.meet(np.array([[0.0, 0.0, 4000.0], [5000.0, 0.0, 4000.0]]), np.array([[0.0, 0.0, -1.0]] * 2))
    assert np.isfinite(points[0]).all() and np.isnan(points[1, 2])


def test_contains_knows_rim_hole_and_margin():
    surface = Surface.of(Mirror(radius_mm=1500.0, diameter_mm=200.0, obscuration_mm=60.0))
    x, y = np.array([0.0, 29.9, 30.1, 99.9, 100.1]), np.zeros(5)
    np.testing.assert_array_equal(surface.contains(x, y), [False, False, True, True, False])
    np.testing.assert_array_equal(surface.contains(x, y, 0.2), [False, True, True, True, True])
    np.testing.assert_array_equal(surface.contains(y, -x), surface.contains(x, y))


MEET = """    const __global real *given = lines + 4 * WIDTH * get_global_id(0);
    realv of[4];
    for (int lane = 0; lane < WIDTH; ++lane)
        for (int i = 0; i < 4; ++i) ((real *)&of[i])[lane] = given[4 * lane + i];
    const Line line = {of[0], of[1], of[2], of[3]};
    Meeting at = mirror_meet(scene, tables, &line);
    mirror_deviate(scene, tables, &line, &at);
    const vec3v normal = mirror_normal(scene, &at);
    const intv met = to_int(at.on_mirror);
    const realv values[6] = {at.point.x, at.point.y, at.point.z, normal.x, normal.y, normal.z};
    for (int lane = 0; lane < WIDTH; ++lane) {
        const size_t ray = get_global_id(0) * WIDTH + lane;
        for (int i = 0; i < 6; ++i) out[6 * ray + i] = ((const real *)&values[i])[lane];
        marks[ray] = ((const int *)&met)[lane] & 1;
    }"""


@pytest.mark.parametrize("name", SCENES)
def test_device_meets_the_same_points_with_the_same_slopes(device, tmp_path, precision, name):
    scene = scene_of(name)
    surface = Surface.of(scene.mirror)
    entry = kernel_text(
        tmp_path / "meet.cl",
        ["reflection.cl"],
        "__constant Scene *scene, __global const real *tables, __global const real *lines, __global real *out, "
        "__global int *marks",
        MEET,
    )
    kernel = SmallKernel(device, entry, precision, scene)
    count = 4096
    x, y = points_inside(scene.mirror, count, 8, share=0.999)
    generator = np.random.default_rng(9)
    slopes = generator.uniform(-0.15, 0.15, (2, count))
    beyond = generator.random(count) < 0.1  # past the rim, still on the conic
    x, y = np.where(beyond, 1.01 * scene.mirror.diameter_mm / 2, x), np.where(beyond, 0.0, y)
    height = surface.sag(x, y)
    lines = np.stack([x - slopes[0] * height, y - slopes[1] * height, *slopes], -1).astype(kernel.real)
    out, marks = kernel.run(
        (count // kernel.width, 1),
        [kernel.tables, lines],
        [np.zeros((count, 6), kernel.real), np.zeros(count, np.int32)],
    )
    x0, y0, p, q = lines.astype(float).T
    start = np.stack([x0 + 3000 * p, y0 + 3000 * q, np.full(count, 3000.0)], -1)
    points, _ = surface.meet(start, np.stack([p, q, np.ones(count)], -1))
    out = out.astype(float)
    # fp32: an ulp of 532 mm is 6e-5; fp64: two Newton steps from 40 um of deviation
    np.testing.assert_allclose(out[:, :3], points, rtol=0, atol={"fp32": 1.5e-4, "fp64": 1e-8}[precision])
    slope_x, slope_y = surface.gradient(points[:, 0], points[:, 1])
    # fp32: an ulp of 0.128 is 1.5e-8, and four operations; times 8333 mm this makes 0.25 um on the screen
    tolerance = {"fp32": 3e-8, "fp64": 1e-11}[precision]
    np.testing.assert_allclose(-out[:, 3] / out[:, 5], slope_x, rtol=0, atol=tolerance)
    np.testing.assert_allclose(-out[:, 4] / out[:, 5], slope_y, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(marks == 1, ~beyond)
