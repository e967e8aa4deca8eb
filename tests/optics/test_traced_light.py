"""Light by quadrature: against the closed form where that holds, and against plain rays where it does not."""

from __future__ import annotations

import dataclasses
from functools import lru_cache

import numpy as np
import pytest
from scenes import coarse, scene_of, with_part

from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.pixel.response import PixelResponse
from irtscots_cl.optics.pixel.traced_light import TracedLight
from irtscots_cl.optics.setup import Setup


@lru_cache
def setup_of(name: str) -> Setup:
    return Setup(SCENES[name]())


def fast():
    """A sphere of f/1 (radius 2 diameters) through an aperture of 10 mm: the light of a pixel is a comet."""
    scene = coarse("sphere-deviated", 25)
    mirror = dataclasses.replace(scene.mirror, radius_mm=1000.0, diameter_mm=500.0,
                                 zernike=(dataclasses.replace(scene.mirror.zernike[0], radius_mm=250.0),))  # fmt: skip
    camera = dataclasses.replace(scene.camera, position_mm=(-60.0, 0.0, 998.0), aperture_diameter_mm=10.0,
                                 detector=dataclasses.replace(scene.camera.detector, pitch_mm=0.36))  # fmt: skip
    screen = dataclasses.replace(scene.screen, position_mm=(60.0, 0.0, 998.0), pitch_mm=2.0, pixels=(61, 61))
    return dataclasses.replace(scene, name="fast", mirror=mirror, camera=camera, screen=screen)


SCENES = {
    "sphere": lambda: coarse("sphere-deviated", 25),
    "off-axis": lambda: coarse("off-axis", 125),
    "lopsided": lambda: scene_of("lopsided"),  # out of focus, off centre, with a hole
    "defocus": lambda: with_part(scene_of("sphere-deviated"), "camera", focus_distance_mm=3000.0),
    "fast": fast,
}


def some(setup: Setup, count: int, least: float = 0.3) -> np.ndarray:
    """Pixels that see the mirror, evenly, with at least this part of their footprint on it."""
    found = np.flatnonzero(setup.chief_rays.footprint.coverage >= least)
    return found[np.linspace(0, len(found) - 1, count).astype(int)]


def rays(setup: Setup, pixels: np.ndarray, count: int = 40000):
    """Landing points, mirror points [n, count] and weights of plain random rays, cos^4 and the rim included."""
    chief, camera = setup.chief_rays, setup.scene.camera
    random = np.random.default_rng(7)
    s, t, r, angle = random.random((4, len(pixels), count))
    radius, angle = camera.aperture_diameter_mm / 2 * np.sqrt(r), 2 * np.pi * angle
    row, column = (v[:, None] for v in np.divmod(pixels, chief.shape[1]))
    a, b = radius * np.cos(angle), radius * np.sin(angle)
    points, u, v = chief.reverse(row + t - 0.5, column + s - 0.5, a, b)
    image = chief.camera_model.image_point(row + t - 0.5, column + s - 0.5)
    slopes = [p / camera.focus_mm - q / camera.image_distance_mm for p, q in zip((a, b), image, strict=True)]
    weight = chief.surface.contains(points[..., 0], points[..., 1]) / (1 + slopes[0] ** 2 + slopes[1] ** 2) ** 2
    return np.stack([u, v, points[..., 0], points[..., 1]]), weight


@pytest.mark.parametrize("name", ["lopsided", "defocus", "fast"])
def test_means_and_light_are_those_of_plain_rays(name):
    setup = setup_of(name)
    pixels = some(setup, 12)
    light = TracedLight.of(setup.chief_rays, pixels)
    assert light.valid().all()
    values, weight = rays(setup, pixels)
    total = weight.sum(1)
    mean = (values * weight).sum(2) / total
    spread = np.sqrt((weight * (values - mean[..., None]) ** 2).sum(2) / total)
    sigma = spread * np.sqrt((weight**2).sum(1)) / total
    # five sigma of 48 means, chance 3e-5; and 3e-3 of the light's width, cells on the rim
    assert (np.abs(light.means("uvxy") - mean) < 5 * sigma + 3e-3 * spread).all()
    np.testing.assert_allclose(light.coverage(), (weight > 0).mean(1), atol=0.012)  # 4 sigma of 40000 rays
    for k, output in enumerate("uv"):
        edges = mean[k][:, None] + spread[k][:, None] * np.linspace(-3, 3, 13)
        share = light.light(output, edges)
        counted = np.stack([np.histogram(v, e, weights=w)[0] for v, e, w in zip(values[k], edges, weight, strict=True)])
        limit = 5 * np.sqrt(counted.clip(1)) / weight.shape[1] + 2e-3  # 5 sigma of 156 counts, chance 1e-4
        assert (np.abs(share - counted / weight.shape[1]) < limit).all()


