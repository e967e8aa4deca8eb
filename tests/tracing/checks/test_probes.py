"""Single rays on a device: what the probes write out is what the host's surface and chief rays say."""

from __future__ import annotations

import numpy as np
import pytest
from device_kernels import SmallKernel, kernel_text
from real_setup import SHAPES, real_setup
from scenes import coarse, scene_of, with_part

from irtscots_cl.opencl.program import BLOCK
from irtscots_cl.opencl.structs import PRECISIONS
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.tracing.checks.probes import MeetProbe, PathProbe, uniform_centred
from irtscots_cl.tracing.packing.sources import emitters, receivers

# mm, at a mirror of some metres: single precision rounds lengths by 1e-4, double by 1e-12 beside Newton's steps
LIMIT = {"fp32": 3e-3, "fp64": 1e-6}


@pytest.mark.parametrize("count", [1, 37, 1024])
@pytest.mark.parametrize("name", ["sphere-deviated", "lopsided"])
def test_lines_meet_the_hosts_surface(device, precision, name, count):
    """Any number of lines, also one that is no multiple of the rays side by side."""
    chief = ChiefRays(scene_of(name))
    random = np.random.default_rng(count)
    at = random.uniform(-0.6, 0.6, (2, count)) * chief.scene.mirror.diameter_mm
    slopes = random.uniform(-0.02, 0.02, (2, count))
    lines = np.concatenate([at, slopes]).astype(PRECISIONS[precision])
    met = MeetProbe(device, chief.scene, precision)(lines)
    x0, y0, p, q = lines.astype(float)
    points, outgoing = chief.surface.meet(
        np.stack([x0, y0, 0 * x0], -1), np.stack([-p, -q, -np.ones(count)], -1), newton_steps=8
    )
    on = chief.surface.contains(points[:, 0], points[:, 1])
    radius = np.hypot(points[:, 0], points[:, 1])
    edges = [chief.surface.aperture_radius_mm, chief.surface.obscuration_radius_mm]
    clear = np.abs(radius[:, None] - edges).min(1) > 1e-2  # rounding may take a ray across an edge
    np.testing.assert_array_equal(met.on_mirror[clear], on[clear])
    inside = on & clear
    assert inside.any() or count == 1
    np.testing.assert_allclose(met.point.T[inside], points[inside], rtol=0, atol=LIMIT[precision])
    frame = chief.screen_frame
    start, way = (points - frame.position_mm) @ frame.axes.T, outgoing @ frame.axes.T
    landing = start - way * (start[:, 2:] / way[:, 2:])
    np.testing.assert_allclose(met.landing.T[inside], landing[inside, :2], rtol=0, atol=3 * LIMIT[precision])
    slope_x, slope_y = chief.surface.gradient(points[inside, 0], points[inside, 1])
    normal = met.normal[:, inside]
    np.testing.assert_allclose(-normal[0] / normal[2], slope_x, rtol=0, atol=1e-6)
    np.testing.assert_allclose(-normal[1] / normal[2], slope_y, rtol=0, atol=1e-6)


def spread_words(count):
    return np.random.default_rng(5).integers(0, 2**32, (count, 4), dtype=np.uint32)


def test_adjoint_paths_are_the_chief_rays_through_their_points_of_the_aperture(device, precision):
    chief = ChiefRays(coarse("sphere-deviated", 9))
    pixels = np.flatnonzero(chief.sees_mirror)[[3, 17]]
    sources = receivers(chief, pixels, np.zeros((2, 2), int), precision).repeat(BLOCK)
    words = spread_words(2 * BLOCK - 9)  # the last block is not whole
    paths = PathProbe(device, chief.scene, precision, "adjoint")(sources[: len(words)], words)
    assert paths.on_mirror.any() and (np.hypot(*paths.disk) <= 1 + 1e-6).all()
    row, column = np.divmod(pixels.repeat(BLOCK)[: len(words)], chief.shape[1])
    step = [uniform_centred(words[:, k]) for k in range(4)]
    radius = chief.scene.camera.aperture_diameter_mm / 2
    found = [
        chief.reverse(row + step[b], column + step[a], *(radius * paths.disk.astype(float)))
        for a, b in ((0, 1), (2, 3))
    ]
    errors = [np.abs(points - paths.point.T)[paths.on_mirror].max() for points, _, _ in found]
    points, u, v = found[int(np.argmin(errors))]
    on = paths.on_mirror & paths.ahead
    np.testing.assert_allclose(paths.point.T[on], points[on], rtol=0, atol=LIMIT[precision])
    np.testing.assert_allclose(paths.landing[:, on], np.stack([u, v])[:, on], rtol=0, atol=3 * LIMIT[precision])


