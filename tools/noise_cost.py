#!/usr/bin/env python3
"""Print what noise costs: tools/noise_cost.py [SCENE ...] [--noise FILE] [--repeats N].

Makes each scene's images in closed form and records them with the noise of the file; JSON: pixels, images of both
scans, and the least seconds of N recordings with one exposure of 1 and of 20 averaged frames.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

from irtscots_cl.imaging.detector import expose
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.scene.presets import load_scene, with_noise_file
from irtscots_cl.tracing.trace import trace

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "camera-12-bit.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["sphere-deviated"], metavar="SCENE")
    parser.add_argument("--noise", type=Path, default=EXAMPLE, metavar="FILE")
    parser.add_argument("--repeats", type=int, default=3, metavar="N")
    options = parser.parse_args()
    print(json.dumps([measure(name, options) for name in options.scenes], indent=2))


def measure(name: str, options: argparse.Namespace) -> dict[str, object]:
    """The costs of one scene."""
    scene = with_noise_file(load_scene(name), options.noise)
    clean = trace(scene, estimator="analytic").images(LineScan(scene))
    noise, response = scene.camera.detector.noise, scene.screen.response
    seconds = {}
    for frames in (1, 20):
        one = replace(noise, exposures=1, frames_averaged=frames)
        seconds[f"seconds_of_{frames}_frames"] = min(recording(clean, one, response) for _ in range(options.repeats))
    return {"scene": name, "pixels": scene.camera.detector.pixels, "images": sum(scene.screen.pixels), **seconds}


def recording(clean, noise, response) -> float:
    """Seconds of one recording."""
    started = time.perf_counter()
    expose(clean, noise, response)
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
