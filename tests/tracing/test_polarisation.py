"""Polarisation that rays carry from interface to interface: plates of glass beside closed forms of all orders.

FAILURE_CHANCE, of the whole file, is split among its statistical statements.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from path_scenes import light_of
from scipy import stats
from significance import sidak_z
from tracers import setup_of

from irtscots_cl.optics.elements.polarisation import LEAST_CHANGE, reflectances
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.estimators.nonsequential import PathTask
from irtscots_cl.tracing.options import NONSEQUENTIAL, TraceOptions

FAILURE_CHANCE = 1e-6
STATEMENTS = 32  # at most
REPLICATES = 32
T = float(stats.t.isf(stats.norm.sf(sidak_z(STATEMENTS, FAILURE_CHANCE)), REPLICATES - 1))  # of each: 7.3
INDEX, THICKNESS = 1.5, 4.0


def plates(*turns, reflectance=None, diameter_mm=60.0, coating_index=None):
    """A small mirror that absorbs nearly all light, behind plates tilted by (degrees, azimuth) before a small screen.

    The mirror is so small, 0.6 degrees to either side, that all its light meets a plate at one angle.
    """
    scene = load_scene("sphere")
    screen = replace(scene.screen, position_mm=(100.0, 0.0, 1997.5), pixels=(1, 1), pitch_mm=0.1)
    camera = replace(scene.camera, position_mm=(-100.0, 0.0, 1997.5), aperture_diameter_mm=20.0, focal_length_mm=20.0,
                     detector=replace(scene.camera.detector, pixels=(9, 9), pitch_mm=0.1))  # fmt: skip
    mirror = replace(scene.mirror, radius_mm=2000.0, diameter_mm=40.0, reflectance=0.01)
    at = np.array(screen.position_mm)
    z = -at / np.linalg.norm(at)
    x = np.cross([0.0, 1.0, 0.0], -z)
    x /= np.linalg.norm(x)
    y = np.cross(-z, x)
    faces = []
    for k, (tilt, azimuth) in enumerate(turns):
        sideways = math.cos(math.radians(azimuth)) * x + math.sin(math.radians(azimuth)) * y
        normal = math.cos(math.radians(tilt)) * z + math.sin(math.radians(tilt)) * sideways
        for name, depth, front, back in (("back", 0.0, INDEX, 1.0), ("front", THICKNESS, 1.0, INDEX)):
            place = at + (150.0 + 150.0 * k) * z + depth * normal
            faces.append(
                Element(f"{name}.{k}", "refractor", tuple(place.tolist()), tuple((place + 100 * normal).tolist()),
                        diameter_mm=diameter_mm, index_front=front, index_back=back, reflectance=reflectance,
                        coating_index=coating_index)
            )  # fmt: skip
    return replace(scene, name="plates", mirror=mirror, screen=screen, camera=camera, element=tuple(faces))


def fresnel(degrees):
    """Amplitudes of reflection r_s, r_p from air into glass, with the sign that makes both fields' product count."""
    cosine = math.cos(math.radians(degrees))
    inside = math.sqrt(1 - (1 - cosine**2) / INDEX**2)
    s = (cosine - INDEX * inside) / (cosine + INDEX * inside)
    return s, (INDEX * cosine - inside) / (INDEX * cosine + inside)


def plate_of(degrees):
    """What a plate does to the light that passes it, with all its orders: factors of s, of p, and of u."""
    s, p = fresnel(degrees)
    passed = math.sqrt((1 - s * s) * (1 - p * p))
    return (1 - s * s) / (1 + s * s), (1 - p * p) / (1 + p * p), passed**2 / (1 - (s * p) ** 2)


def through(turns):
    """Transmittance of plates by Mueller matrices for (I, Q, U), each turned to its plate's plane of incidence."""
    stokes, azimuth_before = np.array([1.0, 0.0, 0.0]), 0.0
    for tilt, azimuth in turns:
        twice = 2 * math.radians(azimuth - azimuth_before)
        azimuth_before = azimuth
        turn = np.array([[1, 0, 0], [0, math.cos(twice), math.sin(twice)], [0, -math.sin(twice), math.cos(twice)]])
        s, p, u = plate_of(tilt)
        plate = np.array([[(s + p) / 2, (s - p) / 2, 0], [(s - p) / 2, (s + p) / 2, 0], [0, 0, u]])
        stokes = plate @ turn @ stokes
    return stokes[0]


def met(turns):
    """The turns as the light to the mirror's middle meets the plates: each moves it sideways, so it starts beside."""
    away = 0.0
    for tilt, azimuth in turns:
        sine, cosine = math.sin(math.radians(tilt)), math.cos(math.radians(tilt))
        moved = THICKNESS * sine * (1 - cosine / math.sqrt(INDEX**2 - sine**2))
        away += moved * np.exp(1j * math.radians(azimuth))
    turn = math.degrees(1) * away / 2000.0  # of the light, seen from the mirror
    return tuple((tilt + (turn * np.exp(-1j * math.radians(azimuth))).real, azimuth) for tilt, azimuth in turns)


def alone(turns):
    """The same where every interface by itself takes the mean of both reflectances."""
    mean = [np.mean(np.square(fresnel(tilt))) for tilt, _ in turns]
    return math.prod((1 - r) / (1 + r) for r in mean)


