"""Light that leaves the screen beside the mirror's cone, and comes by elements: beside quadratures and closed forms.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from oracle import sequence
from path_scenes import light_of, path_of
from scenes import coarse_screen
from scipy import stats
from significance import sidak_z
from tracers import setup_of

from irtscots_cl.report.facts import path_facts
from irtscots_cl.report.tables import path_tables
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Lambertian
from irtscots_cl.tracing.results.paths import NOT_TRACED

FAILURE_CHANCE = 1e-6
STATEMENTS = 32  # at most
REPLICATES = 32
T = float(stats.t.isf(stats.norm.sf(sidak_z(STATEMENTS, FAILURE_CHANCE)), REPLICATES - 1))  # of each: 7.3

SCATTERED = {"panel": 0.5, "ring": 0.05}  # total integrated scatter of white or black elements beside the mirror


def beside(name):
    """The sphere with a white panel in the camera's field, or a black ring around the mirror."""
    shape = {"panel": {"size_mm": (100.0, 100.0)}, "ring": {"diameter_mm": 1400.0, "obscuration_mm": 1080.0}}[name]
    x, y = {"panel": (480.0, 480.0), "ring": (0.0, 0.0)}[name]
    element = Element(name, "absorber", (x, y, 60.0), (x, y, 4000.0), scatter=Lambertian(SCATTERED[name]), **shape)
    detector = replace(load_scene("sphere").camera.detector, pitch_mm=0.06)
    scene = load_scene("sphere")
    return replace(scene, camera=replace(scene.camera, detector=detector), element=(element,))


def points_of(name):
    """Points [n, 3] and areas [n] of the element: Gauss's rule along x and y, or in the square of the radius."""
    node, weight = np.polynomial.legendre.leggauss(12)
    if name == "panel":
        x, y = (a.ravel() for a in np.meshgrid(480 + 50 * node, 480 + 50 * node))
        return np.stack([x, y, np.full_like(x, 60.0)], -1), np.outer(weight, weight).ravel() * 50.0**2
    low, high = 540.0**2, 700.0**2
    square = low + (high - low) * (node + 1) / 2
    angle = 2 * np.pi * (np.arange(96) + 0.5) / 96
    r, a = (grid.ravel() for grid in np.meshgrid(np.sqrt(square), angle, indexing="ij"))
    area = np.repeat(weight / 2 * (high - low) / 2 * (2 * np.pi / 96), 96)
    return np.stack([r * np.cos(a), r * np.sin(a), np.full_like(r, 60.0)], -1), area


def fluxes_w(scene, name):
    """Flux that arrives at the element, and that it scatters into the camera's aperture, from all screen pixels."""
    points, area = points_of(name)
    screen, camera = scene.screen, scene.camera
    out = np.array(camera.position_mm) - points
    distance = np.linalg.norm(out, axis=-1)
    leaves = out[:, 2] / distance * (out @ sequence.axes_of(camera)[2]) / distance  # of the element, at the aperture
    leaves *= SCATTERED[name] / np.pi * np.pi / 4 * camera.aperture_diameter_mm**2 / distance**2
    x, y, z = sequence.axes_of(screen)
    arriving = np.zeros(len(points))
    for u in (np.arange(screen.pixels[0]) - (screen.pixels[0] - 1) / 2) * screen.pitch_mm:
        for v in (np.arange(screen.pixels[1]) - (screen.pixels[1] - 1) / 2) * screen.pitch_mm:
            way = points - (np.array(screen.position_mm) + u * x + v * y)
            square = np.sum(way * way, -1)
            arriving += -way[:, 2] * -(way @ z) / square**2
    arriving *= area * screen.radiance * screen.pitch_mm**2
    return arriving.sum(), float(arriving @ np.abs(leaves))


