#!/usr/bin/env python3
"""Print what fringe images cost: tools/fringe_speed.py [CASE ...] [--rounds N] [--against TREE].

small: 32 frames of 154 x 203 pixels in TIFF files decoded to places on the screen with error bars; reconstruct: all of
`irtscots reconstruct` on them but the start of Python and its modules; large: 64 frames of 2448 x 2048 pixels, read one
by one from a raw file, decoded. All have photon noise, a screen of gamma 2.2 and saturated samples; the mirror fills
the large frames. Every round is a process of its own, so that its peak memory is its own, too. JSON: for each the
median, least and most of wall and processor seconds and of the peak memory. --against runs another source tree in turn
with this one.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np

from irtscots_cl.bench.suite import peak_memory_mib
from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.scene.model import Scene

TREE = Path(__file__).resolve().parents[1]
LARGE = (2048, 2448)  # rows, columns
SMALL = (154, 203)
PERIODS = (0.9, 3.9, 15.9, 63.9)
SMALL_PERIODS = (0.9, 1.8, 2.7, 3.6)  # the preset's aperture blurs more
STEPS, SMALL_STEPS = 8, 4
TOP = 4095
GAMMA = 2.2
READ, ELECTRONS = 2.0, 5.0  # counts; electrons per count
DARK = 60.0
EXPOSURE = 1.02  # of the brightest sample, over the full scale: some pixels have saturated samples


class RawFrames(Sequence[np.ndarray]):
    """Frames of 16 bits in one file, read when they are asked for."""

    def __init__(self, path: Path, count: int, shape: tuple[int, int]) -> None:
        self.path, self.count, self.shape = path, count, shape

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, number):
        size = self.shape[0] * self.shape[1]
        return np.fromfile(self.path, np.uint16, size, offset=2 * size * number).reshape(self.shape)


def large_sets() -> tuple[FringeSet, ...]:
    return tuple(FringeSet.equal(axis, PERIODS, STEPS) for axis in "xy")


def frames_of(sets: tuple[FringeSet, ...], places: list[np.ndarray], bright: np.ndarray) -> Iterator[np.ndarray]:
    """Frames of the sets, whole numbers. places: by set, fractions [rows, columns]. bright: [rows, columns], 0 to 1."""
    random = np.random.default_rng(1)
    scale = EXPOSURE * TOP - DARK
    for fringes, place in zip(sets, places, strict=True):
        for periods, steps in zip(fringes.periods, fringes.steps_rad, strict=True):
            phase = (2 * np.pi * periods * place).astype(np.float32)
            for step in steps:
                counts = DARK + scale * bright * (0.5 + 0.5 * np.cos(phase - np.float32(step))) ** GAMMA
                noise = random.standard_normal(counts.shape, np.float32)
                counts += np.sqrt(READ**2 + counts / ELECTRONS) * noise
                yield np.clip(np.rint(counts), 0, TOP).astype(np.uint16)


def make_large(folder: Path) -> None:
    """A bent mirror's view of the screen, darker to one side."""
    row, column = (axis.astype(np.float32) for axis in np.mgrid[: LARGE[0], : LARGE[1]])
    x, y = (column - LARGE[1] / 2) / LARGE[0], (row - LARGE[0] / 2) / LARGE[0]
    places = [0.5 + 0.9 * x + 0.05 * x * y, 0.5 - 0.9 * y + 0.03 * x**2]
    bright = 1 - 0.3 * (x + LARGE[1] / LARGE[0] / 2)
    with (folder / "frames.raw").open("wb") as file:
        for frame in frames_of(large_sets(), places, bright):
            frame.tofile(file)


def small_scene() -> Scene:
    from irtscots_cl.scene.presets import load_scene

    scene = load_scene("sphere")
    detector = scene.camera.detector
    shrunk = min(old / new for old, new in zip(detector.pixels, SMALL[::-1], strict=True)) * detector.pitch_mm
    detector = replace(detector, pixels=SMALL[::-1], pitch_mm=shrunk)
    return replace(scene, camera=replace(scene.camera, detector=detector))


