"""Throughput of the tracer: rays per second by scene, estimator, sampler and precision, beside the machine's limits.

Timings come from the OpenCL events of the kernels. Every case runs in turn, round after round, so that a change of the
machine's speed touches all cases alike; the median over the rounds and their extremes are reported.
"""

from __future__ import annotations

import dataclasses
import platform
import resource
import statistics
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from irtscots_cl.calibration import calibrate
from irtscots_cl.device import Device
from irtscots_cl.execution import Workspace
from irtscots_cl.presets import load_scene
from irtscots_cl.program import compose
from irtscots_cl.report import Table, versions
from irtscots_cl.scene import Scene, ZernikeTerms
from irtscots_cl.tracer import TraceOptions, Tracer

ROUNDS = {True: 3, False: 9}  # timed rounds, quick or not
SECONDS = {True: 0.12, False: 0.5}  # of one timed trace
FIRST_RAYS = 2**22  # before a case's speed is known
FMA_CHAINS = 12  # CHAINS of kernels/multiply_add.cl
FMA_STEPS = 20_000


@dataclass(frozen=True)
class Case:
    """One thing to time. group: heading that it is listed under."""

    group: str
    name: str
    scene: Scene
    estimator: str = "forward"
    sampler: str = "philox"
    precision: str = "fp32"
    accumulate: str | None = None


@dataclass(frozen=True)
class Timing:
    """Rays per second of a case over the rounds."""

    case: Case
    width: int
    rates: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.rates)


def default_cases(device: Device, quick: bool) -> list[Case]:
    """What `irtscots bench` times: scenes and samplers, single features of a scene, and the parts left out."""
    sphere = load_scene("sphere")
    cases = [
        Case("scenes and samplers", f"{name}, {estimator}, {sampler}", load_scene(name), estimator, sampler)
        for name in (("sphere",) if quick else ("sphere", "sphere-deviated", "off-axis"))
        for estimator in ("forward", "adjoint")
        for sampler in ("philox", "sobol", "lattice")
    ]
    cases += [Case("one feature alone, forward", name, scene) for name, scene in _features(sphere).items()]
    if device.has_fp64:
        cases.append(Case("one feature alone, forward", "double precision", sphere, precision="fp64"))
    cases.append(Case("one feature alone, forward", "sums by atomics", sphere, accumulate="atomic"))
    for estimator in ("forward", "adjoint"):
        cases.append(
            Case("limit", f"sphere, {estimator}, philox, no accumulation", sphere, estimator, accumulate="none")
        )
    return cases


def _features(sphere: Scene) -> dict[str, Scene]:
    """The plain sphere, and the sphere with one thing more."""

    def with_mirror(**changes) -> Scene:
        return dataclasses.replace(sphere, mirror=dataclasses.replace(sphere.mirror, **changes))

    def zernike(indices) -> tuple[ZernikeTerms, ...]:
        return (ZernikeTerms(sphere.mirror.diameter_mm / 2, "noll", dict.fromkeys(indices, 0.01)),)

    return {
        "plain sphere": sphere,
        "conic": with_mirror(conic=-0.7154),
        "off-axis conic": with_mirror(conic=-0.7154, off_axis_mm=20.0),
        "central hole": with_mirror(obscuration_mm=200.0),
        "1 Zernike term": with_mirror(zernike=zernike([6])),
        "6 Zernike terms": with_mirror(zernike=zernike([6, 8, 9, 11, 29, 38])),
        "33 Zernike terms": with_mirror(zernike=zernike(range(4, 37))),
    }


def time_cases(cases: list[Case], device: Device, quick: bool) -> list[Timing]:
    """Build and warm up all cases, then time them in turn."""
    tracers = [
        Tracer(calibrate(case.scene), device, TraceOptions(case.estimator, case.sampler, case.precision),
               accumulate=case.accumulate)
        for case in cases
    ]  # fmt: skip
    rays = [int(tracer.throughput(FIRST_RAYS) * SECONDS[quick]) for tracer in tracers]
    rates: list[list[float]] = [[] for _ in cases]
    for _ in range(ROUNDS[quick]):
        for tracer, count, rate in zip(tracers, rays, rates, strict=True):
            rate.append(tracer.throughput(count))
    return [
        Timing(case, device.vector_width(case.precision), tuple(rate)) for case, rate in zip(cases, rates, strict=True)
    ]


