"""Single rays on a device: what the probes write out is what the host's surface and chief rays say."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import coarse, scene_of

from irtscots_cl.opencl.structs import PRECISIONS
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.setup import Setup
from irtscots_cl.tracing.checks.probes import BLOCK, MeetProbe, PathProbe, uniform_centred
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


def test_uniform_centred_is_symmetric_and_keeps_off_zero_and_the_ends():
    words = np.array([0, 127, 128, 2**31 - 1, 2**31, 2**32 - 1], np.uint32)
    expected = np.array([1, 1, 3 - 2, 2**24 - 1, -(2**24) + 1, -1])
    assert (uniform_centred(words)[[0, 1, 3, 4, 5]] * 2**25 == expected[[0, 1, 3, 4, 5]]).all()
    step = uniform_centred(np.arange(0, 2**32, 2**24 + 7, dtype=np.uint64).astype(np.uint32))
    assert ((np.abs(step) > 0) & (np.abs(step) < 0.5)).all()
    assert (step * 2**25 % 2 == 1).all()  # odd multiples
