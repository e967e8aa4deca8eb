#!/usr/bin/env python3
"""Print what measuring takes: tools/measure_speed.py [SCENE] [--pixels N] [--measure NAME ...] [--repeats N].

Traces a scene with 64 smoothed rays per pixel and eight replicates, and measures its images by each of the measures as
a command does: nothing of the design is known yet. JSON: pixels used, seconds of the trace, peak memory in GiB so far;
for each measure the seconds on the clock and of the processor, least of N. --pixels: of the detector along each axis,
which sees the same; default: the scene's own.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import time

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

RAYS = 64
GIB = 2.0**30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="sphere-deviated", metavar="SCENE")
    parser.add_argument("--pixels", type=int, metavar="N")
    parser.add_argument("--measure", nargs="+", default=["paper", "fine", "refined"], metavar="NAME")
    parser.add_argument("--repeats", type=int, default=3, metavar="N")
    options = parser.parse_args()
    print(json.dumps(cost(options), indent=2))


def cost(options: argparse.Namespace) -> dict[str, object]:
    """What the trace and each measure take."""
    scene = load_scene(options.scene)
    scene = scene if options.pixels is None else with_pixels(scene, options.pixels)
    started = time.perf_counter()
    stack = trace(scene, rays_per_pixel=RAYS, smoothing=True, seed=1).images(LineScan(scene))
    facts: dict[str, object] = {"scene": scene.name, "trace_seconds": time.perf_counter() - started}
    for name in options.measure:
        clock, processor = [], []
        for _ in range(options.repeats):
            started, used = time.perf_counter(), time.process_time()
            result = measure_by(name, stack, Setup(scene.nominal()))
            clock.append(time.perf_counter() - started)
            processor.append(time.process_time() - used)
        facts["pixels_used"] = result.pixels_used
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / GIB
        facts[name] = {"seconds": min(clock), "processor_seconds": min(processor), "peak_gib": peak}
    return facts


def with_pixels(scene: Scene, count: int) -> Scene:
    """The scene with count x count detector pixels on the same area."""
    detector = scene.camera.detector
    pitch = detector.pitch_mm * detector.pixels[0] / count
    detector = dataclasses.replace(detector, pixels=(count, count), pitch_mm=pitch)
    return dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, detector=detector))


if __name__ == "__main__":
    main()