def multiply_add_rate(device: Device) -> float:
    """Single-precision multiply-adds per second of the whole device, by a kernel that does nothing else."""
    work = Workspace(device, compose("multiply_add.cl", {}, {}, "fp32", device.vector_width("fp32")), "multiply_add")
    items = 4096 if device.kind != "cpu" else 16 * device.cl_device.max_compute_units
    result = work.empty(4 * items)
    best = 0.0
    for _ in range(5):
        seconds = work.launch((items, 1), [np.uint32(FMA_STEPS), result])
        best = max(best, items * FMA_STEPS * FMA_CHAINS * device.vector_width("fp32") / seconds)
    return best


def run_bench(device: Device, quick: bool = False) -> dict:
    """All timings as plain data, with what they were taken on."""
    started = time.perf_counter()
    timings = time_cases(default_cases(device, quick), device, quick)
    multiply_adds = multiply_add_rate(device)
    return {
        "device": device.describe(), "machine": platform.processor() or platform.machine(), "versions": versions(),
        "git_revision": _git_revision(), "quick": quick, "rounds": ROUNDS[quick],
        "peak_memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "multiply_adds_per_second": multiply_adds, "seconds": time.perf_counter() - started,
        "cases": [_row(timing, timings, multiply_adds) for timing in timings],
    }  # fmt: skip


def _row(timing: Timing, timings: list[Timing], multiply_adds: float) -> dict:
    case = timing.case
    plain = next(t for t in timings if t.case.group.startswith("one feature") and t.case.name == "plain sphere")
    limit = next(t for t in timings if t.case.group == "limit" and t.case.estimator == case.estimator)
    return {
        "group": case.group, "name": case.name, "scene": case.scene.name, "estimator": case.estimator,
        "sampler": case.sampler, "precision": case.precision, "vector_width": timing.width,
        "rays_per_second": timing.median, "lowest": min(timing.rates), "highest": max(timing.rates),
        "of_plain_sphere": timing.median / plain.median, "of_no_accumulation": timing.median / limit.median,
        "multiply_adds_in_a_rays_time": multiply_adds / timing.median,
    }  # fmt: skip


def _git_revision() -> str:
    """Revision of the source tree that the package runs from, or "unknown" for an installed package."""
    try:
        told = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=Path(__file__).parent, check=True,
                              capture_output=True, text=True, timeout=10)  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return told.stdout.strip()


def bench_tables(results: dict) -> list[Table]:
    """The results as tables, one per group."""
    head = ("", "M rays/s", "lowest", "highest", "of plain sphere", "of no accumulation", "multiply-adds per ray")
    groups = dict.fromkeys(row["group"] for row in results["cases"])
    return [
        Table(group, head, [
            (row["name"], *(f"{row[key] / 1e6:.1f}" for key in ("rays_per_second", "lowest", "highest")),
             f"{row['of_plain_sphere']:.2f}", f"{row['of_no_accumulation']:.2f}",
             f"{row['multiply_adds_in_a_rays_time']:.0f}")
            for row in results["cases"] if row["group"] == group])
        for group in groups
    ]  # fmt: skip


def write_plot(results: dict, path: Path) -> None:
    """Bars of all cases, with whiskers from the slowest to the fastest round."""
    from matplotlib.figure import Figure

    from irtscots_cl.files import replacing

    rows = results["cases"][::-1]
    figure = Figure(figsize=(9, 0.28 * len(rows) + 1.2), layout="constrained")
    axes = figure.subplots()
    rates = np.array([[row[key] for row in rows] for key in ("lowest", "rays_per_second", "highest")]) / 1e6
    axes.barh(range(len(rows)), rates[1], xerr=np.abs(np.diff(rates, axis=0)), color="tab:blue", ecolor="0.3")
    axes.set_yticks(range(len(rows)), [f"{row['group'].split(',')[0]}: {row['name']}" for row in rows], fontsize=7)
    axes.set(xlabel="M rays/s", title=f"{results['device']['name']}, {results['device']['platform']}")
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=120)