@pytest.mark.parametrize("name", SCATTERED)
def test_an_element_beside_the_mirror_scatters_what_a_quadrature_says(device, name):
    """Onto the detector, and what it absorbs; the direct light stays what it was."""
    scene = beside(name)
    light = light_of(scene, device, rays_per_pixel=2**13, branches="random", seed=5)
    arrives, scattered = fluxes_w(light.scene, name)
    path = path_of(light, f"screen > {name} (s) > lens > detector")
    assert path.kind == "scatter"
    # 0.5 %: pixels and aperture at their centres; the detector takes all that passes the lens from so near its axis
    assert abs(path.flux_w - scattered) < T * path.standard_error_w + 5e-3 * scattered
    assert T * path.standard_error_w < 0.2 * scattered
    (absorbed,) = (loss for loss in light.losses if loss.name == f"absorbed by {name}")
    expected = (1 - SCATTERED[name]) * arrives
    assert abs(absorbed.flux_w - expected) < T * absorbed.standard_error_w + 1e-3 * expected
    assert T * absorbed.standard_error_w < 0.03 * expected
    bare = light_of(replace(scene, element=()), device, rays_per_pixel=2**13, seed=6)
    direct, alone = (path_of(of, "screen > mirror > lens > detector") for of in (light, bare))
    error = math.hypot(direct.standard_error_w, alone.standard_error_w)
    assert abs(direct.flux_w - alone.flux_w) < T * error < 0.1 * alone.flux_w


def test_all_light_of_the_screen_is_launched_and_ends_somewhere(device):
    """Pi x radiance x area: with several cones all is traced, with one the rest is said."""
    for scene in (beside("panel"), load_scene("sphere")):
        light = light_of(scene, device, rays_per_pixel=2**11, branches="random")
        screen = light.scene.screen
        assert light.launched_w == pytest.approx(math.pi * np.prod(screen.pixels) * screen.pitch_mm**2, rel=1e-12)
        parts = [*light.paths, *light.losses]
        left = sum(part.flux_w for part in parts) - light.launched_w
        assert abs(left) < T * sum(part.standard_error_w for part in parts) + 1e-5 * light.launched_w
        assert (light.losses[0].name == NOT_TRACED) == (not scene.element)
        rows = {row[0]: row for row in path_tables(path_facts(light, ()))[-1].rows}
        assert (NOT_TRACED in rows) == (not scene.element)
        if not scene.element:
            cone = setup_of(light.scene).mirror_aim.area.mean() / math.pi
            assert light.losses[0].flux_w == pytest.approx((1 - cone) * light.launched_w, rel=1e-6)


def glass(before_mm, tilt_degrees, thickness_mm=4.0, wedge_degrees=0.0, **values):
    """A plate or a wedge of glass before the screen; a small concave mirror far away absorbs half of what arrives."""
    scene = load_scene("sphere")
    screen = replace(scene.screen, position_mm=(100.0, 0.0, 1997.5), pixels=(1, 1), pitch_mm=0.4)
    camera = replace(scene.camera, position_mm=(-100.0, 0.0, 1997.5), aperture_diameter_mm=20.0, focal_length_mm=20.0,
                     detector=replace(scene.camera.detector, pixels=(25, 25), pitch_mm=0.15))  # fmt: skip
    mirror = replace(scene.mirror, radius_mm=2000.0, diameter_mm=300.0, reflectance=0.5)
    at = np.array(screen.position_mm)
    z = -at / np.linalg.norm(at)
    x = np.cross([0.0, 1.0, 0.0], -z)
    x /= np.linalg.norm(x)

    def turned(degrees):
        return math.cos(math.radians(degrees)) * z + math.sin(math.radians(degrees)) * x

    normals = turned(tilt_degrees), turned(tilt_degrees + wedge_degrees)
    first = at + before_mm * z
    places = first, first + thickness_mm * normals[0]
    faces = tuple(
        Element(name, "refractor", tuple(place.tolist()), tuple((place + 100 * normal).tolist()), diameter_mm=3000.0
                if tilt_degrees else 120.0, index_front=front, index_back=back, **values)
        for name, place, normal, front, back in (
            ("back", places[0], normals[0], 1.5, 1.0), ("front", places[1], normals[1], 1.0, 1.5))
    )  # fmt: skip
    return replace(scene, name="glass", mirror=mirror, screen=screen, camera=camera, element=faces)


