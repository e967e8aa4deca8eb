"""Aims of the forward estimator: what is aimed at the camera brings the same light as what is aimed at the mirror."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import scene_of as preset_or_lopsided
from scenes import with_part
from significance import poisson_ratio_p, sidak_p
from tracers import setup_of

from irtscots_cl.optics.aim import Aim
from irtscots_cl.optics.screen_facets import ScreenFacets
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.packing.sources import emitters
from irtscots_cl.tracing.trace import trace

FAILURE_CHANCE = 1e-6  # of all statistical tests of this file together
NAMES = ("sphere", "sphere-deviated", "off-axis", "lopsided", "holed", "real")


def scene_of(name):
    if name == "holed":
        return with_part(load_scene("sphere"), "mirror", obscuration_mm=300.0)
    return preset_or_lopsided(name)


def light_into_camera(scene, rays, seed):
    """Screen pixels [k] and directions [k, 2] of rays from all over the detector and the aperture, by the oracle of
    the chief-ray calibration with other random numbers than the aim's own check."""
    random, chief = np.random.default_rng(seed), setup_of(scene).chief_rays
    rows, columns = chief.shape
    angle, radius = random.random(rays) * 2 * np.pi, np.sqrt(random.random(rays)) / 2
    a, b = (scene.camera.aperture_diameter_mm * radius * f(angle) for f in (np.cos, np.sin))
    points, u, v = chief.reverse(
        random.uniform(-0.5, rows - 0.5, rays), random.uniform(-0.5, columns - 0.5, rays), a, b
    )
    screen, facets = scene.screen, ScreenFacets.of(chief)
    column, row = (
        np.floor((w - offset) / pitch + n / 2)
        for w, offset, n, pitch in zip((u, v), screen.centre_offset_mm, screen.pixels, screen.pitch_xy_mm, strict=True)
    )
    use = chief.surface.contains(points[:, 0], points[:, 1])
    use &= (column >= 0) & (column < screen.pixels[0]) & (row >= 0) & (row < screen.pixels[1])
    pixel = (row * screen.pixels[0] + column)[use].astype(int)
    way = points[use] - chief.screen_model.seen_from(points[use], u[use], v[use])
    axes = facets.axes[None, :2] if facets.is_flat else facets.axes[pixel, :2]
    return pixel, np.sum(axes * way[:, None], -1) / np.linalg.norm(way, axis=-1, keepdims=True)


@pytest.mark.parametrize("name", NAMES)
def test_both_aims_hold_all_light_that_reaches_the_camera(name):
    scene = scene_of(name)
    pixel, cosines = light_into_camera(scene, 2**17, 5)
    assert len(pixel) > 2**13
    aim = setup_of(scene).camera_aim
    assert aim.holds(pixel, cosines).all() and setup_of(scene).mirror_aim.holds(pixel, cosines).all()
    # the same rays tell of an aim that is too small
    assert not Aim(aim.centre, aim.root * 0.5, aim.share).holds(pixel, cosines).all()


@pytest.mark.parametrize(
    ("name", "most"), [("sphere", 0.30), ("sphere-deviated", 0.35), ("off-axis", 0.13), ("holed", 0.50)]
)
def test_the_camera_sees_little_of_the_mirror_lit_by_one_pixel(name, most):
    scene = scene_of(name)
    aim, whole = setup_of(scene).camera_aim, setup_of(scene).mirror_aim
    assert aim.share < most
    np.testing.assert_allclose(aim.area, aim.share * whole.area, rtol=1e-12)  # rounding
    assert whole.share == 1.0


@pytest.mark.slow
def test_an_aperture_that_takes_all_light_is_aimed_at_with_the_whole_mirror():
    scene = load_scene("sphere")
    wide = replace(scene, camera=replace(scene.camera, aperture_diameter_mm=8.0))
    assert setup_of(wide).camera_aim is setup_of(wide).mirror_aim


def test_overfill_scales_the_area_of_either_aim():
    setup = setup_of(load_scene("sphere"))
    for aim in ("mirror", "camera"):
        once, area = emitters(setup, "fp32", 1.0, aim)
        twice, larger = emitters(setup, "fp32", 2.0, aim)
        np.testing.assert_allclose(larger, 2 * area, rtol=1e-12)  # rounding
        np.testing.assert_allclose(twice["aim_ll"], np.sqrt(2) * once["aim_ll"], rtol=1e-6)  # float32's
        np.testing.assert_array_equal(twice["centre_l"], once["centre_l"])


@pytest.mark.parametrize("name", NAMES)
def test_both_aims_bring_the_same_light(device, name):
    """Counts of every bin, given their sum, are binomial with the share of the rays that each aim's pixel spends."""
    scene, rays = scene_of(name), {"off-axis": 4096}.get(name, 2**17)
    whole = trace(scene, device=device, estimator="forward", rays_per_pixel=rays, replicates=1, seed=3)
    aimed = trace(scene, device=device, estimator="forward", aim="camera", rays_per_pixel=rays, replicates=1, seed=4)
    share = setup_of(scene).camera_aim.share
    np.testing.assert_allclose(aimed.unit_w, share * whole.unit_w, rtol=1e-12)  # rounding
    first, second = (run.counts[0].ravel().astype(np.int64) for run in (whole, aimed))
    lit = first + second > 0
    p = poisson_ratio_p(first[lit], second[lit], share / (1 + share))
    p = np.append(p, poisson_ratio_p(first.sum(), second.sum(), share / (1 + share)))
    assert p.min() > sidak_p(len(p), FAILURE_CHANCE / len(NAMES))
    assert aimed.ledger["clipped"] < whole.ledger["clipped"] or share == 1.0  # the point of it
