"""Light that stays, absorbed, escaped or given up, in watts: beside closed forms and beside what leaves the screen.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from path_scenes import light_of, wide
from scipy import stats
from significance import sidak_z

from irtscots_cl.scene.element import Element
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Harvey, Lambertian
from irtscots_cl.tracing.results.paths import NOT_TRACED

FAILURE_CHANCE = 1e-6
STATEMENTS = 32  # at most
REPLICATES = 32
T = float(stats.t.isf(stats.norm.sf(sidak_z(STATEMENTS, FAILURE_CHANCE)), REPLICATES - 1))  # of each: 7.3
STEP = 2.0**-20  # of a ray's weight: staying light is counted in these


def traced_w(light):
    """Flux of all rays."""
    return light.launched_w - sum(loss.flux_w for loss in light.losses if loss.name == NOT_TRACED)


def staying_of(light):
    return {stay.name: stay for stay in light.losses}


def balance(light):
    """Light that paths and staying light leave out of what was launched, over what was traced, and its standard error.

    Errors of the parts add up to at least that of their sum.
    """
    components = [*light.paths, *light.losses]
    left = sum(component.flux_w for component in components) - light.launched_w
    return left / traced_w(light), sum(component.standard_error_w for component in components) / traced_w(light)


def wall(**values):
    """A plate before the screen, in a part of its light; what it scatters goes back beside the camera."""
    x, y, z = (0.9 * np.array(load_scene("sphere").screen.position_mm)).tolist()
    return Element("wall", position_mm=(x, y + 100.0, z), facing_mm=(x, y + 100.0, z + 100.0), size_mm=(150.0, 150.0),
                   **values)  # fmt: skip


def dim(scene, **elements):
    return replace(scene, mirror=replace(scene.mirror, reflectance=0.9), **elements)


SCENES = {
    "mirror": lambda: dim(load_scene("sphere")),
    "lens": lambda: wide(replace(
        load_scene("sphere"), camera=replace(load_scene("sphere").camera, transmittance=0.8))),
    "wall": lambda: replace(load_scene("sphere"), element=(wall(kind="absorber", scatter=Lambertian(0.3)),)),
    "scatter": lambda: replace(dim(load_scene("sphere")), mirror=replace(
        load_scene("sphere").mirror, reflectance=0.9, scatter=Harvey(0.05, -1.5, tis=0.02))),
    "singlet": lambda: dim(load_scene("sphere-singlet")),
    "window": lambda: wide(load_scene("sphere-window")),
}  # fmt: skip


@pytest.mark.parametrize("branches", ["random", "both"])
@pytest.mark.parametrize("name", SCENES)
def test_all_light_ends_somewhere(device, name, branches):
    if branches == "both" and name not in ("singlet", "window"):
        pytest.skip("nothing parts")
    light = light_of(SCENES[name](), device, rays_per_pixel=2**11, branches=branches)
    left, error = balance(light)
    assert abs(left) < T * error + STEP, name
    if name in ("mirror", "lens"):
        assert abs(left) < 3 * STEP  # no chance in it: roundings of a few ends per ray, half of them up
    assert T * error < 0.2


def test_a_mirror_absorbs_what_it_does_not_reflect(device):
    """All rays that escape not at once arrive at it: a tenth stays there, whatever the other ends are."""
    light = light_of(dim(load_scene("sphere")), device, rays_per_pixel=2**11)
    bare = light_of(load_scene("sphere"), device, rays_per_pixel=2**11)
    stays, of_bare = staying_of(light), staying_of(bare)
    arrives_w = stays["absorbed by mirror"].flux_w / 0.1
    ended_w = sum(light_w.flux_w for light_w in (*light.paths, *light.losses)) - stays[NOT_TRACED].flux_w
    reflected_w = ended_w - stays["absorbed by mirror"].flux_w
    missed_w = traced_w(light) - arrives_w
    assert of_bare["absorbed by mirror"].flux_w == 0
    assert reflected_w == pytest.approx(0.9 * arrives_w + missed_w, rel=2e-6, abs=0)  # steps of 2^-20
    assert 0.9 * arrives_w > 0.85 * reflected_w
    stops = [of["absorbed by stop"].flux_w for of in (stays, of_bare)]
    assert stops[0] == pytest.approx(0.9 * stops[1], rel=1e-4, abs=0)  # rounding of fewer rays


def test_a_lens_absorbs_what_it_does_not_pass(device):
    light = light_of(SCENES["lens"](), device, rays_per_pixel=2**11)
    passed_w = sum(path.flux_w for path in light.paths)
    absorbed_w = staying_of(light)["absorbed by lens"].flux_w
    assert passed_w > 0
    assert absorbed_w == pytest.approx(passed_w * 0.2 / 0.8, rel=1e-5, abs=0)  # all that passes meets the detector


def test_a_wall_absorbs_what_does_not_scatter(device):
    """As much arrives as at one that measures it, of the same rays; nothing of what it scatters comes back to it."""
    white, black = (
        light_of(replace(load_scene("sphere"), element=(element,)), device, rays_per_pixel=2**11)
        for element in (wall(kind="absorber", scatter=Lambertian(0.3)), wall(kind="detector"))
    )
    absorbed, arrives = (staying_of(light)["absorbed by wall"].flux_w for light in (white, black))
    assert arrives > 0.01 * traced_w(black)
    assert absorbed == pytest.approx(0.7 * arrives, rel=5e-6, abs=0)  # weights in steps of 2^-20
    assert white.ends["parted"] > 0


def test_a_detector_element_tells_what_comes(device):
    """A plate close behind the mirror's image of the screen takes all of it: pi sin^2 of the cone, per screen pixel.

    The mirror's disk as the Lambertian screen sees it: flux L A pi r^2 / (r^2 + h^2) on its axis, here beside it.
    """
    scene = load_scene("sphere")
    at = np.array(scene.screen.position_mm)
    plate = Element("meter", "detector", tuple((0.9 * at).tolist()), tuple(at.tolist()), diameter_mm=40.0)
    light = light_of(replace(scene, element=(plate,)), device, rays_per_pixel=2**15)
    stays = staying_of(light)["absorbed by meter"]
    height, radius, screen = 0.1 * np.linalg.norm(at), 20.0, light.scene.screen
    area = np.prod(screen.pixels) * screen.pitch_mm**2
    assert radius < 0.5 * 532.0 * 0.1  # well inside the cone to the mirror: all light to it was launched
    expected = area * np.pi * radius**2 / (radius**2 + height**2)
    # the screen's extent: 4 mm beside the axis of 416 moves the solid angle by its square
    assert abs(stays.flux_w - expected) < T * stays.standard_error_w + 2e-4 * expected
    assert T * stays.standard_error_w < 0.02 * expected
    assert math.isclose(light.ends["absorbed by meter"] / light.ends["launched"], stays.flux_w / traced_w(light),
                        rel_tol=0.01)  # fmt: skip


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_plates_that_face_along_x_and_along_y_get_the_same_light(device, sign):
    """A quarter turn of the bench about Z: the plates' widths, 4 to 1, lie along the world's X and Z then."""
    scene = Scene(
        "square", Mirror(radius_mm=math.inf, diameter_mm=150.0),
        Screen(position_mm=(0.0, 0.0, 100.0), pixels=(7, 7), pitch_mm=1.0),
        Camera(position_mm=(0.0, 0.0, 400.0), aperture_diameter_mm=1.0, focal_length_mm=16.0,
               detector=Detector(pixels=(16, 16), pitch_mm=0.4)),
    )  # fmt: skip
    upright = {"kind": "detector", "important": True}
    plates = (
        Element("along_y", position_mm=(0.0, sign * 80.0, 40.0), facing_mm=(0.0, 0.0, 40.0), size_mm=(20.0, 80.0),
                **upright),
        Element("along_x", position_mm=(sign * 80.0, 0.0, 40.0), facing_mm=(0.0, 0.0, 40.0), size_mm=(80.0, 20.0),
                **upright),
    )  # fmt: skip
    light = light_of(replace(scene, element=plates), device, as_it_is=True, rays_per_pixel=2**15)
    first, second = (staying_of(light)[f"absorbed by {plate.name}"] for plate in plates)
    error = np.hypot(first.standard_error_w, second.standard_error_w)
    assert abs(first.flux_w - second.flux_w) < T * error
    assert T * error < 0.1 * first.flux_w  # plates turned about their normals would differ by more
