#!/usr/bin/env python3
"""Print what is left of height errors, and what fixed settings reach, as tables: tools/accuracy.py [SCENE ...].

The first two tables of docs/accuracy.md. A few minutes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.analysis.error_terms import error_terms, rounding_height_nm
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import MEASURES, measure_by
from irtscots_cl.opencl.device import Device, select_device
from irtscots_cl.pipeline.simulate import simulate
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.trace import trace

SCENES = ("sphere-deviated", "off-axis", str(Path(__file__).parents[1] / "examples" / "off-axis-deviated.toml"))
# measure, precision, smoothed rays per pixel (Sobol points)
SETTINGS = (("paper", "fp32", 64), ("fine", "fp32", 32), ("fine", "fp32", 1024), ("refined", "fp64", 16384))
SEEDS = 3


def floors(scene: Scene, device: Device) -> None:
    """Parts of the height error without ray noise, by measure."""
    run = trace(scene, estimator="analytic")
    stack = run.images(LineScan(scene))
    rounding = TraceOptions("adjoint", "sobol", smoothing=True)
    columns: dict[str, dict[str, float]] = {}
    for name in MEASURES:
        result = measure_by(name, stack, scene.nominal())
        parts = error_terms(result, scene, name, run.options)
        column = {part.name: part.height_nm for part in parts if part.name != "ray noise"}
        whole = compare(result, scene).height_error_nm["piston_tilt"].value
        extra = {"float rounding, fp32": rounding_height_nm(result, scene, rounding, device)}
        columns[name] = column | {"all of these": whole} | extra
    print(f"\n{scene.name}: height error without ray noise [nm]\n")
    print("| part |" + "".join(f" `{name}` |" for name in columns))
    print("|---|" + "---|" * len(columns))
    for part in dict.fromkeys(name for column in columns.values() for name in column):
        print(f"| {part} |" + "".join(f" {c[part]:.2g} |" if part in c else " |" for c in columns.values()))


def reached(scene: Scene, device: Device) -> None:
    """Height error and times of fixed settings; mean over the seeds and its standard error."""
    print(f"\n{scene.name}: reached, adjoint, smoothed Sobol rays, {SEEDS} seeds, the last one's times\n")
    print("| measure, precision, rays per pixel | height error [nm] | tracing [s] | measuring [s] |")
    print("|---|---|---|---|")
    for name, precision, rays in SETTINGS:
        errors = []
        for seed in range(1, 1 + SEEDS):
            run = simulate(scene, measure=name, device=device, sampler="sobol", precision=precision, smoothing=True,
                           rays_per_pixel=rays, replicates=1, seed=seed)  # fmt: skip
            errors.append(run.comparison.height_error_nm["piston_tilt"].value)
        error = np.std(errors, ddof=1) / np.sqrt(SEEDS)
        seconds = run.report["seconds"]
        print(f"| `{name}`, {precision}, {rays:,} | {np.mean(errors):.3g} ± {error:.1g} | {seconds['trace']:.3g} | "
              f"{seconds['reconstruct']:.2g} |", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=SCENES, metavar="SCENE")
    parser.add_argument("--device")
    options = parser.parse_args()
    device = select_device(options.device)
    print(f"{device.name}, {device.describe()['driver']}")
    for name in options.scenes:
        scene = load_scene(name)
        floors(scene, device)
        reached(scene, device)


if __name__ == "__main__":
    main()
