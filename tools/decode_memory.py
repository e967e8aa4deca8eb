#!/usr/bin/env python3
"""Print the peak memory of decoding camera files to places on the screen: tools/decode_memory.py [options].

Writes 64 frames of 2448 x 2048 pixels as 12-bit TIFF (x and y fringes, 4 numbers of periods, 8 steps; 10 MB each), and
decodes them in a process of its own, as `irtscots reconstruct` does: files, calibration, survey, mask, places. JSON:
frames, pixels, seconds, peak memory in GiB, of it before anything was read, and the largest error of a place.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from irtscots_cl.system.memory import peak_bytes

PERIODS, STEPS, AXES = (0.9, 3.9, 15.9, 31.9), 8, "xy"
LEVEL, CONTRAST, NOISE = 2000.0, 1500.0, 10.0  # counts
GIB = 2.0**30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, nargs=2, default=(2448, 2048), metavar=("COLUMNS", "ROWS"))
    parser.add_argument("--calibrated", action="store_true", help="with dark and flat frames")
    parser.add_argument("--decode", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.decode is not None:
        print(json.dumps(decoded(options.decode)))
        return
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(peak(Path(folder), tuple(options.pixels), options.calibrated), indent=2))


def peak(folder: Path, pixels: tuple[int, int], calibrated: bool) -> dict[str, object]:
    """What decoding files of so many (columns, rows) takes, in a process of its own."""
    write(folder, pixels, calibrated)
    run = subprocess.run(
        [sys.executable, __file__, "--decode", str(folder)], capture_output=True, text=True, check=True
    )
    return json.loads(run.stdout)


def places(pixels: tuple[int, int]) -> dict[str, np.ndarray]:
    """Fractions [rows, columns] of the screen that the pixels see."""
    row, column = np.mgrid[: pixels[1], : pixels[0]]
    return {"x": 0.1 + 0.8 * column / pixels[0], "y": 0.1 + 0.8 * row / pixels[1]}


def is_lit(pixels: tuple[int, int]) -> np.ndarray:
    row, column = np.mgrid[-1 : 1 : 1j * pixels[1], -1 : 1 : 1j * pixels[0]]
    return row**2 + column**2 < 0.9


def write(folder: Path, pixels: tuple[int, int], calibrated: bool) -> None:
    """Fringe frames in `frames`, and calibration frames in `dark` and `flat`."""
    import tifffile

    random, lit, seen = np.random.default_rng(1), is_lit(pixels), places(pixels)

    def image(path: Path, light: np.ndarray | float) -> None:
        path.parent.mkdir(exist_ok=True)
        counts = 60 + light + NOISE * random.standard_normal(pixels[::-1], np.float32)
        tifffile.imwrite(path, np.clip(np.rint(counts), 0, 4095).astype(np.uint16))

    number = 0
    for axis in AXES:
        for periods in PERIODS:
            for step in range(STEPS):
                phase = 2 * np.pi * (periods * seen[axis] - step / STEPS)
                image(folder / "frames" / f"IMG_{number}.tif", lit * (LEVEL + CONTRAST * np.cos(phase)))
                number += 1
    for k in range(4 if calibrated else 0):
        image(folder / "dark" / f"{k}.tif", 0.0)
        image(folder / "flat" / f"{k}.tif", LEVEL)


def decoded(folder: Path) -> dict[str, object]:
    """Decode the files of a folder in this process."""
    from irtscots_cl.formats.images import open_frames
    from irtscots_cl.imaging.camera_files import CameraFiles
    from irtscots_cl.imaging.fringes import FringeSet, FringeStack
    from irtscots_cl.measurement.frame_survey import survey_frames
    from irtscots_cl.measurement.screen_coordinates import find_mask, screen_coordinates
    from irtscots_cl.pipeline.lab_camera import lab_camera

    started, before = time.perf_counter(), peak_gib()
    recorded = open_frames(folder / "frames")
    ceiling = min(recorded.saturation, survey_frames(recorded).ceiling)
    sets = tuple(FringeSet.equal(axis, PERIODS, STEPS) for axis in AXES)
    if (folder / "dark").exists():
        camera = CameraFiles(dark=(folder / "dark",), flat=(folder / "flat",))
        frames, ceiling = lab_camera(recorded, camera, ceiling).frames, float("inf")
    else:
        frames = recorded
    stack = FringeStack(sets, frames, saturation=ceiling)
    found = screen_coordinates(stack, mask=find_mask(stack))
    rows, columns = recorded.shape
    seen = places((columns, rows))
    errors = [float(np.nanmax(np.abs(found.axes[axis].fraction - seen[axis]))) for axis in AXES]
    return {
        "frames": len(recorded),
        "pixels": [columns, rows],
        "lit": int(found.mask.sum()),
        "seconds": time.perf_counter() - started,
        "peak_gib": peak_gib(),
        "before_gib": before,
        "largest_error": max(errors),
    }


def peak_gib() -> float:
    return (peak_bytes() or math.nan) / GIB


if __name__ == "__main__":
    main()