@pytest.mark.parametrize("name", ["sphere", "off-axis"])
def test_it_agrees_with_the_closed_form_where_that_holds(name):
    setup = setup_of(name)
    pixels = some(setup, 60, 0.5)
    closed, traced = PixelResponse.of(setup.chief_rays, pixels), TracedLight.of(setup.chief_rays, pixels)
    assert closed.valid().all() and traced.valid().all()
    whole = closed.coverage() > 1 - 1e-9
    apart = np.abs(traced.means("uv") - closed.means("uv"))
    assert whole.sum() > 30 and (~whole).any()
    assert apart[:, whole].max() < 1e-5  # mm: 1 nrad
    assert apart[:, ~whole].max() < 1e-3  # mm: cells of a twelfth of a pixel on the rim
    pitch = setup.scene.screen.pitch_mm
    for output in "uv":
        edges = closed.means(output)[0][:, None] + pitch * np.arange(-12.4, 13)
        lines = (edges[:, 1:] + edges[:, :-1]) / 2
        flux = [part.light(output, edges) for part in (closed, traced)]
        sampled = [(of_line * lines).sum(1) / of_line.sum(1) for of_line in flux]
        assert np.abs(sampled[0] - sampled[1])[whole].max() < 1e-3  # mm: 0.005 lines, 0.1 urad


def test_light_beside_the_mirror_or_in_its_hole_is_none():
    setup = setup_of("lopsided")
    chief = setup.chief_rays
    points, _, _ = chief.reverse(*np.meshgrid(np.arange(61), np.arange(90), indexing="ij"))
    centre = np.hypot(points[..., 0], points[..., 1])
    hole = int(np.argmin(centre))
    far = np.flatnonzero((centre > 1.2 * chief.surface.aperture_radius_mm).ravel())[:1]
    light = TracedLight.of(chief, np.concatenate([[hole], far]))
    assert (light.coverage() == 0).all() and np.isnan(light.means("uvxy")).all()
    assert (light.light("u", np.linspace(-50, 50, 11)[None].repeat(2, 0)) == 0).all()


def test_both_kinds_are_put_together_pixel_by_pixel():
    setup = setup_of("sphere")
    pixels = some(setup, 30, 0.5)
    own = PixelResponse.of(setup.chief_rays, pixels)
    residual = own.maps.residual.copy()
    residual[:, ::3] = 1.0  # mm: far beyond the closed form's limit
    light = PixelLight.around(PixelResponse(own.chief, pixels, dataclasses.replace(own.maps, residual=residual)))
    np.testing.assert_array_equal(light.closed_form, np.arange(30) % 3 != 0)
    assert light.valid().all()
    np.testing.assert_array_equal(light.means("uv")[:, light.closed_form], own.means("uv")[:, light.closed_form])
    np.testing.assert_allclose(light.means("uv"), own.means("uv"), rtol=0, atol=1e-3)
    edges = own.means("u")[0][:, None] + 0.2 * np.arange(-6, 7)
    np.testing.assert_allclose(light.light("u", edges), own.light("u", edges), rtol=0, atol=2e-3)
    for found, wanted in zip(light.extent("u"), own.extent("u"), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=0.03)  # mm: the closed form adds 1 % of the aperture
    np.testing.assert_allclose(light.coverage(), own.coverage(), rtol=0, atol=2e-3)


def test_all_in_closed_form_is_the_closed_form_itself():
    setup = setup_of("sphere")
    ((index, part),) = setup.pixel_light.parts
    if setup.pixel_response.valid().all():
        assert part is setup.pixel_response and len(index) == len(setup.pixel_light.pixels)
