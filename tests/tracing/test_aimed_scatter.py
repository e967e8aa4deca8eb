"""Scattered rays that are aimed bring the light that all directions bring; and a closed form of a lit wall's light.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from path_scenes import light_of, path_of
from scipy import stats
from significance import sidak_z

from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Harvey, Lambertian

FAILURE_CHANCE = 1e-6
STATEMENTS = 16  # at most
REPLICATES = 32
T = float(stats.t.isf(stats.norm.sf(sidak_z(STATEMENTS, FAILURE_CHANCE)), REPLICATES - 1))  # of each: 7.1


def sphere(**changes):
    """An aperture that a scattered ray in a hundred finds by itself."""
    scene = load_scene("sphere")
    return replace(scene, camera=replace(scene.camera, aperture_diameter_mm=200.0), **changes)


def mirror_scatters(**changes):
    scene = sphere(**changes)
    return replace(scene, mirror=replace(scene.mirror, scatter=Harvey(0.05, -1.5, tis=0.02)))


def wall_scatters():
    """A wall beside the way, lit by the screen; the mirror sends its scattered light to the camera."""
    x, y, z = (0.5 * np.array(load_scene("sphere").screen.position_mm)).tolist()
    wall = Element("wall", "absorber", (x, y + 200.0, z), (x, y + 200.0, z + 9.0), size_mm=(150.0, 150.0),
                   scatter=Lambertian(0.9))  # fmt: skip
    return sphere(element=(wall,))


def lens_scatters():
    scene = load_scene("sphere-singlet")
    front = replace(scene.element[0], scatter=Harvey(0.05, -1.5, tis=0.05))
    return replace(scene, element=(front, *scene.element[1:]))


def important_plate():
    """Beside the mirror's axis: the mirror's scattered light is aimed at it too."""
    plate = Element("plate", "absorber", (0.0, 400.0, 3000.0), (0.0, 0.0, 0.0), diameter_mm=100.0, important=True)
    return mirror_scatters(element=(plate,))


def assert_same(one, other, share):
    """share: of the flux that the limit of the test is, at most."""
    limit = T * math.hypot(one.standard_error_w, other.standard_error_w)
    assert abs(one.flux_w - other.flux_w) < limit
    assert limit < share * one.flux_w


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "name", "rays"),
    [
        (mirror_scatters, "screen > mirror (s) > lens > detector", 2**15),
        (lens_scatters, "screen > mirror > lens.front (s) > lens.back > detector", 2**15),
    ],
)
def test_aimed_rays_bring_the_light_of_all_directions(device, scene, name, rays):
    lights = [light_of(scene(), device, rays_per_pixel=rays, branches="random", aimed_scatter=aimed, seed=5 + aimed)
              for aimed in (True, False)]  # fmt: skip
    assert_same(*(path_of(light, name) for light in lights), 0.5)


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "element"), [(wall_scatters, "mirror"), (important_plate, "plate")])
def test_light_that_is_aimed_at_other_elements_is_that_of_all_directions(device, scene, element):
    """What an element absorbs: the mirror reflects 0.5, the plate nothing."""
    scene = scene()
    if element == "mirror":
        scene = replace(scene, mirror=replace(scene.mirror, reflectance=0.5))
    rays = 2**14 if element == "mirror" else 2**16  # rays go into the whole half space where a plate beside scatters
    lights = [light_of(scene, device, rays_per_pixel=rays, branches="random", aimed_scatter=aimed, seed=5 + aimed)
              for aimed in (True, False)]  # fmt: skip
    stays = [{stay.name: stay for stay in light.losses}[f"absorbed by {element}"] for light in lights]
    assert_same(*stays, 0.7)


def facing_rectangles(width_mm, height_mm, distance_mm):
    """Configuration factor of equal rectangles face to face (Sparrow and Cess, Radiation Heat Transfer, appendix A)."""
    x, y = width_mm / distance_mm, height_mm / distance_mm
    of_x, of_y = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    inner = math.log(of_x * of_y / math.sqrt(1 + x * x + y * y)) - x * math.atan(x) - y * math.atan(y)
    return 2 / (math.pi * x * y) * (inner + x * of_y * math.atan(x / of_y) + y * of_x * math.atan(y / of_x))


def test_a_lit_walls_light_on_a_meter_beside_its_way(device):
    """The screen lights a Lambertian square evenly; some of its light falls on a parallel one, shifted by its side.

    Two such squares are half of two rectangles face to face, each square of which sees its own one and the shifted one.
    A shield, wider as its shadow falls aside, keeps the screen's light from the meter's back.
    """
    scene, side, distance = sphere(), 20.0, 40.0
    at = np.array(scene.screen.position_mm)
    z = at / np.linalg.norm(at)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    cursor = at - 300.0 * z
    aside = cursor + distance * z + side * x

    def plate(name, kind, where, facing, size_mm=side, **values):
        return Element(name, kind, tuple(where.tolist()), tuple(facing.tolist()), size_mm=(size_mm, size_mm), **values)

    elements = (plate("wall", "absorber", cursor, at, scatter=Lambertian(0.8)),
                plate("meter", "detector", aside, aside - z, important=True),
                plate("shield", "absorber", aside + z, aside - z, size_mm=side + 0.4))  # fmt: skip
    light = light_of(replace(scene, element=elements), device, rays_per_pixel=2**15, branches="random")
    stays = {stay.name: stay for stay in light.losses}
    arriving_w, meter = stays["absorbed by wall"].flux_w / 0.2, stays["absorbed by meter"]
    factor = facing_rectangles(2 * side, side, distance) - facing_rectangles(side, side, distance)
    expected = 0.8 * arriving_w * factor
    # the wall is lit evenly to 0.4 %, by the cosine's fourth power
    assert abs(meter.flux_w - expected) < T * meter.standard_error_w + 4e-3 * expected
    assert T * meter.standard_error_w < 0.2 * expected
