"""Aspheric mirrors on host and device against an independent float64 tracer: points, heights and slopes, ray by ray."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from aspheres import MIRRORS, asphere_scene
from oracle import tracer
from oracle_rays import adjoint_rays, forward_rays

from irtscots_cl.optics.surface import Surface
from irtscots_cl.tracing.checks.probes import MeetProbe

RAYS = 1024
POINT_MM = {"fp32": 1e-3, "fp64": 1e-6}  # 1 um, 1 nm; found: an ulp of 50 mm, 4e-6, and 3e-12
# fp32: an ulp of a radius of 50 mm, times the bend of the terms, up to 0.03/mm, and a few roundings of slopes up to 0.4
SLOPE = {"fp32": 4e-7, "fp64": 1e-9}
USUAL_SLOPE = 1e-7  # fp32, rms


def lines_to(scene, real) -> np.ndarray:
    """Lines [4, n] (x0, y0, p, q) from places of the screen's plane and beside it to the mirror and past its rim."""
    mirror, random = scene.mirror, np.random.default_rng(17)
    radius = 1.04 * mirror.diameter_mm / 2 * np.sqrt(random.random(RAYS))
    angle = random.random(RAYS) * 2 * np.pi
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    z, distance = Surface.of(mirror).sag(x, y), scene.screen.position_mm[2]
    reach = scene.screen.pixels[0] * scene.screen.pitch_mm / 2
    start = np.array(scene.screen.position_mm[:2])[:, None] + reach * (2 * random.random((2, RAYS)) - 1)
    p, q = (start - [x, y]) / (distance - z)
    return np.stack([x - p * z, y - q * z, p, q]).astype(real)


def oracle_points(mirror, lines) -> tuple[np.ndarray, np.ndarray]:
    """Points [n, 3] of the mirror and slopes [n, 2] there, by the oracle's equation from z = 0 on."""
    surface = tracer.OracleMirror(mirror)
    x0, y0, p, q = lines.astype(float)
    along = np.stack([p, q, np.ones_like(p)], -1)
    points = surface.meet(np.stack([x0, y0, np.zeros_like(x0)], -1) + 50 * along, along)
    value, gradient = surface.implicit(points)
    assert np.abs(value).max() < 1e-11
    return points, -gradient[:, :2] / gradient[:, 2:]


@pytest.mark.parametrize("name", MIRRORS)
def test_device_and_host_meet_the_surface_of_the_sag_equation(device, precision, name):
    scene = asphere_scene(name)
    mirror = scene.mirror
    probe = MeetProbe(device, scene, precision)
    lines = lines_to(scene, probe.real)
    met, (points, slopes) = probe(lines), oracle_points(mirror, lines)
    radius = np.hypot(points[:, 0], points[:, 1])
    edges = np.array([mirror.diameter_mm, mirror.obscuration_mm]) / 2
    clear = np.abs(radius[:, None] - edges).min(1) > POINT_MM[precision]
    inside = (radius < edges[0]) & (radius > edges[1])
    np.testing.assert_array_equal(met.on_mirror[clear], inside[clear])
    assert 0.8 < inside.mean() < 0.95
    assert np.abs(met.point.T - points)[inside].max() < POINT_MM[precision]
    found = -met.normal[:2] / met.normal[2]
    left = (found.T - slopes)[inside]
    assert np.abs(left).max() < SLOPE[precision] and np.sqrt(np.mean(left**2)) < USUAL_SLOPE

    surface, (x0, y0, p, q) = Surface.of(mirror), lines.astype(float)
    along = np.stack([p, q, np.ones_like(p)], -1)
    host, _ = surface.meet(np.stack([x0, y0, np.zeros_like(x0)], -1) + 300 * along, along)
    assert np.abs(host - points)[inside].max() < 1e-11  # mm
    assert np.abs(np.stack(surface.gradient(*points[:, :2].T), -1) - slopes)[inside].max() < 1e-13
    assert np.abs(surface.sag(*points[:, :2].T) - points[:, 2])[inside].max() < 1e-12  # mm


@pytest.mark.slow
@pytest.mark.parametrize("name", ["order-20", "odd", "off-axis"])
def test_whole_paths_of_both_estimators(device, precision, name):
    scene = asphere_scene(name)
    adjoint, forward = adjoint_rays(device, scene, precision), forward_rays(device, scene, precision)
    reach = abs(scene.mirror.radius_mm)  # of the slope errors
    for rays, landing, target in ((adjoint, slice(5, 7), adjoint.oracle.screen),
                                  (forward, slice(5, 7), forward.oracle.aperture)):  # fmt: skip
        radius = np.hypot(*rays.oracle.mirror[:, :2].T)
        edges = np.array([scene.mirror.diameter_mm, scene.mirror.obscuration_mm]) / 2
        clear = np.abs(radius[:, None] - edges).min(1) > POINT_MM[precision]
        met = rays.oracle.on_mirror
        np.testing.assert_array_equal(rays.marks[clear, 0], met[clear])
        assert met.mean() > 0.5
        assert np.abs(rays.paths[:, 2:5] - rays.oracle.mirror)[met].max() < POINT_MM[precision]
        assert np.abs(rays.paths[:, landing] - target)[met].max() < 2 * SLOPE[precision] * reach * 2


def test_the_segments_frame_is_on_the_surface():
    """Height and slopes are 0 at a segment's centre, terms included; the frame is turned by them."""
    mirror = MIRRORS["off-axis"]
    centre = np.zeros(1)
    assert np.abs(Surface.of(mirror).sag(centre, centre)).max() < 1e-13
    assert np.abs(Surface.of(mirror).gradient(centre, centre)).max() < 1e-15
    oracle = tracer.OracleMirror(mirror)
    value, gradient = oracle.implicit(np.zeros((1, 3)))
    assert np.abs(value).max() < 1e-13 and np.abs(gradient[0, :2]).max() < 1e-15
    bare = tracer.OracleMirror(replace(mirror, asphere=None))
    # the terms' slope at 200 mm is 0.1: the two frames are not the same
    assert np.abs(oracle._segment()[1] - bare._segment()[1]).max() > 0.05