def arriving_w(scene, grid=300, orders=0):
    """Flux at the mirror through the faces: radiance x area x direction cosines' area.

    Rays from the pixel's middle on a grid of directions, those at the mirror's edge by their share; Snell's law in
    vectors; the mirror as a sphere. orders: 0 for faces that reflect nothing; of reflections in a plate of bare glass,
    each of which moves the light on along it, with (1 - R)^2 R^(2 k) of both polarisations, since the plane of
    incidence is the same at both faces.
    """
    screen, mirror, radius = scene.screen, scene.mirror, scene.mirror.diameter_mm / 2
    frame = sequence.axes_of(screen)
    reach = 1.6 * radius / np.linalg.norm(screen.position_mm)
    side = (np.arange(grid) + 0.5) / grid * 2 * reach - reach
    l, m = (a.ravel() for a in np.meshgrid(side, side))
    way = np.stack([l, m, -np.sqrt(1 - l * l - m * m)], -1) @ frame
    at, before = np.broadcast_to(np.array(screen.position_mm), way.shape), np.ones(len(way), bool)
    for face in scene.element:
        vertex = np.array(face.position_mm)
        normal = np.array(face.facing_mm) - vertex
        normal /= np.linalg.norm(normal)
        at = at + ((vertex - at) @ normal / (way @ normal))[:, None] * way
        ratio = face.index_back / face.index_front
        cosine = way @ normal
        before &= cosine > 0  # else it runs along the plate and beside it
        way = ratio * way + (np.sqrt(1 - ratio**2 * (1 - cosine**2)) - ratio * cosine)[:, None] * normal
    passed, move = _orders(scene, way, orders) if orders else ([1.0], 0.0)
    on = sum(share * _on_mirror(mirror, at + k * move, way, grid) for k, share in enumerate(passed)) * before
    return screen.radiance * screen.pitch_mm**2 * np.mean(on) * (2 * reach) ** 2


def _orders(scene, way, count):
    """Shares [count, n] of the light of every order behind a plate, and its move along the plate with each [n, 3]."""
    first, last = (np.array(face.position_mm) for face in scene.element)
    normal = np.array(scene.element[0].facing_mm) - first
    normal /= np.linalg.norm(normal)
    cosine = np.abs(way @ normal)
    inside = np.sqrt(1 - (1 - cosine**2) / 1.5**2)
    s, p = (cosine - 1.5 * inside) / (cosine + 1.5 * inside), (1.5 * cosine - inside) / (1.5 * cosine + inside)
    shares = [sum((1 - r * r) ** 2 * r ** (4 * k) for r in (s, p)) / 2 for k in range(count)]
    along = way - (way @ normal)[:, None] * normal
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-12)
    return shares, 2 * ((last - first) @ normal) * (np.sqrt(1 - inside**2) / inside)[:, None] * along


def _on_mirror(mirror, at, way, grid):
    """Share of the cells around rays [grid x grid] that meets the mirror: linear across its edge."""
    centre = np.array([0.0, 0.0, mirror.radius_mm])
    b = np.sum((at - centre) * way, -1)
    point = at + (-b + np.sqrt(b * b - np.sum((at - centre) ** 2, -1) + mirror.radius_mm**2))[:, None] * way
    radius = np.hypot(point[:, 0], point[:, 1]).reshape(grid, grid)
    width = sum(np.abs(step) for step in np.gradient(radius))  # of the edge, in a cell
    return np.clip(0.5 + (mirror.diameter_mm / 2 - radius) / width, 0, 1).ravel()


@pytest.mark.parametrize(("tilt", "wedge"), [(0, 0.0), (0, 0.5), (0, 2.0), (45, 0.0), (60, 0.0), (75, 0.0), (84, 0.0)])
def test_light_that_glass_bends_onto_the_mirror_is_there(device, tilt, wedge):
    """A wedge turns it by half its angle, a tilted plate moves it: beside the cone of the bare mirror is up to 14 %."""
    scene = glass(60.0 if tilt else 8.0, tilt, wedge_degrees=wedge, reflectance=0.0)
    light = light_of(scene, device, as_it_is=True, rays_per_pixel=2**20, branches="random", seed=5)
    (absorbed,) = (loss for loss in light.losses if loss.name == "absorbed by mirror")
    expected = arriving_w(scene) * 0.5
    # the pixel is as large as 4e-4 of the mirror
    assert abs(absorbed.flux_w - expected) < T * absorbed.standard_error_w + 4e-4 * expected
    assert T * absorbed.standard_error_w < 6e-3 * expected
    several = len(setup_of(scene).emission(1.0).cones) > 1
    assert several == (tilt > 0 or wedge > 0)