def test_forward_paths_name_the_pixel_that_sees_their_point_of_the_mirror(device, precision):
    scene = coarse("sphere-deviated", 9)
    chief = ChiefRays(scene)
    sources, _ = emitters(Setup(chief.scene), precision, 1.0, "camera")
    middle = sources[[len(sources) // 2]].repeat(4 * BLOCK)
    paths = PathProbe(device, scene, precision, "forward")(middle, spread_words(4 * BLOCK))
    through = np.hypot(*paths.aperture) <= scene.camera.aperture_diameter_mm / 2
    assert through.any() and not through.all()
    assert (paths.through == through).mean() > 0.99  # rounding at the aperture's edge
    light = paths.on_mirror & paths.through & (paths.pixel >= 0)
    assert light.sum() > 20 and (paths.pixel < 81).all()
    seen, _, _ = chief.reverse(*np.divmod(paths.pixel[light], 9))
    far = np.abs(paths.point.T[light] - seen)[:, :2].max(1)
    pitch = np.linalg.norm(np.diff(chief.reverse(np.array([4, 4]), np.array([4, 5]))[0], axis=0))
    assert (far < 0.7 * pitch).all()  # half a pixel on the mirror, and the blur of the aperture


def pixels_of(scene, count=40):
    """Some of the detector pixels that see the mirror."""
    visible = np.flatnonzero(ChiefRays(scene).sees_mirror)
    return visible[np.linspace(0, len(visible) - 1, count).astype(int)]


def on_screen(scene, u, v):
    """Landing points on the screen's pixels."""
    inside = [
        np.abs(w - offset) < n * pitch / 2
        for w, offset, n, pitch in zip(
            (u, v), scene.screen.centre_offset_mm, scene.screen.pixels, scene.screen.pitch_xy_mm, strict=True
        )
    ]
    return inside[0] & inside[1]


@pytest.mark.parametrize("glass", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_adjoint_paths_of_a_real_set_up_are_the_chief_rays(device, precision, shape, glass):
    """Through a distorted camera onto a bent screen under glass, all turned and shifted: landing points and weights."""
    scene = real_setup(shape, glass)
    chief, pixels = ChiefRays(scene), pixels_of(scene)
    words = spread_words(len(pixels) * BLOCK)
    sources = receivers(chief, pixels, np.zeros((len(pixels), 2), int), precision).repeat(BLOCK)
    paths = PathProbe(device, scene, precision, "adjoint")(sources, words)
    row, column = np.divmod(pixels.repeat(BLOCK), chief.shape[1])
    row, column = row + uniform_centred(words[:, 1]), column + uniform_centred(words[:, 0])
    a, b = scene.camera.aperture_diameter_mm / 2 * paths.disk.astype(float)
    points, u, v = chief.reverse(row, column, a, b)
    on = paths.on_mirror & paths.ahead & on_screen(scene, u, v)
    assert on.sum() > 4000
    # the quadratic of the distortion: 2e-5 of a pixel, of which one is 4 mm on the mirror; and rounding at 2 m
    np.testing.assert_allclose(paths.point.T[on], points[on], rtol=0, atol={"fp32": 2e-4, "fp64": 4e-5}[precision])
    # of the measured points, whose spline has kinks in its third derivative, the cubic: 1e-3 of a screen pixel
    limit = {"fp32": 4e-4, "fp64": 2e-6}[precision] + 1e-3 * (shape == "points")
    np.testing.assert_allclose(paths.landing[:, on], np.stack([u, v])[:, on], rtol=0, atol=limit)
    x, y = chief.camera_model.image_point(row, column)
    camera = scene.camera
    slopes = [p / camera.focus_mm - w / camera.image_distance_mm for p, w in ((a, x), (b, y))]
    weight = (1 + slopes[0] ** 2 + slopes[1] ** 2) ** -2 * chief.camera_model.stretch(row, column)
    np.testing.assert_allclose(paths.weight, weight, rtol=5e-5)  # of a change by 1e-2 over a pixel


@pytest.mark.parametrize("glass", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_forward_paths_of_a_real_set_up_start_where_the_camera_sees(device, precision, shape, glass):
    """The chief ray back from where a forward ray enters the camera lights the place that it left, and the pixel is
    the camera model's."""
    scene = real_setup(shape, glass)
    chief, camera, screen = ChiefRays(scene), scene.camera, scene.screen
    sources, _ = emitters(Setup(scene), precision, 1.0, "mirror")
    chosen = np.linspace(0, len(sources) - 1, 40).astype(int).repeat(BLOCK)
    words = spread_words(len(chosen))
    paths = PathProbe(device, scene, precision, "forward")(sources[chosen], words)
    place = np.stack(np.divmod(chosen, screen.pixels[0]))[::-1] + uniform_centred(words[:, :2]).T
    left = [(at - (n - 1) / 2) * pitch + offset for at, n, pitch, offset in
            zip(place, screen.pixels, screen.pitch_xy_mm, screen.centre_offset_mm, strict=True)]  # fmt: skip
    (a, b), (p, q) = paths.aperture.astype(float), paths.slopes.astype(float)
    image = [camera.image_distance_mm * (w / camera.focus_mm - slope) for w, slope in ((a, p), (b, q))]
    row, column = chief.camera_model.pixel(*image)
    (columns, rows), seen = camera.detector.pixels, paths.on_mirror & (np.hypot(a, b) < 60.0)
    seen &= (np.abs(row - (rows - 1) / 2) < rows / 2) & (np.abs(column - (columns - 1) / 2) < columns / 2)
    points, u, v = chief.reverse(row, column, a, b)
    assert seen.sum() > 7000
    np.testing.assert_allclose(paths.point.T[seen], points[seen], rtol=0, atol={"fp32": 2e-4, "fp64": 1e-8}[precision])
    # a pixel of a bent screen is taken as its tangent plane: pitch^2 / 8 over 60 mm, along a slope of 1/3; and its
    # glass as plane over a pixel
    bend = 0 if shape == "flat" else 1.2e-3 + 1.2e-3 * glass
    limit = {"fp32": 4e-4, "fp64": 2e-9}[precision] + bend
    np.testing.assert_allclose(np.stack([u, v])[:, seen], np.stack(left)[:, seen], rtol=0, atol=limit)
    edge = np.abs((np.stack([row, column])[:, seen] + 0.5) % 1 - 0.5).max(0) > 0.499
    number = (np.rint(row) * columns + np.rint(column))[seen]
    assert (paths.pixel[seen][~edge] == number[~edge]).all() and edge.mean() < 0.01


def test_light_from_far_beside_the_image_is_not_folded_back_into_it(device, tmp_path):
    """A barrel distortion turns round at a radius of 0.94 focal lengths; at 1.63 its polynomial is back on the axis."""
    scene = with_part(coarse("sphere", 25), "camera", intrinsics=Intrinsics(distortion=(-0.375, 0.0, 0.0, 0.0, 0.0)))
    entry = kernel_text(
        tmp_path / "pixel_of.cl", ["camera_*.cl"], "__constant Scene *scene, __global int *out",
        "    const real x = scene->image_distance * (real)0.01 * get_global_id(0);\n"
        "    out[get_global_id(0)] = camera_pixel(scene, x, 0);",
    )  # fmt: skip
    (pixel,) = SmallKernel(device, entry, "fp32", scene, width=1).run((300, 1), [], [np.zeros(300, np.int32)])
    inside = pixel >= 0
    half = 125 * 0.037 / 2 / scene.camera.image_distance_mm  # of the image, 0.145
    assert 0.14 < half < 0.15
    assert inside[:15].all() and not inside[15:].any()


def test_uniform_centred_is_symmetric_and_keeps_off_zero_and_the_ends():
    words = np.array([0, 127, 128, 2**31 - 1, 2**31, 2**32 - 1], np.uint32)
    expected = np.array([1, 1, 3 - 2, 2**24 - 1, -(2**24) + 1, -1])
    assert (uniform_centred(words)[[0, 1, 3, 4, 5]] * 2**25 == expected[[0, 1, 3, 4, 5]]).all()
    step = uniform_centred(np.arange(0, 2**32, 2**24 + 7, dtype=np.uint64).astype(np.uint32))
    assert ((np.abs(step) > 0) & (np.abs(step) < 0.5)).all()
    assert (step * 2**25 % 2 == 1).all()  # odd multiples
