"""What is ruled out for the first steps of rays is never met there: the same bits with nothing ruled out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tracers import path_tracer_of, setup_of

from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.elements.components import components_of
from irtscots_cl.optics.elements.first_hits import ALL, may_meet
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Lambertian
from irtscots_cl.tracing.options import NONSEQUENTIAL, TraceOptions
from irtscots_cl.tracing.packing import components as partpacking
from irtscots_cl.tracing.packing.sources import emitters

RAYS = np.array([64])


def masks(scene, overfill=1.0):
    """Names of the elements that rays may meet first, and second."""
    components, screen = components_of(scene), Frame.looking(scene.screen.position_mm, scene.screen.look_at_mm)
    sources, _ = emitters(setup_of(scene), "fp32", overfill, "mirror")
    bits = may_meet(components, screen, sources, scene.screen.pitch_xy_mm)
    return tuple({component.name for k, component in enumerate(components) if bit >> k & 1} for bit in bits)


def seen_from(degrees, mirror, screen_mm, camera_mm):
    """The sphere's test with arms of these lengths at that angle to the mirror's axis."""
    scene, way = load_scene("sphere"), np.radians(degrees)
    screen = replace(scene.screen, pixels=(5, 5), position_mm=(screen_mm * np.sin(way), 0.0, screen_mm * np.cos(way)))
    camera = replace(scene.camera, position_mm=(-camera_mm * np.sin(way), 0.0, camera_mm * np.cos(way)))
    return replace(scene, mirror=replace(scene.mirror, **mirror), screen=screen, camera=camera)


def bowl():
    """Deep, and lit from aside: what falls on its rim at more than 53 degrees goes on to the other side."""
    return seen_from(36.0, {"radius_mm": 1000.0, "diameter_mm": 1200.0}, 4000.0, 4000.0)


def tilted():
    """The screen turned by 80 degrees: its rays go along the camera's plate, nearly."""
    scene = load_scene("sphere")
    return replace(scene, screen=replace(scene.screen, look_at_mm=(4161.0, 0.0, 3500.0), pixels=(5, 5)))


def camera_in_front():
    """The camera's plane lies between the screen and the mirror."""
    return seen_from(3.0, {}, 4600.0, 4166.0)


def before_the_screen(along_mm=-10.0):
    """A plate at that distance behind the screen's middle, wide enough to be met."""
    scene = load_scene("sphere")
    at = np.array(scene.screen.position_mm)
    place = at + along_mm * at / np.linalg.norm(at)
    plate = Element("plate", "absorber", tuple(place.tolist()), (0.0, 0.0, 0.0), size_mm=(2.0, 2.0))
    return replace(scene, element=(plate,))


def cut():
    """A plate through the screen, turned against it by 20 degrees: half of the rays start before it."""
    scene = load_scene("sphere")
    frame, way = Frame.looking(scene.screen.position_mm, scene.screen.look_at_mm), np.radians(20.0)
    facing = frame.position_mm - np.cos(way) * frame.axes[2] - np.sin(way) * frame.axes[0]
    plate = Element("plate", "absorber", scene.screen.position_mm, tuple(facing.tolist()), size_mm=(6.0, 6.0))
    return replace(scene, element=(plate,))


def scattering():
    scene = load_scene("sphere")
    return replace(scene, mirror=replace(scene.mirror, scatter=Lambertian(0.3)))


OTHERS = {
    "bowl": bowl,
    "tilted": tilted,
    "front": camera_in_front,
    "plate": before_the_screen,
    "behind": lambda: before_the_screen(10.0),
    "cut": cut,
    "scatter": scattering,
}


# of the presets those whose elements differ
@pytest.mark.parametrize(
    "name", ["sphere", "off-axis", "sphere-singlet", "sphere-window", "baffled", "ghosts", *OTHERS]
)
def test_what_is_ruled_out_is_never_met(device, monkeypatch, name):
    """Images and all sums, of the very rays that meet anything."""
    scene = OTHERS[name]() if name in OTHERS else load_scene(name)

    def run():
        tracer = path_tracer_of(scene, device, TraceOptions(NONSEQUENTIAL, seed=3, overfill=1.5))
        return (*run_rays(tracer, RAYS), tracer)

    sums, images, tracer = run()
    monkeypatch.setattr(partpacking, "may_meet", lambda *given: (ALL, ALL))
    all_sums, all_images, _ = run()
    np.testing.assert_array_equal(sums, all_sums)
    np.testing.assert_array_equal(images, all_images)
    assert tracer.task.light.ends(sums, int(RAYS.sum()) * tracer.sources)["launched"] > 1000


def test_a_bare_test_rules_out_what_it_can():
    """Behind the screen's rays the camera; from the mirror on everything but the mirror."""
    assert masks(load_scene("sphere")) == ({"mirror"}, {"stop", "lens", "detector"})


def test_what_may_be_met_is_not_ruled_out():
    everything = {"mirror", "stop", "lens", "detector"}
    assert masks(bowl()) == ({"mirror"}, everything)
    assert masks(scattering()) == ({"mirror"}, everything)  # scattered light goes anywhere
    assert "stop" in masks(camera_in_front())[0]
    assert "stop" in masks(tilted())[0]
    assert masks(cut())[0] == {"mirror", "plate"}
    assert masks(before_the_screen())[0] == {"mirror", "plate"}
    assert masks(before_the_screen(10.0)) == ({"mirror"}, everything - {"mirror"} | {"plate"})
    assert masks(load_scene("sphere-window"))[0] == {"mirror", "window.front", "window.back"}
    assert masks(load_scene("sphere-window"))[1] == everything | {"window.front", "window.back"}


def test_the_bowls_light_does_meet_it_twice(device):
    """So that the tests above have something to see."""
    tracer = path_tracer_of(bowl(), device, TraceOptions(NONSEQUENTIAL, seed=3, bounce_limit=2))
    sums, _ = run_rays(tracer, RAYS)
    ends = tracer.task.light.ends(sums, int(RAYS.sum()) * tracer.sources)
    assert ends["bounce limit"] > 0.01 * ends["launched"]  # the camera is much too small for so many
