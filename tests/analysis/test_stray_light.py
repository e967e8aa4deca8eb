"""Scattered light and ghosts: a quadrature of scattered light, chance and precision, heights; and who sees them.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracle import sequence
from scipy import stats
from significance import sidak_z

from irtscots_cl.analysis.stray_light import stray_light
from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.optics.elements.media import check_media
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import ABg, Harvey, Lambertian
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.tracing.trace import trace, trace_paths

FAILURE_CHANCE = 1e-6
STATEMENTS = 64  # at most
Z = sidak_z(STATEMENTS, FAILURE_CHANCE)  # of each: 5.6
REPLICATES = 64  # where an error comes from their scatter
T = float(stats.t.isf(stats.norm.sf(Z), REPLICATES - 1))  # the same chance with such an error: 6.6


def direct_of(light):
    (path,) = (path for path in light.paths if path.kind == "direct")
    return path


def counting_error_w(path):
    """Standard error of the flux of rays that weigh nearly the same."""
    return path.flux_w / math.sqrt(path.rays)


# --- scattered light ----------------------------------------------------------------------------------------

SCATTER = {
    "harvey": Harvey(l=0.01, s=-1.5, tis=0.0025),
    "abg": ABg(a=1e-4, b=1e-3, g=1.5),
    "lambertian": Lambertian(tis=0.01),
}


def scattering(model):
    """The camera is turned, so that the cosine at its aperture counts; its detector sees the whole mirror."""
    scene = load_scene("sphere")
    camera = replace(scene.camera, look_at_mm=(1300.0, 0.0, 0.0), focus_distance_mm=4166.0,
                     detector=replace(scene.camera.detector, pitch_mm=0.2))  # fmt: skip
    return replace(scene, camera=camera, mirror=replace(scene.mirror, reflectance=0.9, scatter=model))


def scattered_flux_w(scene):
    """L cos cos' BSDF(d) cos'' A cos''' / (r1^2 r2^2) over the mirror's area, from every screen pixel's centre.

    Gauss's rule in the square of the radius, equal steps in angle; the mirror is a sphere.
    """
    screen, camera, mirror = scene.screen, scene.camera, scene.mirror
    node, weight = np.polynomial.legendre.leggauss(24)
    square = (mirror.diameter_mm / 2) ** 2
    r, angle = np.meshgrid(np.sqrt((node + 1) / 2 * square), 2 * np.pi * (np.arange(48) + 0.5) / 48, indexing="ij")
    height = mirror.radius_mm - np.sqrt(mirror.radius_mm**2 - r * r)
    points = np.stack([r * np.cos(angle), r * np.sin(angle), height], -1).reshape(-1, 3)
    normal = (np.array([0.0, 0.0, mirror.radius_mm]) - points) / mirror.radius_mm
    area = np.repeat(weight / 2 * square * np.pi / 48, 48) / normal[:, 2]
    out = np.array(camera.position_mm) - points
    r2 = np.linalg.norm(out, axis=-1)
    out /= r2[:, None]
    leaving = np.sum(out * normal, -1) * (out @ sequence.axes_of(camera)[2])
    leaving *= np.pi / 4 * camera.aperture_diameter_mm**2 / r2**2
    x, y, z = sequence.axes_of(screen)
    total = 0.0
    for u in (np.arange(screen.pixels[0]) - (screen.pixels[0] - 1) / 2) * screen.pitch_mm:
        for v in (np.arange(screen.pixels[1]) - (screen.pixels[1] - 1) / 2) * screen.pitch_mm:
            way = points - (np.array(screen.position_mm) + u * x + v * y)
            r1 = np.linalg.norm(way, axis=-1)
            way /= r1[:, None]
            cosine = -np.sum(way * normal, -1)
            off = out - (way + 2 * cosine[:, None] * normal)
            off -= np.sum(off * normal, -1, keepdims=True) * normal
            arriving = cosine * -(way @ z) / r1**2
            total += np.sum(arriving * scene.mirror.scatter.bsdf(np.linalg.norm(off, axis=-1)) * leaving * area)
    return screen.radiance * screen.pitch_mm**2 * mirror.reflectance * camera.transmittance * total


@pytest.mark.parametrize(
    "name, rays, error",
    [
        ("harvey", 2**10, 0.03),
        pytest.param("abg", 2**10, 0.03, marks=pytest.mark.slow),
        *(pytest.param(name, 2**13, 0.01, marks=pytest.mark.long) for name in SCATTER),
    ],
)
def test_scattered_flux_is_that_of_a_quadrature(device, name, rays, error):
    """The specular light falls by the total scatter: of the same rays, so but for rounding."""
    scene, options = scattering(SCATTER[name]), {"rays_per_pixel": rays, "replicates": REPLICATES, "seed": 61}
    light = trace_paths(scene, device=device, **options)
    bare = trace_paths(scattering(None), device=device, **options)
    (path,) = (path for path in light.paths if path.name == "screen > mirror (s) > lens > detector")
    expected = scattered_flux_w(scene)
    assert path.rays > 12 * rays and path.standard_error_w < error * expected
    # 0.1 %: pixels and the aperture are taken at their centres
    assert abs(path.flux_w - expected) < T * path.standard_error_w + 1e-3 * expected
    kept = direct_of(light).flux_w / direct_of(bare).flux_w
    assert kept == pytest.approx(1 - float(SCATTER[name].tis_at()), rel=2e-6, abs=0)  # weights are of 2^-22


# --- chance and precision ----------------------------------------------------------------------------------


def singlet(device, **options):
    settings = {"rays_per_pixel": 2**12, "seed": 71, **options}
    return trace_paths(load_scene("sphere-singlet"), device=device, **settings)


@cache
def ghosts(device, precision="fp32", least_chance=0.1, seed=81):
    settings = {"rays_per_pixel": 2**14, "precision": precision, "least_chance": least_chance, "seed": seed}
    return singlet(device, **settings)


def assert_same_flux(first, second):
    """Direct light and the first ghost, by path."""
    named = {path.name: path for path in second.paths}
    for path in first.paths[:2]:
        other = named[path.name]
        error = math.hypot(counting_error_w(path), counting_error_w(other))
        assert abs(path.flux_w - other.flux_w) < Z * error, path.name
    assert [path.kind for path in first.paths[:2]] == ["direct", "ghost"]


@pytest.mark.parametrize("least_chance", [0.0, 0.5])
def test_the_chance_of_a_reflection_does_not_change_the_flux(device, least_chance):
    assert_same_flux(ghosts(device), ghosts(device, least_chance=least_chance, seed=82))


def test_both_precisions_agree(device):
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    assert_same_flux(ghosts(device), ghosts(device, precision="fp64", seed=83))


@pytest.mark.parametrize("estimator", ["forward", "adjoint", "analytic"])
@pytest.mark.parametrize("what", ["element", "camera.lens", "mirror.scatter"])
def test_other_estimators_refuse_what_they_do_not_see(device, estimator, what):
    singlet_scene = load_scene("sphere-singlet")
    scene = {
        "element": singlet_scene,
        "camera.lens": replace(singlet_scene, element=()),
        "mirror.scatter": scattering(SCATTER["harvey"]),
    }[what]
    with pytest.raises(ValueError, match=f"^scene [^\n]*{what}[^\n]*{estimator}[^\n]*$"):
        trace(scene, device=device, estimator=estimator, rays_per_pixel=64)


def test_the_singlets_ghost_adds_a_height_of_some_22_nm(device):
    """From both seeds, which agree within their errors."""
    found = [stray_light(ghosts(device, seed=seed))[0] for seed in (81, 84)]
    heights = [ghost.height_nm for ghost in found]
    assert [ghost.kind for ghost in found] == ["ghost", "ghost"]
    for height in heights:
        assert height.value == pytest.approx(22, rel=0.25, abs=0)  # ray noise of the run adds a few nm
    assert abs(heights[0].value - heights[1].value) < 2 * Z * math.hypot(*(h.standard_error for h in heights))


# --- light that meets an element twice ----------------------------------------------------------------------


def windowed(diameter_mm, reflectance=0.0):
    """A sphere behind a window that takes part of its light, or all of it; its light crosses it going and coming."""
    scene = load_scene("sphere")
    faces = tuple(
        Element(name, "refractor", (0.0, 0.0, z), (0.0, 0.0, 4000.0), diameter_mm=diameter_mm, index_front=front,
                index_back=back, reflectance=reflectance)
        for name, z, front, back in (("front", 110.0, 1.0, 1.5), ("back", 100.0, 1.5, 1.0))
    )  # fmt: skip
    screen = replace(scene.screen, pixels=(11, 11), pitch_mm=0.4)
    detector = replace(scene.camera.detector, pixels=(31, 31), pitch_mm=0.149)
    return replace(scene, element=faces, screen=screen, camera=replace(scene.camera, detector=detector))


@pytest.mark.parametrize("diameter_mm", [500.0, 1200.0])
def test_a_window_that_reflects_nothing_makes_no_ghost(device, diameter_mm):
    """Part of the mirror and all of it: every path is direct, nothing is added to the height, no pixel is lost."""
    light = trace_paths(windowed(diameter_mm), device=device, rays_per_pixel=2**15, seed=3)
    twice = "screen > front > back > mirror > back > front > lens > detector"
    found = {path.name: path for path in light.paths if path.rays}
    assert twice in found and found[twice].kind == "direct"
    assert {path.kind for path in found.values()} == {"direct"}
    assert not light.images_w[:, 1:].any()
    assert stray_light(light) == ()
    if diameter_mm > 1100:
        assert set(found) == {twice}


def test_a_window_over_the_mirror_that_reflects_makes_ghosts(device):
    """Between its faces; measured against the light that crosses it twice."""
    light = trace_paths(windowed(1200.0, 0.04), device=device, rays_per_pixel=2**15, seed=3)
    (ghost,) = stray_light(light)
    assert ghost.kind == "ghost" and 1e-4 < ghost.of_direct < 0.1
    assert math.isfinite(ghost.height_nm.value)


# --- scenes that cannot be ---------------------------------------------------------------------------------


def with_element(name, number, **changes):
    scene = load_scene(name)
    elements = list(scene.element)
    elements[number] = replace(elements[number], **changes)
    return replace(scene, element=tuple(elements))


@pytest.mark.parametrize("name", ["sphere-singlet", "sphere-doublet", "sphere-window", "ghosts", "baffled"])
def test_the_media_of_the_presets_fit(name):
    check_media(load_scene(name), components_of(load_scene(name)))


def test_media_that_overlap_are_refused_by_name(device):
    scene = with_element("sphere-doublet", 1, index_front=1.6)
    with pytest.raises(SceneError) as caught:
        trace_paths(scene, device=device, rays_per_pixel=64)
    assert str(caught.value) == (
        "scene sphere-doublet: element[0].index_back = 1.5168: lens.front faces lens.cement there; must be 1.6, "
        "or media overlap"
    )
    open_end = replace(scene, element=load_scene("sphere-doublet").element[:2])
    with pytest.raises(SceneError, match=r"element\[1\].index_back = 1.6727: lens.cement faces nothing, so air there"):
        check_media(open_end, components_of(open_end))


def test_a_detector_that_no_path_reaches_is_refused(device):
    plate = Element("plate", "absorber", (-200.0, 0.0, 4000.0), (0.0, 0.0, 0.0), size_mm=(300.0, 300.0))
    scene = replace(load_scene("sphere"), element=(plate,))
    with pytest.raises(SceneError, match="scene sphere: detector: no path from the screen reaches it; must be"):
        trace_paths(scene, device=device, rays_per_pixel=64)
