#!/usr/bin/env python3
"""Print what a simulation with a height map takes: tools/map_cost.py [--pixels N] [--nodes N] [OPTION ...].

Writes a MetroPro file of N x N random heights of 1 nm, and the preset `sphere` with it and N x N detector pixels; runs
`irtscots run` on that with the options in a process of its own. JSON: pixels, nodes, options, seconds on the clock and
of the processor (user and system), peak memory in GiB, and the seconds of its parts as report.json has them. --nodes 0:
the same scene without a map. Defaults: 1000 pixels and nodes; 64 smoothed rays per pixel.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from irtscots_cl.formats.height_map import HeightMap
from irtscots_cl.formats.maps import write_map
from irtscots_cl.scene.presets import load_scene, preset_text

USUAL = ("--rays-per-pixel", "64", "--replicates", "2", "--sampler", "sobol", "--smoothing")
GIB = 2.0**30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, default=1000, metavar="N")
    parser.add_argument("--nodes", type=int, default=1000, metavar="N", help="0: no map")
    options, others = parser.parse_known_args()
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(cost(Path(folder), options.pixels, options.nodes, tuple(others) or USUAL), indent=2))


def cost(folder: Path, pixels: int, nodes: int, how: tuple[str, ...]) -> dict[str, object]:
    """What one run takes."""
    scene = write_scene(folder, pixels, nodes)
    command = ["run", str(scene), "--out", str(folder / "out"), "--json", *how]
    started = time.perf_counter()
    subprocess.run([sys.executable, "-m", "irtscots_cl", *command], check=True, stdout=subprocess.DEVNULL)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = json.loads((folder / "out" / "report.json").read_text(encoding="utf-8"))["seconds"]
    return {"pixels": pixels, "nodes": nodes, "options": " ".join(how), "seconds": time.perf_counter() - started,
            "processor_seconds": used.ru_utime + used.ru_stime, "peak_gib": used.ru_maxrss * 1024 / GIB,
            "parts": seconds}  # fmt: skip


def write_scene(folder: Path, pixels: int, nodes: int) -> Path:
    """The scene's file, with its map beside it where it has one."""
    text = preset_text("sphere").replace("pixels = [125, 125]", f"pixels = [{pixels}, {pixels}]")
    path = folder / "scene.toml"
    text = text.replace("pitch_mm = 0.037", f"pitch_mm = {0.037 * 125 / pixels}")
    if nodes:
        pitch = 1.01 * load_scene("sphere").mirror.diameter_mm / nodes
        heights = np.random.default_rng(1).normal(scale=1e-6, size=(nodes, nodes))
        write_map(folder / "map.dat", HeightMap(heights, (pitch, pitch), 632.8))
        text += '\n[[mirror.map]]\nfile = "map.dat"\n'
    path.write_text(text, encoding="utf-8")
    return path


if __name__ == "__main__":
    main()
