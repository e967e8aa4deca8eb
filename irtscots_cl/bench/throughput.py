"""Throughput of the tracer: rays per second by scene, estimator, sampler and precision, and the machine's limits.

Timings come from the OpenCL events of the kernels. All cases run in turn, round after round, so that a change of the
machine's speed affects all cases equally. The median over the rounds and their extremes are reported.
"""

from __future__ import annotations

import dataclasses
import statistics
from dataclasses import dataclass

import numpy as np

from irtscots_cl.execution.device_tracer import MIN_TIMED_RAYS, DeviceTracer
from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.height_map import MirrorMap
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.outline import Outline, OutlinePart, Spider
from irtscots_cl.scene.polynomial import Polynomial
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.screen_shape import CoverGlass, ScreenShape
from irtscots_cl.tracing.estimators.nonsequential import PathTask
from irtscots_cl.tracing.estimators.sequential import SequentialTask
from irtscots_cl.tracing.options import ESTIMATORS, NONSEQUENTIAL, TraceOptions
from irtscots_cl.tracing.samplers import SAMPLERS

ROUNDS = {True: 3, False: 9}  # timed rounds, quick or not
SECONDS = {True: 0.06, False: 0.5}  # of one timed trace
WARM_UP_RAYS = 2**22  # before a case's speed is known
WIDTHS = (1, 8, 16)  # rays side by side that the kernels are written for, on CPUs
FEATURES = {estimator: f"one feature alone, {estimator}" for estimator in ESTIMATORS}  # groups of cases
PATH_SCENES = ("sphere", "sphere-deviated", "sphere-singlet", "sphere-window", "ghosts")
FMA_CHAINS = 12  # CHAINS of kernels/entry/multiply_add.cl
FMA_STEPS = 20_000
MAP_NODES = 1000
MAP_NAME = f"conic, height map {MAP_NODES} x {MAP_NODES}"
# features that are timed with the adjoint estimator, too
SURFACES = (
    "conic", "asphere of order 20", "odd asphere", "conic, 45 Zernike terms", "45 annular Zernike terms", MAP_NAME
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One case to time. group: its heading in the tables. width: rays side by side; None: the device's own width."""

    group: str
    name: str
    scene: Scene
    estimator: str = "forward"
    sampler: str = "philox"
    precision: str = "fp32"
    accumulate: str | None = None
    width: int | None = None
    smoothing: bool = False


@dataclass(frozen=True)
class Timing:
    """Rays per second of a case: in the warm-up, and in the rounds, with their number of rays."""

    case: Case
    width: int
    warm_up_rate: float
    rays: int
    rates: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.rates)


def default_cases(device: Device, quick: bool) -> list[Case]:
    """The cases of `irtscots bench`: scenes, samplers, precisions, single features, widths, and omitted steps."""
    sphere = load_scene("sphere")
    scenes = [sphere] if quick else [load_scene(name) for name in ("sphere", "sphere-deviated", "off-axis")]
    cases = _scene_cases("scenes and samplers", scenes, tuple(SAMPLERS), "fp32")
    if device.has_fp64:
        cases += _scene_cases("double precision", scenes, ("philox",) if quick else tuple(SAMPLERS), "fp64")
    cases += [Case("smoothed rays, adjoint", f"{scene.name}, {sampler}", scene, "adjoint", sampler, smoothing=True)
              for scene in scenes for sampler in (("sobol",) if quick else SAMPLERS)]  # fmt: skip
    devices = _devices(sphere)
    features = _features(sphere)
    surfaces = {name: features[name] for name in SURFACES}
    cases += [Case(FEATURES["forward"], name, scene) for name, scene in (features | devices).items()]
    if device.has_fp64:
        cases.append(Case(FEATURES["forward"], "double precision", sphere, precision="fp64"))
    cases.append(Case(FEATURES["forward"], "sums by atomics", sphere, accumulate="atomic"))
    cases += [Case(FEATURES["adjoint"], name, scene, "adjoint")
              for name, scene in ({"plain sphere": sphere} | surfaces | devices).items()]  # fmt: skip
    cases += [Case("any order of elements, forward", name, load_scene(name), NONSEQUENTIAL)
              for name in (("sphere",) if quick else PATH_SCENES)]  # fmt: skip
    if device.kind == "cpu":  # on other devices, work-items are the lanes
        cases += [Case("rays side by side, forward", f"plain sphere, {n}", sphere, width=n) for n in WIDTHS]
    return cases + [
        Case("limit", f"sphere, {estimator}, philox, no accumulation", sphere, estimator, accumulate="none")
        for estimator in ESTIMATORS
    ]


