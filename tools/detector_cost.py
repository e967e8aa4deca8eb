#!/usr/bin/env python3
"""Print what tracing and measuring a large detector takes: tools/detector_cost.py [--pixels N] [OPTION ...].

A preset's detector gets N x N pixels on the same area. It is traced and measured once in this process, after a trace
of the preset itself, which builds the kernel. JSON: pixels that see the mirror, their windows on the screen, seconds in
kernels, of the trace (as report.json has them) and of all of `trace`, with the processor's seconds for that; the share
of either that is spent outside kernels; seconds to reconstruct; peak memory in GiB after the trace and after all.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace

import irtscots_cl as irt
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.memory import GIB, peak_bytes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="sphere-deviated", help="preset or file; default sphere-deviated")
    parser.add_argument("--pixels", type=int, default=1000, metavar="N", help="of each side of the detector")
    parser.add_argument("--screen", type=int, metavar="N", help="pixels of each side of the screen, on the same area")
    parser.add_argument("--rays-per-pixel", type=int, default=16384, metavar="N")
    parser.add_argument("--replicates", type=int, default=8, metavar="R")
    parser.add_argument("--sampler", default="philox")
    parser.add_argument("--smoothing", action="store_true")
    parser.add_argument("--measure", default="paper", metavar="M", help="or none: only traced")
    options = parser.parse_args()
    how = {name: getattr(options, name) for name in ("rays_per_pixel", "replicates", "sampler", "smoothing")}
    scene = irt.load_scene(options.scene)
    print(json.dumps(cost(scene, fine(scene, options.pixels, options.screen), how, options.measure), indent=2))


def fine(scene: Scene, pixels: int, screen_pixels: int | None) -> Scene:
    """The scene with so many pixels on the detector's area, and on the screen's."""
    detector, screen = scene.camera.detector, scene.screen
    pitch = detector.pitch_mm * detector.pixels[0] / pixels
    camera = replace(scene.camera, detector=replace(detector, pixels=(pixels, pixels), pitch_mm=pitch))
    if screen_pixels is not None:
        pitch = screen.pitch_xy_mm[0] * screen.pixels[0] / screen_pixels
        screen = replace(screen, pixels=(screen_pixels, screen_pixels), pitch_mm=pitch)
    return replace(scene, camera=camera, screen=screen)


def cost(scene: Scene, large: Scene, how: dict, measure: str) -> dict[str, object]:
    """What one trace and its measurement take. how: options of the trace."""
    device = irt.select_device(None)
    irt.trace(scene, device=device, **how)
    started, used = time.perf_counter(), time.process_time()
    run = irt.trace(large, device=device, **how)
    traced, used = time.perf_counter() - started, time.process_time() - used
    peak, started = peak_bytes(), time.perf_counter()
    if measure != "none":
        measure_by(measure, run.images(irt.LineScan(large)), Setup(large.nominal()))
    measured, kernels = time.perf_counter() - started, run.seconds["kernels"]
    return {
        "pixels": len(run.windows.pixels),
        "window": [run.windows.columns, run.windows.rows],
        "rays": run.rays_total,
        "seconds_kernels": round(kernels, 3),
        "seconds_trace": round(run.seconds["trace"], 3),
        "seconds_all_of_trace": round(traced, 3),
        "processor_seconds": round(used, 3),
        "share_outside_kernels": round(1 - kernels / run.seconds["trace"], 4),
        "share_outside_kernels_of_all": round(1 - kernels / traced, 4),
        "seconds_reconstruct": round(measured, 3),
        "peak_gib_traced": None if peak is None else round(peak / GIB, 2),
        "peak_gib": None if peak is None else round((peak_bytes() or 0.0) / GIB, 2),
    }


if __name__ == "__main__":
    main()
