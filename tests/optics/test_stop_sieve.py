"""Rays that end at the stop are counted without being followed: the same bits as with every ray followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tracers import path_tracer_of, setup_of

from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.maths.frame import Frame
from irtscots_cl.scene.element import Element
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.scatter.models import Lambertian
from irtscots_cl.tracing.estimators.nonsequential import PathTask
from irtscots_cl.tracing.options import NONSEQUENTIAL, TraceOptions
from irtscots_cl.tracing.packing import components as partpacking

RAYS = np.array([300])  # of a pixel; two batches and a part of one


def small(name, **mirror):
    """A preset with few screen pixels."""
    scene = load_scene(name)
    return replace(scene, mirror=replace(scene.mirror, **mirror), screen=replace(scene.screen, pixels=(7, 7)))


def bent():
    """Departures that take light across the aperture's edge: 0.3 mm at the camera."""
    return small("sphere", zernike=(ZernikeTerms(532.0, "noll", {5: 4.0, 6: -2.0}),))


def blurred():
    """Light of a mirror bent too much falls beside the stop, too."""
    scene = small("sphere", radius_mm=4000.0)
    return replace(scene, camera=replace(scene.camera, aperture_diameter_mm=4.0))


def plate(scene, depth_mm, side_mm, aside_mm=0.0):
    """With an absorber so far behind the camera's aperture along its axis, and beside it."""
    camera = Frame.looking(scene.camera.position_mm, scene.camera.look_at_mm)
    at = camera.position_mm + depth_mm * camera.axes[2] + aside_mm * camera.axes[1]
    facing = at - 100.0 * camera.axes[2]
    more = Element("plate", "absorber", tuple(at.tolist()), tuple(facing.tolist()), size_mm=(side_mm, side_mm))
    return replace(scene, element=(*scene.element, more))


SIEVED = {
    "sphere": (lambda: small("sphere"), {}),
    "double": (lambda: small("sphere"), {"precision": "fp64"}),
    "dull and pierced": (lambda: small("sphere", reflectance=0.7, obscuration_mm=300.0), {}),
    "departures": (bent, {"sampler": "sobol"}),
    "off axis": (lambda: small("off-axis"), {"sampler": "lattice"}),
    "lens": (lambda: small("sphere-singlet"), {}),
    "both branches": (lambda: small("sphere-singlet"), {"branches": "split"}),
    "polarised": (lambda: small("sphere-doublet"), {"polarisation": "on"}),
    "beside the stop": (lambda: plate(blurred(), 40.0, 400.0), {}),
    "little beside the stop": (lambda: plate(blurred(), 4.0, 4.0, 20.0), {}),
}
FOLLOWED = {
    "scatter": (lambda: small("sphere", scatter=Lambertian(0.3)), {}),
    "before the stop": (lambda: plate(small("sphere"), -100.0, 10.0), {}),
    "through its plane": (lambda: plate(small("sphere"), -0.5, 10.0, 40.0), {}),
    "window": (lambda: small("sphere-window"), {}),
    "given up at the mirror": (lambda: small("sphere"), {"bounce_limit": 1}),
    "both sides of the mirror": (lambda: small("sphere", radius_mm=300.0, diameter_mm=598.0), {}),
}


def options_of(given):
    return TraceOptions(NONSEQUENTIAL, seed=3, overfill=1.5, **given)


def job_of(device, scene, given):
    return PathTask(setup_of(scene), options_of(given)).program(device).after[0]


@pytest.mark.parametrize("name", SIEVED)
def test_the_sums_are_those_of_all_rays_followed(device, monkeypatch, name):
    make, given = SIEVED[name]
    scene = make()
    if given.get("precision") == "fp64" and not device.has_fp64:
        pytest.skip("no double precision")

    def run():
        return run_rays(path_tracer_of(scene, device, options_of(given)), RAYS)

    assert "sieve" in job_of(device, scene, given).dtype.names
    sums, images = run()
    monkeypatch.setattr(partpacking, "stop_sieve", lambda *_: None)
    assert "sieve" not in job_of(device, scene, given).dtype.names
    all_sums, all_images = run()
    np.testing.assert_array_equal(sums, all_sums)
    np.testing.assert_array_equal(images, all_images)
    assert images.any()


@pytest.mark.parametrize("name", FOLLOWED)
def test_where_rays_may_go_another_way_all_are_followed(device, name):
    make, given = FOLLOWED[name]
    assert "sieve" not in job_of(device, make(), given).dtype.names


def test_nearly_all_rays_of_a_bare_test_end_at_the_stop(device):
    """The limits leave little room: not much more than the aperture's rays are followed."""
    limits = job_of(device, small("sphere"), {})["sieve"]
    scene = load_scene("sphere")
    radius = scene.camera.aperture_diameter_mm / 2
    assert radius < np.sqrt(limits["stop_least2"]) < 1.1 * radius
    half = scene.mirror.diameter_mm / 2
    assert half - 0.1 < np.sqrt(limits["mirror_most2"]) < half < np.sqrt(limits["rim2"]) < half + 0.1
    wide = job_of(device, plate(small("sphere"), 40.0, 400.0), {})["sieve"]
    assert limits["slope2"] > 0 > wide["slope2"]  # beside the stop rays may meet the plate