def _scene_cases(group: str, scenes: list[Scene], samplers: tuple[str, ...], precision: str) -> list[Case]:
    return [
        Case(group, f"{scene.name}, {estimator}, {sampler}", scene, estimator, sampler, precision)
        for scene in scenes
        for estimator in ESTIMATORS
        for sampler in samplers
    ]


def _features(sphere: Scene) -> dict[str, Scene]:
    """The plain sphere, and the sphere with one additional feature."""

    def with_mirror(**changes) -> Scene:
        return dataclasses.replace(sphere, mirror=dataclasses.replace(sphere.mirror, **changes))

    rim_mm = sphere.mirror.diameter_mm / 2

    def zernike(indices, obscuration: float = 0.0) -> tuple[ZernikeTerms, ...]:
        return (ZernikeTerms(rim_mm, "noll", dict.fromkeys(indices, 0.01), obscuration),)

    def chebyshev(orders: int) -> tuple[Polynomial, ...]:
        terms = tuple((i, j, 0.01) for i in range(orders) for j in range(orders))
        return (Polynomial("chebyshev", (rim_mm, rim_mm), coefficients_um=terms),)

    def asphere(powers) -> Scene:  # 0.1 mm high at the rim
        rim = sphere.mirror.diameter_mm / 2
        rises = {n: 0.1 / len(powers) / rim**n for n in powers}
        return with_mirror(conic=-0.7154, asphere=Asphere(rises))

    diameter = sphere.mirror.diameter_mm
    return {
        "plain sphere": sphere,
        "conic": with_mirror(conic=-0.7154),
        "asphere of order 20": asphere(range(4, 21, 2)),
        "odd asphere": asphere(range(3, 21)),
        "off-axis conic": with_mirror(conic=-0.7154, off_axis_mm=20.0),
        "central hole": with_mirror(obscuration_mm=200.0),
        "hexagonal outline": with_mirror(outline=Outline(shape="hexagon", across_corners_mm=diameter)),
        "outline of three parts and a spider": with_mirror(outline=_parts(diameter)),
        "1 Zernike term": with_mirror(zernike=zernike([6])),
        "6 Zernike terms": with_mirror(zernike=zernike([6, 8, 9, 11, 29, 38])),
        "33 Zernike terms": with_mirror(zernike=zernike(range(4, 37))),
        "conic, 45 Zernike terms": with_mirror(conic=-0.7154, zernike=zernike(range(1, 46))),
        "45 annular Zernike terms": with_mirror(obscuration_mm=rim_mm / 2, zernike=zernike(range(1, 46), 0.25)),
        "8 x 8 Chebyshev terms": with_mirror(polynomial=chebyshev(8)),
        MAP_NAME: with_mirror(conic=-0.7154, map=(_map(sphere.mirror.diameter_mm),)),
    }


def _map(diameter_mm: float) -> MirrorMap:
    """Random heights of 1 nm at MAP_NODES x MAP_NODES points of a mirror and a little around it."""
    heights = np.random.default_rng(1).normal(scale=1e-6, size=(MAP_NODES, MAP_NODES))
    pitch = 1.01 * diameter_mm / MAP_NODES
    return MirrorMap(heights=HeightMap(heights, pitch_mm=(pitch, pitch)))


def _parts(diameter_mm: float) -> Outline:
    """An outline of parts that covers most of a disk."""
    circle = OutlinePart(shape="circle", diameter_mm=0.9 * diameter_mm)
    bars = tuple(
        OutlinePart(shape="rectangle", size_mm=(0.98 * diameter_mm, 0.2 * diameter_mm), rotation_deg=turn)
        for turn in (0.0, 90.0)
    )
    return Outline(part=(circle, *bars), spider=(Spider(width_mm=0.01 * diameter_mm, angles_deg=(45.0, 135.0, 270.0)),))