def found(turns, device, **options):
    """Transmittance of plates: light at the mirror over that of plates of the same shape that reflect nothing."""
    settings = {"as_it_is": True, "rays_per_pixel": 2**20, "seed": 5, "sampler": "sobol", "bounce_limit": 24} | options
    wide = {"diameter_mm": 600.0 if turns[0][0] > 80 else 60.0}  # orders of reflection walk along the plate
    light, bare = (light_of(scene, device, **settings)
                   for scene in (plates(*turns, **wide), plates(*turns, reflectance=0.0, **wide)))  # fmt: skip
    (one,), (other,) = ([loss for loss in of.losses if loss.name == "absorbed by mirror"] for of in (light, bare))
    share = one.flux_w / other.flux_w
    return share, share * math.hypot(one.standard_error_w / one.flux_w, other.standard_error_w / other.flux_w)


@pytest.mark.parametrize("branches", ["split", "random"])
@pytest.mark.parametrize("turns", [((45, 0),), ((60, 0),), ((75, 20),), ((84, 0),), ((60, 0), (60, 90)),
                                   ((60, 0), (60, 0)), ((65, 0), (60, 35), (60, 80))])  # fmt: skip
def test_plates_pass_what_both_polarisations_pass(device, turns, branches):
    """Of one plate the mean of s and p; of crossed ones their product; of others by the angles between them."""
    if branches == "random" and len(turns) < 3:
        pytest.skip("the longest chain tells as much")
    share, error = found(turns, device, branches=branches)
    expected = through(met(turns))
    assert abs(share - expected) < T * error + 1e-3 * expected  # 1e-3: angles over the beam
    assert T * error < (0.008 if branches == "split" else 0.015) * expected
    assert abs(alone(met(turns)) / expected - 1) > 2e-3  # there is something to see


@pytest.mark.parametrize(("degrees", "change"), [(45, 0.003), (60, 0.014), (75, 0.036), (84, 0.031)])
def test_by_itself_each_interface_would_be_wrong(degrees, change):
    """The closed forms: by so much the mean at each interface differs from the mean of both polarisations."""
    turns = ((degrees, 0),)
    assert abs(alone(turns) / through(turns) - 1) == pytest.approx(change, abs=6e-4)  # as printed


def test_without_polarisation_each_interface_takes_the_mean(device):
    """What --polarisation off is: the closed form of each interface by itself."""
    share, error = found(((75, 0),), device, branches="split", polarisation="off")
    expected = alone(met(((75, 0),)))
    assert abs(share - expected) < T * error + 1e-3 * expected  # angles over the beam
    assert abs(share / through(met(((75, 0),))) - 1) > 0.03


@pytest.mark.parametrize("name", ["sphere", "sphere-singlet", "sphere-doublet", "sphere-window", "ghosts", "baffled"])
def test_the_presets_carry_none(name):
    """Their interfaces are met too steeply for it to matter."""
    setup = setup_of(load_scene(name))
    assert setup.polarisation_change < LEAST_CHANGE
    assert PathTask(setup, TraceOptions(NONSEQUENTIAL)).polarised is False
    assert PathTask(setup, TraceOptions(NONSEQUENTIAL, polarisation="on")).polarised is True


@pytest.mark.parametrize("degrees", [45, 60, 75])
def test_the_change_by_carrying_it_is_foreseen(degrees):
    """Of the light that passes a plate straight."""
    setup = setup_of(plates((degrees, 0)))
    s, p = np.square(fresnel(degrees))
    straight = ((1 - s) ** 2 + (1 - p) ** 2) / 2 / (1 - (s + p) / 2) ** 2 - 1
    assert setup.polarisation_change == pytest.approx(straight, rel=0.1)  # angles over the beam
    assert PathTask(setup, TraceOptions(NONSEQUENTIAL)).polarised


def test_untilted_light_is_the_same_with_polarisation(device):
    """The window's direct light and its image, of the same rays: polarisation changes it by less than 1e-5."""
    on, off = (light_of(load_scene("sphere-window"), device, rays_per_pixel=2**9, replicates=2, branches="random",
                        polarisation=way) for way in ("on", "off"))  # fmt: skip
    assert on.paths[0].name == off.paths[0].name
    assert on.paths[0].flux_w == pytest.approx(off.paths[0].flux_w, rel=1e-3, abs=0)  # a few rays choose otherwise
    assert on.ends["launched"] == off.ends["launched"]


def test_reflectances_of_both_polarisations_on_the_host():
    component = setup_of(plates((60, 0))).components[-1]
    cosine = 0.5
    beyond = math.sqrt(1 - (1 - cosine**2) / INDEX**2)
    s, p = reflectances(component, np.array([-cosine, beyond]), np.array([-beyond, cosine]))
    np.testing.assert_allclose([s, p], np.square(fresnel(60))[:, None] * [1, 1], rtol=1e-12)  # from either side
    quarter = replace(component, kind="coated", coating_index=math.sqrt(INDEX))
    s, p = reflectances(quarter, np.array([-1.0]), np.array([-1.0]))
    np.testing.assert_allclose([s, p], 0, atol=1e-12)  # an index of the root reflects nothing


def test_a_coating_of_the_glass_itself_changes_nothing(device):
    """A layer of the glass's index is no layer: the same light as bare glass, of other rays' arithmetic."""
    turns = ((60, 0), (65, 40))
    settings = {"as_it_is": True, "rays_per_pixel": 2**18, "seed": 5, "branches": "split"}
    bare, coated = (light_of(plates(*turns, coating_index=index), device, **settings) for index in (None, INDEX))
    one, other = (next(loss for loss in of.losses if loss.name == "absorbed by mirror") for of in (bare, coated))
    assert abs(one.flux_w - other.flux_w) < 1e-3 * one.flux_w  # the same rays but for rounding at branches
