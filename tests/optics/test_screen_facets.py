"""The planes of a bent screen's pixels."""

from __future__ import annotations

import numpy as np
import pytest
from real_setup import real_setup
from scenes import with_part

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.screen_facets import ScreenFacets, pixel_centres
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.screen_shape import CoverGlass, ScreenShape


def test_a_flat_screen_has_one_plane():
    chief = ChiefRays(real_setup("flat"))
    facets = ScreenFacets.of(chief)
    assert facets.is_flat and facets.axes is chief.screen_frame.axes
    assert facets.half_diagonal == pytest.approx(np.hypot(0.9, 0.85) / 2, rel=1e-15)
    np.testing.assert_array_equal(facets.points, chief.screen_frame.to_world(*pixel_centres(chief)))
    assert facets.sees(np.zeros((1, 3))) and not facets.sees(np.array([[75.0, 130.0, 1600.0]]))


@pytest.mark.parametrize("shape", ["sag", "points"])
def test_facets_touch_the_screen(shape):
    """Axes of unit length at right angles; neighbours' centres lie in the plane, but for the bend: differences."""
    chief = ChiefRays(real_setup(shape, glass=False))
    facets = ScreenFacets.of(chief)
    np.testing.assert_allclose(
        np.einsum("nak,nbk->nab", facets.axes, facets.axes), np.broadcast_to(np.eye(3), facets.axes.shape), atol=1e-14
    )
    columns, rows = chief.scene.screen.pixels
    points = facets.points.reshape(rows, columns, 3)
    along_u = (points[1:-1, 2:] - points[1:-1, :-2]) / 2
    along_v = (points[2:, 1:-1] - points[:-2, 1:-1]) / 2
    normal = facets.axes[:, 2].reshape(rows, columns, 3)[1:-1, 1:-1]
    across = np.cross(along_u, along_v)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    np.testing.assert_allclose(across, normal, atol=2e-3)  # third derivatives over a pixel
    sides = [side.reshape(rows, columns, 3)[1:-1, 1:-1] for side in (facets.side_u, facets.side_v)]
    np.testing.assert_allclose(sides, [along_u, along_v], atol=2e-3)
    assert (normal @ chief.screen_frame.axes[2] > 0.9).all()  # away from the mirror
    np.testing.assert_allclose(np.cross(facets.axes[:, 0], facets.axes[:, 1]), facets.axes[:, 2], atol=1e-14)
    x = np.sum(facets.axes[:, 0] * facets.side_u, -1)
    np.testing.assert_allclose(x, np.linalg.norm(facets.side_u, axis=-1), rtol=1e-14)


def test_a_plate_on_a_sphere_shows_a_smaller_or_larger_sphere():
    """At right angles, pixels under a plate seem to lie t (1 - 1/n) nearer: edges scale as concentric spheres do."""
    radius, thickness, index = 400.0, 4.0, 1.5
    half = 0.2 * 21 / 2
    for sign in (1, -1):
        shape = ScreenShape(sag_mm=tuple((i, j, sign * half**2 / (2 * radius)) for i, j in ((2, 0), (0, 2))))
        scene = with_part(load_scene("sphere"), "screen", shape=shape, cover_glass=CoverGlass(thickness, index))
        chief = ChiefRays(scene)
        facets = ScreenFacets.of(chief)
        middle = len(facets.u) // 2
        seen = facets.seen_sides(-facets.axes[:, 2])
        raised = thickness * (1 - 1 / index)
        # the sag grows away from the mirror with sign 1: the screen's hollow side is then its back
        expected = 0.2 * (1 + sign * raised / radius)
        for side, own in zip(seen, (facets.side_u, facets.side_v), strict=True):
            assert side[middle] @ own[middle] / 0.2 == pytest.approx(expected, rel=2e-5)  # (raised / radius)^2


def test_directions_are_those_outside_the_glass():
    """A ray from a pixel's image towards a point lights the pixel when it comes back."""
    chief = ChiefRays(real_setup("sag"))
    facets, points = ScreenFacets.of(chief), np.array([[0.0, 0.0, 0.0], [100.0, 50.0, 3.0]])
    pixel = np.array([3, 200, 390])
    rays = facets.from_pixels(points, pixel)
    for k, point in enumerate(points):
        u, v = chief.screen_model.arrive(np.broadcast_to(point, (3, 3)), -rays[:, k])
        np.testing.assert_allclose([u, v], [facets.u[pixel], facets.v[pixel]], atol=1e-9)
    cosines = facets.cosines(rays, pixel)
    depth = np.sum(rays * facets.axes[pixel, None, 2], -1) / np.linalg.norm(rays, axis=-1)
    np.testing.assert_allclose(np.sum(cosines**2, -1) + depth**2, 1.0, rtol=1e-14)