@pytest.mark.parametrize("tilt", [*(pytest.param(t, marks=pytest.mark.slow) for t in (45, 60, 75)), 84])
def test_light_through_a_tilted_plate_of_bare_glass(device, tilt):
    """All orders of reflection, of both polarisations, wherever they leave the plate: displaced by 4 mm and more."""
    scene = glass(60.0, tilt)
    scene = replace(scene, mirror=replace(scene.mirror, reflectance=0.01))  # what returns to the plate is not asked for
    light = light_of(scene, device, as_it_is=True, rays_per_pixel=2**20, branches="split", bounce_limit=24, seed=5)
    (absorbed,) = (loss for loss in light.losses if loss.name == "absorbed by mirror")
    expected = arriving_w(scene, orders=12) * 0.99
    assert abs(absorbed.flux_w - expected) < T * absorbed.standard_error_w + 4e-4 * expected  # as above
    assert T * absorbed.standard_error_w < 6e-3 * expected


def test_a_screen_that_the_camera_sees_itself_lights_it_without_the_mirror(device):
    """Radiance x areas x cosines over the square of the distance, into a lens of 20 mm."""
    scene = load_scene("sphere")
    screen = replace(scene.screen, position_mm=(400.0, 0.0, 300.0), look_at_mm=(-350.0, 0.0, 250.0), pixels=(3, 3),
                     pitch_mm=2.0)  # fmt: skip
    camera = replace(scene.camera, position_mm=(-400.0, 0.0, 300.0), look_at_mm=(50.0, 0.0, 50.0),
                     aperture_diameter_mm=20.0, focal_length_mm=8.0,
                     detector=replace(scene.camera.detector, pixels=(40, 40), pitch_mm=0.5))  # fmt: skip
    scene = replace(
        scene, mirror=replace(scene.mirror, radius_mm=1e12, diameter_mm=600.0), screen=screen, camera=camera
    )
    light = light_of(scene, device, as_it_is=True, rays_per_pixel=2**17, seed=5)
    path = path_of(light, "screen > lens > detector")
    way = np.array(camera.position_mm) - np.array(screen.position_mm)
    distance = np.linalg.norm(way)
    cosines = -(way @ sequence.axes_of(screen)[2]) * (way @ sequence.axes_of(camera)[2]) / distance**2
    expected = 9 * 2.0**2 * math.pi / 4 * 20.0**2 * cosines / distance**2
    assert abs(path.flux_w - expected) < T * path.standard_error_w + 2e-3 * expected  # sizes of pixels and aperture
    assert T * path.standard_error_w < 0.05 * expected


@pytest.mark.parametrize("name", ["sphere", "sphere-singlet", "sphere-doublet", "sphere-window", "ghosts", "baffled"])
def test_the_presets_keep_one_cone(name):
    """Nothing that counts comes from beside the mirror: black baffles, plane windows, lenses behind the stop."""
    emission = setup_of(load_scene(name)).emission(1.0)
    assert len(emission.cones) == 1 and emission.shares.tolist() == [1.0]


@pytest.mark.second_device
@pytest.mark.parametrize("sampler", ["philox", "sobol", "lattice"])
def test_any_cut_into_launches_gives_the_same_bits_with_several_cones(device, sampler):
    """And any sampler the same light."""
    scene = coarse_screen(beside("panel"))
    light, cut = (light_of(scene, device, rays_per_pixel=2**12, replicates=4, sampler=sampler, branches="random",
                           launch_rays=launch) for launch in (None, 2**14 + 2**9))  # fmt: skip
    np.testing.assert_array_equal(light.images_w, cut.images_w)
    assert light.losses == cut.losses
    arrives, _ = fluxes_w(light.scene, "panel")
    (absorbed,) = (loss for loss in light.losses if loss.name == "absorbed by panel")
    assert absorbed.flux_w == pytest.approx(0.5 * arrives, rel=0.03, abs=0)
