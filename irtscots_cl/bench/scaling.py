"""How the wall time of a trace grows: with rays, screen pixels, detector pixels and cores; forward, the sphere.

A sweep changes one quantity and keeps the others. Its points run in turn, round after round, each after a warm-up.
Three times are measured: of the kernels, of tracing (first launch to last result on the host), and of the whole call of
`trace` with chief rays and buffers but compiled kernels. A power law, time ~ size^exponent, is fitted to each.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from irtscots_cl.bench.fits import fit_exponent
from irtscots_cl.bench.wall import LIMITS, TIMES, time_on_cores, time_warm
from irtscots_cl.execution.launch_plan import MAX_RAYS_PER_ITEM
from irtscots_cl.opencl.device import Device, DeviceError
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene

ROUNDS = {True: 1, False: 3}  # quick or not
RAYS = {True: (1e5, 1e6, 1e7), False: (1e6, 1e7, 1e8, 1e9, 1e10)}  # of the sweep over rays
RAYS_OF_A_POINT = {True: 1e7, False: 3e8}  # of every other sweep
SCREEN = {True: (21, 42), False: (21, 42, 84, 168)}  # pixels along each axis, on the same area
DETECTOR = {True: (63, 125), False: (63, 125, 250, 500)}  # pixels along each axis, in the same field


@dataclass(frozen=True)
class Point:
    """One size of a sweep: the scene to trace and its rays per screen pixel. cores: number of cores, for a preset
    scene; None: all, in this process."""

    size: int
    scene: Scene
    rays_per_pixel: int
    cores: int | None = None


@dataclass(frozen=True)
class Sweep:
    """name: the quantity that grows; unit: of a size; fixed: the constant quantities; how: the size was set."""

    name: str
    unit: str
    fixed: str
    points: tuple[Point, ...]
    how: str = ""


def default_sweeps(device: Device, quick: bool) -> list[Sweep]:
    """The sweeps of `irtscots bench --scaling`; with quick, tiny ones."""
    sphere, total = load_scene("sphere"), RAYS_OF_A_POINT[quick]
    pixels = math.prod(sphere.screen.pixels)
    counts = [round(rays / pixels) for rays in RAYS[quick]]
    screens = [_with_screen(sphere, n) for n in SCREEN[quick]]
    detectors = [_with_detector(sphere, n) for n in DETECTOR[quick]]
    same = f"{total:,.0f} rays"
    return [
        Sweep("rays", "rays", "the preset sphere", tuple(Point(n * pixels, sphere, n) for n in counts)),
        Sweep("screen pixels", "pixels", f"{same}, screen of the same area",
              tuple(Point(n * n, s, round(total / n**2)) for n, s in zip(SCREEN[quick], screens, strict=True))),
        Sweep("detector pixels", "pixels", f"{same}, the same field",
              tuple(Point(n * n, s, round(total / pixels)) for n, s in zip(DETECTOR[quick], detectors, strict=True))),
        Sweep("cores", "cores", same,
              tuple(Point(n, sphere, round(total / pixels), n) for n in _core_counts(device)),
              f"in processes of their own, by affinity, {', '.join(LIMITS)}"),
    ]  # fmt: skip


def _with_screen(scene: Scene, n: int) -> Scene:
    """The scene with n x n screen pixels on the same area."""
    pitch_mm = scene.screen.pitch_mm * scene.screen.pixels[0] / n
    return dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, pixels=(n, n), pitch_mm=pitch_mm))


def _with_detector(scene: Scene, n: int) -> Scene:
    """The scene with n x n detector pixels in the same field."""
    detector = scene.camera.detector
    detector = dataclasses.replace(detector, pixels=(n, n), pitch_mm=detector.pitch_mm * detector.pixels[0] / n)
    return dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, detector=detector))


def _core_counts(device: Device) -> list[int]:
    """1, 2, 4, ... and all compute units of a CPU; 1 for another device, where time_on_cores says why it fails."""
    most = device.cl_device.max_compute_units if device.kind == "cpu" else 1
    return [2**k for k in range(most.bit_length()) if 2**k < most] + [most]


def time_point(point: Point, device: Device) -> dict[str, float]:
    """One warm timing of a point, on its number of cores."""
    if point.cores is None:
        return time_warm(point.scene, device, point.rays_per_pixel)
    return time_on_cores(point.scene.name, device, point.rays_per_pixel, point.cores)


def run_sweep(sweep: Sweep, device: Device, rounds: int, timer: Callable[[Point, Device], dict] = time_point) -> dict:
    """A sweep as plain data. A point that the device cannot run is listed with the reason and left out of the fit."""
    found: list[list[dict]] = [[] for _ in sweep.points]
    skipped: dict[int, str] = {}
    for _ in range(rounds):
        for k, point in enumerate(sweep.points):
            if k in skipped:
                continue
            try:
                found[k].append(timer(point, device))
            except (DeviceError, MemoryError) as error:
                skipped[k] = str(error) or "not enough memory"
    rows = [
        {"size": point.size, "skipped": skipped[k]} if k in skipped else {"size": point.size} | _spread(found[k])
        for k, point in enumerate(sweep.points)
    ]
    timed = [k for k in range(len(rows)) if k not in skipped]
    sizes = [sweep.points[k].size for k in timed]
    exponents = {}
    if len(timed) > 1:
        seconds = {name: np.array([[one[name] for one in found[k]] for k in timed]) for name in TIMES}
        exponents = {name: fit_exponent(sizes, values) for name, values in seconds.items()}
    facts = {"name": sweep.name, "unit": sweep.unit, "fixed": sweep.fixed, "how": sweep.how}
    return facts | {"points": rows, "exponents": exponents}


def _spread(timings: list[dict]) -> dict:
    """Median, lowest and highest of the rounds."""
    values = {name: [one[name] for one in timings] for name in TIMES}
    spread = {n: {"median": statistics.median(v), "lowest": min(v), "highest": max(v)} for n, v in values.items()}
    return {"rays": timings[0]["rays"]} | spread


def run_scaling(device: Device, quick: bool) -> dict:
    """All sweeps as plain data."""
    return {
        "rounds": ROUNDS[quick],
        "warm_up_rays_per_pixel": MAX_RAYS_PER_ITEM,
        "sweeps": [run_sweep(sweep, device, ROUNDS[quick]) for sweep in default_sweeps(device, quick)],
    }