def _devices(sphere: Scene) -> dict[str, Scene]:
    """The sphere with a camera or a screen as real set-ups have them."""

    def with_screen(**changes) -> Scene:
        return dataclasses.replace(sphere, screen=dataclasses.replace(sphere.screen, **changes))

    intrinsics = Intrinsics(distortion=(-0.3, 0.1, 0.001, -0.001, 0.05))
    bent, glass = ScreenShape(sag_mm=((2, 0, 0.05), (0, 2, 0.03))), CoverGlass(thickness_mm=1.0)
    return {
        "distorted camera": dataclasses.replace(
            sphere, camera=dataclasses.replace(sphere.camera, intrinsics=intrinsics)
        ),
        "bent screen": with_screen(shape=bent),
        "cover glass": with_screen(cover_glass=glass),
        "bent screen, cover glass": with_screen(shape=bent, cover_glass=glass),
    }


def time_cases(cases: list[Case], device: Device, quick: bool) -> list[Timing]:
    """Build and warm up all cases, then time them in turn. Raises the errors of Tracer and its options."""
    tracers = [_tracer(case, device) for case in cases]
    least = [1 if case.estimator == NONSEQUENTIAL else MIN_TIMED_RAYS for case in cases]
    warm = [tracer.throughput(WARM_UP_RAYS, few) for tracer, few in zip(tracers, least, strict=True)]
    rays = [int(rate * SECONDS[quick]) for rate in warm]
    rates: list[list[float]] = [[] for _ in cases]
    for _ in range(ROUNDS[quick]):
        for tracer, count, few, rate in zip(tracers, rays, least, rates, strict=True):
            rate.append(tracer.throughput(count, few))
    return [
        Timing(case, case.width or device.vector_width(case.precision), first, count, tuple(rate))
        for case, first, count, rate in zip(cases, warm, rays, rates, strict=True)
    ]


def _tracer(case: Case, device: Device) -> DeviceTracer:
    setup = Setup(case.scene)
    options = TraceOptions(case.estimator, case.sampler, case.precision, smoothing=case.smoothing)
    if case.estimator == NONSEQUENTIAL:
        return DeviceTracer(PathTask(setup, options), device)
    return DeviceTracer(SequentialTask(setup, options, width=case.width, accumulate=case.accumulate), device)


def multiply_add_rate(device: Device) -> float:
    """Single-precision multiply-adds per second of the whole device, measured by a kernel that does nothing else."""
    work = Workspace(device, compose("multiply_add.cl", {}, {}, "fp32", device.vector_width("fp32")), "multiply_add")
    items = 4096 if device.kind != "cpu" else 16 * device.cl_device.max_compute_units
    result = work.empty(4 * items)
    best = 0.0
    for _ in range(5):
        seconds = work.launch((items, 1), [np.uint32(FMA_STEPS), result])
        best = max(best, items * FMA_STEPS * FMA_CHAINS * device.vector_width("fp32") / seconds)
    return best


def run_throughput(device: Device, quick: bool) -> dict:
    """The rates as plain data."""
    timings = time_cases(default_cases(device, quick), device, quick)
    multiply_adds = multiply_add_rate(device)
    return {
        "warm_up_rays": WARM_UP_RAYS,
        "rounds": ROUNDS[quick],
        "multiply_adds_per_second": multiply_adds,
        "cases": [_row(timing, timings, multiply_adds) for timing in timings],
    }


def _row(timing: Timing, timings: list[Timing], multiply_adds: float) -> dict:
    case = timing.case
    group = case.group if case.group in FEATURES.values() else FEATURES["forward"]
    plain = next(t for t in timings if t.case.group == group and t.case.name == "plain sphere")
    like = "forward" if case.estimator == NONSEQUENTIAL else case.estimator
    limit = next(t for t in timings if t.case.group == "limit" and t.case.estimator == like)
    return {
        "group": case.group, "name": case.name, "scene": case.scene.name, "estimator": case.estimator,
        "sampler": case.sampler, "precision": case.precision, "vector_width": timing.width,
        "rays_of_a_round": timing.rays, "warm_up_rays_per_second": timing.warm_up_rate,
        "rays_per_second": timing.median, "lowest": min(timing.rates), "highest": max(timing.rates),
        "of_plain_sphere": timing.median / plain.median, "of_no_accumulation": timing.median / limit.median,
        "multiply_adds_in_a_rays_time": multiply_adds / timing.median,
    }  # fmt: skip