def make_small(folder: Path) -> None:
    """The preset's mirror by its chief rays, as TIFF files with their manifest."""
    import tifffile

    from irtscots_cl.imaging.fringe_manifest import FringeManifest, manifest_text
    from irtscots_cl.imaging.fringe_manifest import frames_of as manifest_frames
    from irtscots_cl.measurement.reconstruction import design_points
    from irtscots_cl.optics.setup import Setup

    scene = small_scene()
    setup, screen = Setup(scene), scene.screen
    sets = tuple(FringeSet.equal(axis, SMALL_PERIODS, SMALL_STEPS) for axis in "xy")
    points = design_points(setup)[2:]
    places = [
        np.nan_to_num(one.fraction(point, pixels, pitch))
        for one, point, pixels, pitch in zip(sets, points, screen.pixels, screen.pitch_xy_mm, strict=True)
    ]
    bright = setup.chief_rays.footprint.coverage
    counts = np.clip(np.rint([DARK + 0 * bright, DARK + (EXPOSURE * TOP - DARK) * bright]), 0, TOP).astype(np.uint16)
    (folder / "camera").mkdir()
    for k, frame in enumerate([*counts, *frames_of(sets, places, bright)]):
        tifffile.imwrite(folder / "camera" / f"IMG_{k + 1}.tif", frame)
    manifest = FringeManifest(scene.name, scene.screen.pixels, manifest_frames(sets), ("camera",), 8)
    (folder / "manifest.toml").write_text(manifest_text(manifest, "1"), encoding="utf-8")
    (folder / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")


def run_large(folder: Path) -> Callable[[], None]:
    from irtscots_cl.measurement.screen_coordinates import screen_coordinates

    sets = large_sets()
    frames = RawFrames(folder / "frames.raw", sum(one.count for one in sets), LARGE)

    def decode() -> None:
        screen_coordinates(FringeStack(sets, frames, saturation=TOP))

    return decode


def run_small(folder: Path) -> Callable[[], None]:
    from irtscots_cl.imaging.fringe_images import open_fringe_images
    from irtscots_cl.measurement.screen_coordinates import screen_coordinates

    scene = small_scene().nominal()

    def decode() -> None:
        screen_coordinates(open_fringe_images([folder], scene).stack(TOP))

    decode()  # modules are imported
    return decode


def run_reconstruct(folder: Path) -> Callable[[], None]:
    from irtscots_cl import cli

    arguments = ["reconstruct", str(folder), "--scene", str(folder / "scene.toml"), "--json"]

    def reconstruct(out: str = "result") -> None:
        with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
            code = cli.main([*arguments, "--out", str(folder / out)])
        if code:
            raise RuntimeError(f"reconstruct ended with exit code {code}")

    reconstruct("warm")  # modules are imported
    return reconstruct


CASES = {
    "small": (make_small, run_small),
    "reconstruct": (make_small, run_reconstruct),
    "large": (make_large, run_large),
}


def once(case: str, folder: Path) -> dict[str, float]:
    """Costs of one run in this process."""
    work = CASES[case][1](folder)
    wall, used = time.perf_counter(), time.process_time()
    work()
    costs = {"wall_s": time.perf_counter() - wall, "processor_s": time.process_time() - used}
    return costs | {"peak_memory_gib": (peak_memory_mib() or math.nan) / 2**10}


def measured(case: str, trees: list[Path], rounds: int) -> dict[str, dict[str, dict[str, float]]]:
    """By tree the median, least and most of each cost."""
    found: dict[Path, list[dict[str, float]]] = {tree: [] for tree in trees}
    with tempfile.TemporaryDirectory() as name:
        CASES[case][0](Path(name))
        for _ in range(rounds):
            for tree in trees:
                command = [sys.executable, __file__, case, "--once", name]
                environment = os.environ | {"PYTHONPATH": str(tree)}
                told = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
                found[tree].append(json.loads(told.stdout))
    return {str(tree): _summary(rows) for tree, rows in found.items()}


def _summary(rows: list[dict[str, float]]) -> dict[str, dict[str, float]]:
    def of(values: list[float]) -> dict[str, float]:
        named = {"median": statistics.median(values), "least": min(values), "most": max(values)}
        return {name: round(value, 3) for name, value in named.items()}

    return {key: of([row[key] for row in rows]) for key in rows[0]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "cases", nargs="*", choices=[*CASES, []], metavar="CASE", help=f"{', '.join(CASES)}; default all"
    )
    parser.add_argument("--rounds", type=int, default=5, metavar="N")
    parser.add_argument("--against", type=Path, metavar="TREE", help="another source tree, run in turn with this one")
    parser.add_argument("--once", type=Path, metavar="FOLDER", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.once is not None:
        print(json.dumps(once(options.cases[0], options.once)))
        return
    trees = [TREE] if options.against is None else [TREE, options.against.resolve()]
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    results = {case: measured(case, trees, options.rounds) for case in options.cases or CASES}
    print(json.dumps({"processors": os.cpu_count(), "load_average": load, **results}, indent=2))


if __name__ == "__main__":
    main()
