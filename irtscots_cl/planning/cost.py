"""Seconds and memory of a run, from a trace of few rays on the device that would run it."""

from __future__ import annotations

import time
from dataclasses import replace

from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.planning.finding import Finding
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.memory import GIB, memory_bytes
from irtscots_cl.tracing.large_detectors import MARGIN, fit_memory, run_bytes
from irtscots_cl.tracing.trace import trace

PILOT_PIXELS = 48  # of the detector, along its longer side, in the trial
PILOT_RAYS = 4096  # per pixel
LONG_S = 600.0
LARGE = 0.6  # of the memory


def check_cost(setup: Setup, device: Device, rays_per_pixel: int, replicates: int) -> list[Finding]:
    """Seconds of tracing and memory of `irtscots run` with its usual estimator; none for scenes with elements."""
    scene = setup.scene
    if not scene.is_sequential:
        return []
    wanted = {"estimator": "adjoint", "smoothing": False, "rays_per_pixel": rays_per_pixel, "replicates": replicates}
    try:
        changes, line = fit_memory(setup, wanted, {})
    except ValueError as error:
        return [Finding("cost", "error", str(error))]
    wanted |= changes
    pixels = len(setup.windows(MARGIN).pixels)
    rays = pixels * wanted["rays_per_pixel"]
    seconds = rays / _rays_per_second(scene, device, wanted["smoothing"])
    nbytes = run_bytes(setup, wanted["replicates"], wanted["smoothing"])
    text = f"irtscots run: {rays:.2g} rays of {pixels} pixels, about {_time(seconds)} of tracing on {device.name} and "
    text += f"{nbytes / GIB:.2g} GiB of memory, of {memory_bytes() / GIB:.3g}"
    heavy = seconds > LONG_S or nbytes > LARGE * memory_bytes()
    if changes:
        text += f"; {line}"
    elif heavy:
        text += "; --smoothing --rays-per-pixel 64 has as little noise for a small part of both; or bin the pixels"
    return [Finding("cost", "warning" if heavy else "info", text)]


def _rays_per_second(scene: Scene, device: Device, smoothing: bool) -> float:
    """Of a trace with the detector binned to few pixels."""
    detector = scene.camera.detector
    factor = max(1, round(max(detector.pixels) / PILOT_PIXELS))
    binned = (max(1, detector.pixels[0] // factor), max(1, detector.pixels[1] // factor))
    camera = replace(scene.camera, detector=replace(detector, pixels=binned, pitch_mm=detector.pitch_mm * factor),
                     intrinsics=None)  # fmt: skip
    small = Setup(replace(scene, camera=camera, calibration=None, budget=None))
    trace(small, device=device, rays_per_pixel=8, replicates=1, smoothing=smoothing)
    started = time.perf_counter()
    traced = trace(small, device=device, rays_per_pixel=PILOT_RAYS, replicates=1, smoothing=smoothing)
    return float(traced.rays_total) / (time.perf_counter() - started)


def _time(seconds: float) -> str:
    for size, unit in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{max(seconds, 0.1):.2g} s"
