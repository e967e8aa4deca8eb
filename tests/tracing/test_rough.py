"""Light that rough surfaces scatter, in watts: by the incidence and by the media, beside closed forms.

Sums of the same rays with and without roughness: they differ by the share that scatters, not by noise.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from path_scenes import light_of, path_of, wide
from scenes import coarse_screen

from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Harvey

SIGMA_NM, WAVELENGTH_NM = 5.0, 632.8
ROUGH = Harvey(0.01, -1.5, roughness_nm=SIGMA_NM, wavelength_nm=WAVELENGTH_NM)
SMOOTH = Harvey(0.01, -1.5, tis=1e-9)
ROUNDING = 3e-6  # of weights in steps of 2^-22, over sums of many


def scattered(step):
    """Share of the light at a change `step` of n cos(theta)."""
    return 1 - math.exp(-((2 * math.pi * SIGMA_NM * step / WAVELENGTH_NM) ** 2))


def kept(scene, rough, device, name):
    """Share of the path's specular light that a rough surface leaves."""
    smooth, light = (light_of(s, device, rays_per_pixel=2**11, branches="random", least_chance=0.0, seed=9)
                     for s in (scene, rough))  # fmt: skip
    return path_of(light, name).flux_w / path_of(smooth, name).flux_w


def refracting(rough):
    """The preset's window, whose front, towards the mirror, is rough; all light of the mirror is taken.

    Or so smooth that what it scatters is less than rounding: it scatters all the same, so that the rays are the same.
    """
    scene = wide(load_scene("sphere-window"))
    return replace(scene, element=tuple(
        replace(element, scatter=(ROUGH if rough else SMOOTH) if element.name == "window.front" else None)
        for element in scene.element))  # fmt: skip


def test_a_rough_window_scatters_by_the_difference_of_the_indices(device):
    """The front lies between glass and air: (n cos t - cos t') of rays within 7 degrees, so n - 1 but for 0.5 %."""
    name = "screen > window.back > window.front > mirror > lens > detector"
    share = kept(refracting(False), refracting(True), device, name)
    assert 1 - share == pytest.approx(scattered(0.52), rel=0.01, abs=0)  # cosines up to 7 degrees, in the mean 0.3 %
    assert 1 - share < 0.1 * scattered(2.0)  # a mirror's would be fifteen times as much


def normal_and_oblique(degrees):
    """A small plane mirror, 4 m from screen and camera, at that angle of incidence; all its light is taken."""
    base = load_scene("sphere")
    turn = math.radians(degrees)
    x, z = 4000.0 * math.sin(turn), 4000.0 * math.cos(turn)
    return replace(
        base,
        mirror=replace(base.mirror, radius_mm=1e12, diameter_mm=20.0),
        screen=replace(base.screen, position_mm=(x, 0.0, z)),
        camera=replace(base.camera, position_mm=(-x, 0.0, z), aperture_diameter_mm=200.0,
                       detector=replace(base.camera.detector, pitch_mm=0.2)),
    )  # fmt: skip


@pytest.mark.parametrize("degrees", [10, 60, 80])
def test_a_rough_mirrors_specular_light_falls_by_the_cosines_square(device, degrees):
    scene = coarse_screen(normal_and_oblique(degrees))
    rough = replace(scene, mirror=replace(scene.mirror, scatter=ROUGH))
    share = kept(scene, rough, device, "screen > mirror > lens > detector")
    assert 1 - share == pytest.approx(scattered(2 * math.cos(math.radians(degrees))), rel=0.02, abs=ROUNDING)
    at_normal = scattered(2.0)
    if degrees == 60:
        assert (1 - share) / at_normal == pytest.approx(0.25, rel=0.03, abs=0)


@pytest.mark.second_device
def test_all_light_of_a_rough_mirror_ends_somewhere(device):
    """What scatters is what the specular light lost, in the mean over directions: the lobe is scaled to it."""
    scene = coarse_screen(normal_and_oblique(60))
    rough = replace(scene, mirror=replace(scene.mirror, scatter=replace(ROUGH, roughness_nm=60.0)))
    light = light_of(rough, device, rays_per_pixel=2**14, branches="random", aimed_scatter=False, seed=9)
    ended = [*light.paths, *light.losses]
    left = sum(part.flux_w for part in ended) - light.launched_w
    error = math.sqrt(sum(part.standard_error_w**2 for part in ended))
    share = 1 - math.exp(-((2 * math.pi * 60.0 / WAVELENGTH_NM) ** 2))
    assert share > 0.25
    assert abs(left) < 7 * error + 1e-6 * light.launched_w
    assert 7 * error < 0.05 * share * light.launched_w
