"""Cases: sums and weights at their extremes, and light next to light that is 10^12 times brighter."""

from __future__ import annotations

import dataclasses

import numpy as np

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.instrument import Detector
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, count, finding
from irtscots_cl.stability.paths import scene_of
from irtscots_cl.tracing.packing.sources import receivers
from irtscots_cl.tracing.trace import trace

SPHERE = Mirror(radius_mm=4166.747, diameter_mm=1064.0)
CENTRE = (0.0, 0.0, 4166.747)
ROUNDING = 4 * 2.0**-24  # of single-precision weights
FAINT = 1e-12


def _sums(bench: Bench) -> list[Finding]:
    """Many work-items add to few sums, across 2^32, 2^33 and up to 2^64 - 1."""
    random, n = np.random.default_rng(2), 2**14
    amounts = random.integers(0, 2**33, n, dtype=np.uint64)
    targets = (np.arange(n) % 7).astype(np.uint32)
    amounts[targets == 1] = 2**32 - 1
    amounts[targets == 2] = 2**31
    amounts[targets == 3] = 1
    amounts[targets == 4] = 0
    amounts[np.flatnonzero(targets == 4)[:3]] = [2**64 - 2**32, 2**32 - 2, 1]  # to the largest possible sum
    expected = [sum(int(a) for a in amounts[targets == k]) for k in range(7)]
    work = Workspace(bench.device, compose("probe_sums.cl", {}, {}, bench.precision, 1), "probe_sums")
    sums, wrong = work.empty(8 * 7), 0
    for part in (n, n // 2, 1):  # one launch, or several
        work.clear(sums)
        for first in range(0, n, part) if part > 1 else (0,):
            here = slice(first, first + part) if part > 1 else slice(None)
            work.launch((len(amounts[here]), 1), [work.upload(amounts[here]), work.upload(targets[here]), sums])
        wrong += sum(
            a != b for a, b in zip(work.download(sums, np.zeros(7, np.uint64)).tolist(), expected, strict=True)
        )
    return [count("64-bit sums", wrong, 21, "whole numbers add up exactly")]


def _one_bin(rays: int, bench: Bench) -> list[Finding]:
    """Camera and screen at the centre of curvature, a pinhole: all light of a pixel lands in one bin."""
    scene = _pinhole()
    run = trace(scene, device=bench.device, precision=bench.precision, rays_per_pixel=rays, replicates=1)
    whole = ChiefRays(scene).footprint.coverage[np.divmod(run.windows.pixels, 8)] == 1
    weight = run.counts[0, whole].sum((1, 2)) / (rays * WEIGHT_ONE)
    one_bin = np.sum(np.sum(run.counts[0, whole] > 0, (1, 2)) == 1)
    total = sum(v for k, v in run.ledger.items() if k != "launched") - run.ledger["launched"]
    limit = Limit(1e-3, "of 1", "the variation of cos^4 over a pixel: 8 of them cross a field of 15 degrees")
    return [
        finding(f"{rays * WEIGHT_ONE:.2g} in a bin, over rays times weight", weight - 1, limit),
        count("detector pixels with more than one bin", int(whole.sum() - one_bin), int(whole.sum()), "one bin"),
        count("rays that the ledger lost", abs(total), run.rays_total, "every ray has one fate"),
    ]


def _pinhole() -> Scene:
    scene = scene_of(SPHERE, CENTRE, CENTRE, 0.2)
    screen = dataclasses.replace(scene.screen, pixels=(5, 5))
    return dataclasses.replace(
        scene, screen=screen, camera=dataclasses.replace(scene.camera, aperture_diameter_mm=1e-6)
    )


def _wide_pixels(bench: Bench) -> list[Finding]:
    """A camera close to a large plane mirror, whose two pixels span 84 degrees each: cos^4 varies by 10^4 in one."""
    plane = Mirror(radius_mm=1e12, diameter_mm=2000.0)
    scene = scene_of(plane, (0.0, 0.0, 100.0), (0.0, 0.0, 200.0), 2000.0)
    wide = Detector(pixels=(2, 1), pitch_mm=12 * scene.camera.image_distance_mm)
    screen = dataclasses.replace(scene.screen, pixels=(5, 5))
    scene = dataclasses.replace(scene, screen=screen, camera=dataclasses.replace(scene.camera, detector=wide))
    chief = ChiefRays(scene)
    sources = receivers(chief, np.arange(2), np.zeros((2, 2), int), bench.precision)
    run = trace(scene, device=bench.device, precision=bench.precision, rays_per_pixel=2**20, replicates=8)
    flux = np.stack([run.flux_w(r).sum() for r in range(8)])
    camera = scene.camera
    area = np.pi / 4 * camera.aperture_diameter_mm**2 / camera.image_distance_mm**2
    exact = area * _mirrors_image(scene)
    noise = flux.std(ddof=1) / np.sqrt(8)
    return [
        finding("largest weight of a ray", sources["weight_scale"], Limit(2.0**31 - 1, "", "what 31 bits hold")),
        finding("flux less its integral, in standard errors", [(flux.mean() - exact) / noise],
                Limit(10, "sigma", "Student's t with 7 degrees of freedom: failure chance 2e-5")),
    ]  # fmt: skip


def _mirrors_image(scene: Scene) -> float:
    """Integral of cos^4 over the mirror's image, of a plane mirror about the camera's axis."""
    mirror, camera = scene.mirror, scene.camera
    tangent2 = (mirror.diameter_mm / 2 / camera.position_mm[2]) ** 2
    return np.pi * camera.image_distance_mm**2 * tangent2 / (1 + tangent2)  # of 2 pi t / (1 + t^2)^2 dt


def _faint(bench: Bench) -> list[Finding]:
    """One half of the screen 10^12 times darker than the other: two paths of one image."""
    scene = dataclasses.replace(_pinhole(), screen=dataclasses.replace(scene_of(SPHERE, CENTRE, CENTRE, 0.2).screen,
                                pixels=(2, 2)))  # fmt: skip
    camera = dataclasses.replace(scene.camera, aperture_diameter_mm=1.0)
    scene = dataclasses.replace(scene, camera=camera)
    run = trace(scene, device=bench.device, precision=bench.precision, rays_per_pixel=4096, replicates=2)
    bright, faint = np.array([[1.0, 0.0]] * 2), np.array([[0.0, FAINT]] * 2)

    def light(brightness: np.ndarray) -> np.ndarray:
        return run.images(LineScan(scene, brightness)).y.mean_w().sum(-1)  # rows of the screen: both halves in each

    alone, open_pool, without = light(faint), light(bright + faint), light(bright)
    lit = (alone > 0) & (without > 0)
    ratio = without[lit] / alone[lit]
    limit = Limit(8, "roundings", "float64 adds up the bins of a light curve: eight roundings of the bright part")
    apart = (open_pool - without - alone)[lit] / (2.0**-53 * without[lit])
    return [
        finding(f"faint part of {np.median(ratio):.1e} times brighter light", apart, limit),
        count("detector pixels without both", int(np.sum(~lit)), len(lit), "or nothing was compared")
        if lit.sum() < 30
        else count("detector pixels compared", 0, int(lit.sum()), "both paths are lit"),
    ]


def _few_rays(bench: Bench) -> list[Finding]:
    return _one_bin(2**12, bench)


def _many_rays(bench: Bench) -> list[Finding]:
    """2^33 rays in all, more than 2^32 in a ledger's fate."""
    return _one_bin(2**27, bench)


CASES = (
    Case("sums and weights", "64-bit sums across 2^32 and to 2^64 - 1", _sums),
    Case("sums and weights", "2^36 in one bin", _few_rays),
    Case("sums and weights", "2^33 rays, 2^51 in one bin", _many_rays, long=True),
    Case("sums and weights", "pixels that span 84 degrees", _wide_pixels),
    Case("sums and weights", "two paths, 1 to 1e-12", _faint),
)
