"""Where a pixel's light comes from, against rays, and what lines make of the light's moves."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import coarse, scene_of, with_part

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.light_profiles import sampled_centroids
from irtscots_cl.measurement.transfer_geometry import TransferGeometry, whole_pixels
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.setup import Setup
from irtscots_cl.tracing.estimators.analytic import trace_analytic


@pytest.fixture(scope="module", params=["sphere", "lopsided"])
def setup(request) -> Setup:
    return Setup(with_part(scene_of(request.param).nominal(), "camera", focus_distance_mm=900.0))


def test_edges_and_blur_are_those_of_rays(setup):
    number = np.flatnonzero(whole_pixels(setup))[::501]
    found = TransferGeometry.of(setup, number)
    row, column = np.divmod(number, setup.chief_rays.shape[1])
    radius = setup.scene.camera.aperture_diameter_mm / 2

    def mirror(dr=0.0, dc=0.0, a=0.0, b=0.0):
        return setup.chief_rays.reverse(row + dr, column + dc, a * radius, b * radius)[0][..., :2]

    along = np.stack([mirror(dc=0.5) - mirror(dc=-0.5), mirror(dr=0.5) - mirror(dr=-0.5)], 1)
    blur = np.stack([mirror(a=1) - mirror(a=-1), mirror(b=1) - mirror(b=-1)], 1) / 2
    np.testing.assert_allclose(found.pixel, along, atol=1e-3 * np.abs(along).max())
    np.testing.assert_allclose(found.aperture, blur, atol=1e-3 * np.abs(blur).max())
    np.testing.assert_allclose(np.stack([found.x_mm, found.y_mm], -1), mirror(), atol=1e-3 * np.abs(along).max())


def test_slopes_by_places_are_those_of_a_tilted_mirror(setup):
    """The law of reflection at a point, the normal tilted by a microradian: the place moves by the inverse."""
    number = np.flatnonzero(whole_pixels(setup))[::907]
    found = TransferGeometry.of(setup, number)
    row, column = np.divmod(number, setup.chief_rays.shape[1])
    point, u, v = setup.chief_rays.reverse(row, column)
    camera = setup.chief_rays.camera_frame.position_mm
    slopes = np.stack(setup.chief_rays.surface.gradient(point[..., 0], point[..., 1]), -1)
    incoming = point - camera
    moved = []
    for tilt in ((1e-6, 0.0), (0.0, 1e-6)):
        normal = np.concatenate([-(slopes + tilt), np.ones((len(slopes), 1))], -1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        out = incoming - 2 * np.sum(incoming * normal, -1, keepdims=True) * normal
        there = setup.chief_rays.screen_model.arrive(point, out)
        moved.append(np.stack([there[0] - u, there[1] - v], -1) / 1e-6)
    np.testing.assert_allclose(found.slopes @ np.stack(moved, -1), np.broadcast_to(np.eye(2), (len(number), 2, 2)),
                               atol=2e-3)  # fmt: skip


def test_a_turn_is_undone(setup):
    found = TransferGeometry.of(setup, np.flatnonzero(whole_pixels(setup))[::800])
    k = np.array([[0.01, 0.02], [-0.03, 0.005]])
    np.testing.assert_allclose(found.waves(found.turns(k)), np.broadcast_to(k, (len(found.number), 2, 2)), atol=1e-12)


def test_line_gain_is_how_light_curves_follow_a_tilt():
    """A mirror tilted by a microradian moves the plain centroids by the gain times the light's own move."""
    scene = coarse("sphere", 21).nominal()
    setup = Setup(scene)
    number = np.flatnonzero(whole_pixels(setup))[::17]
    moved = with_part(scene, "screen", centre_offset_mm=(0.002, 0.0))  # the grid the other way, the light the same
    centroids = [
        sampled_centroids(trace_analytic(Setup(one)).images(LineScan(one)).x, Setup(one).pixel_light)
        for one in (scene, moved)
    ]
    gain = TransferGeometry.of(setup, number).line_gain[:, 0]
    pixels = trace_analytic(setup).images(LineScan(scene)).x.pixels
    at = np.searchsorted(pixels, number)
    # the lines move by 2 um: a centroid that followed the light alone would stay where it is
    np.testing.assert_allclose(1 - (centroids[1] - centroids[0])[at] / 0.002, gain, atol=3e-3)
    assert np.ptp(gain) > 0.003 or np.abs(gain - 1).max() > 0.003


def test_pixels_on_the_rim_are_none():
    setup = Setup(coarse("sphere", 21).nominal())
    whole = whole_pixels(setup)
    coverage = ChiefRays(setup.scene).footprint.coverage
    assert whole.sum() < (coverage > 0).sum() and coverage[whole].min() == 1.0
