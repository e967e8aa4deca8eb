"""Cases: rays that touch an edge exactly, and grazing rays. Each has one fate, the same in every run."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np

from irtscots_cl.opencl.structs import PRECISIONS
from irtscots_cl.scene.instrument import Detector
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.stability.checks import Bench, Case, Finding, count
from irtscots_cl.stability.conics import RAYS, SEED, compare, lines_through, mirror_scene, points_on
from irtscots_cl.stability.exact import ExactMirror
from irtscots_cl.stability.paths import scene_of
from irtscots_cl.tracing.checks.probes import MeetProbe
from irtscots_cl.tracing.results.transport import Transport
from irtscots_cl.tracing.trace import trace

GRAZING_DEGREES = (60.0, 80.0, 89.0, 89.5, 89.9)


def _grazing(degrees: float, bench: Bench) -> list[Finding]:
    """Rays from all sides at one angle to the normal of the point that they meet."""
    mirror = Mirror(radius_mm=1e4, conic=-0.8, diameter_mm=500.0)
    random = np.random.default_rng(SEED)
    points = points_on(mirror, RAYS, random)
    normal = ExactMirror(mirror).meet(np.stack([*points[:2], *np.zeros((2, RAYS))])).normal
    normal = np.stack([c.astype(float) for c in normal])
    aside = np.cross(normal, random.normal(size=(3, RAYS)), axis=0)
    aside /= np.linalg.norm(aside, axis=0)
    angle = np.radians(degrees)
    upwards = np.cos(angle) * normal + np.sin(angle) * aside
    steep = upwards[2] > np.cos(np.radians(89.9))  # to the axis too: no device is lower
    lines = lines_through(points[:, steep], upwards[:2, steep] / upwards[2, steep], bench.precision)
    probe = MeetProbe(bench.device, mirror_scene(mirror), bench.precision)
    return compare(ExactMirror(mirror).meet(lines), probe(lines), mirror, bench.precision)


def _rims(bench: Bench) -> list[Finding]:
    """Vertical rays on circles through integer points (3-4-5, 5-12-13): sums of squares have no rounding."""
    mirror = Mirror(radius_mm=4000.0, diameter_mm=1040.0, obscuration_mm=260.0)
    probe = MeetProbe(bench.device, mirror_scene(mirror), bench.precision)
    found = []
    for name, radius, inside in (("rim", 520.0, 0.0), ("hole", 130.0, np.inf)):
        on = radius * np.array([(1, 0), (0, 1), (-1, 0), (0, -1), (0.6, 0.8), (-5 / 13, 12 / 13), (12 / 13, -5 / 13)]).T
        on = np.rint(on).astype(PRECISIONS[bench.precision])
        axis = on[:, :4]  # where one rounding step of a coordinate crosses the edge
        step = np.nextafter(np.abs(axis), axis.dtype.type(inside)) * np.sign(axis)
        beyond = np.nextafter(np.abs(axis), axis.dtype.type(np.inf - inside if inside == 0 else 0)) * np.sign(axis)
        wrong = sum(
            int(np.sum(probe(np.concatenate([at, np.zeros_like(at)])).on_mirror != expected))
            for at, expected in ((on, True), (step, True), (np.where(axis == 0, 0, beyond), False))
        )
        found.append(count(f"on the {name}, a step to either side", wrong, 15, "the edge belongs to the mirror"))
    return found


def _corner_scene(offset_lines: float) -> Scene:
    """Camera and screen at an ellipsoid's foci, a pinhole: all light lands at one point, a corner of pixels."""
    ellipsoid = Mirror(radius_mm=3000.0, conic=-0.25, diameter_mm=1000.0)
    scene = scene_of(ellipsoid, (0.0, 0.0, 2000.0), (0.0, 0.0, 6000.0), 0.2)
    screen = dataclasses.replace(scene.screen, pixels=(6, 6), centre_offset_mm=(0.2 * offset_lines,) * 2)
    camera = dataclasses.replace(scene.camera, aperture_diameter_mm=0.02)
    return dataclasses.replace(scene, screen=screen, camera=camera)


def _corners(bench: Bench) -> list[Finding]:
    """The same rays, on the corner of four screen pixels and in the middle of one."""

    def run(offset_lines: float, **options) -> Transport:
        return trace(_corner_scene(offset_lines), device=bench.device, precision=bench.precision,
                     rays_per_pixel=2048, replicates=2, **options)  # fmt: skip

    corner, again, middle = run(0.0), run(0.0, launch_rays=30_000), run(0.5)
    pixels = corner.windows.pixels
    light = [np.bincount(t.windows.pixels, t.counts.sum((0, 2, 3)).astype(float), 64) for t in (corner, middle)]
    one_pixel = np.sum(np.sum(corner.counts.sum(0) > 0, (1, 2)) == 1)
    return [
        count("detector pixels whose light on the corner is not that in the middle", np.sum(light[0] != light[1]),
              len(pixels), "a ray on an edge counts once"),
        count("bins that differ in a second run, cut otherwise", np.sum(corner.counts != again.counts),
              corner.counts.size, "same seed, same bits"),
        count("ledgers that differ", int(corner.ledger != middle.ledger), 1, "every ray has one fate"),
        count("all light in one screen pixel", int(one_pixel == len(pixels)), 1, "or this case would test no edge"),
    ]  # fmt: skip


def _speck_scene(pixels: int) -> Scene:
    """A mirror that is a speck on the camera's axis: its light falls within a micrometre of the detector's centre."""
    speck = Mirror(radius_mm=1e4, diameter_mm=0.02)
    scene = scene_of(speck, (0.0, 0.0, 5000.0), (0.0, 0.0, 9000.0), 0.2)
    detector = Detector(pixels=(pixels, pixels), pitch_mm=0.1)
    return dataclasses.replace(
        scene,
        screen=dataclasses.replace(scene.screen, pixels=(4, 4)),
        camera=dataclasses.replace(scene.camera, aperture_diameter_mm=10.0, detector=detector),
    )


def _detector_corner(bench: Bench) -> list[Finding]:
    """The same forward rays, with the detector's centre on a corner of four pixels and in the middle of one."""

    def run(pixels: int, **options) -> Transport:
        return trace(_speck_scene(pixels), device=bench.device, precision=bench.precision, estimator="forward",
                     rays_per_pixel=2**16, replicates=2, **options)  # fmt: skip

    corner, again, middle = run(4), run(4, launch_rays=30_000), run(5)
    bins = [t.counts.sum((0, 1)) for t in (corner, middle)]
    return [
        count("screen pixels whose light on the corner is not that in the middle", np.sum(bins[0] != bins[1]),
              bins[0].size, "a ray on an edge counts once"),
        count("bins that differ in a second run, cut otherwise", np.sum(corner.counts != again.counts),
              corner.counts.size, "same seed, same bits"),
        count("ledgers that differ", int(corner.ledger != middle.ledger), 1, "every ray has one fate"),
        count("light there is", int(bins[0].sum() == 0), 1, "or this case would test no edge"),
    ]  # fmt: skip


CASES = (
    *(Case("edges and grazing rays", f"incidence of {d:g} degrees", partial(_grazing, d)) for d in GRAZING_DEGREES),
    Case("edges and grazing rays", "on the mirror's rim and hole", _rims),
    Case("edges and grazing rays", "on the corner of four screen pixels", _corners),
    Case("edges and grazing rays", "on the corner of four detector pixels", _detector_corner),
)
