#!/usr/bin/env python3
"""Print the errors and noise gains of the integration methods as a table: tools/integration_methods.py [--draws N].

The table of docs/accuracy.md: exact slopes of known surfaces at the points that the pixels of the preset
sphere-deviated see, integrated and compared with the heights; then white noise.
"""

from __future__ import annotations

import argparse
from time import perf_counter

import numpy as np

from irtscots_cl.maths.integration import METHODS, integrate_slopes, noise_gain
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.presets import load_scene

NM = 1e-6  # in mm


def bump(x_mm: np.ndarray, y_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Height and slopes of a Gaussian bump, 100 nm high, 47 mm wide at half height, off centre."""
    centre_x, centre_y, sigma = 160.0, -100.0, 20.0
    height = 100 * NM * np.exp(-((x_mm - centre_x) ** 2 + (y_mm - centre_y) ** 2) / (2 * sigma**2))
    return height, height * (centre_x - x_mm) / sigma**2, height * (centre_y - y_mm) / sigma**2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=256, help="maps of noise (default: 256)")
    options = parser.parse_args()
    scene = load_scene("sphere-deviated")
    footprint = Setup(scene.nominal()).chief_rays.footprint
    mask = footprint.coverage >= 0.5
    x, y = (np.where(mask, v, 0.0) for v in (footprint.x_mm, footprint.y_mm))
    design = Surface.of(scene.nominal().mirror)
    surfaces = (
        Surface.of(scene.mirror).deviation_at(x, y),
        bump(x, y),
        (design.sag(x, y), *design.gradient(x, y)),
    )
    print(f"{mask.sum()} pixels, {(footprint.coverage[mask] < 1).sum()} of them cut by the mirror's edge\n")
    print("| method | six terms | largest | bump | design | noise gain | time |")
    print("|---|---|---|---|---|---|---|")
    for method in METHODS:
        errors = []
        start = perf_counter()
        for height, slope_x, slope_y in surfaces:
            error = integrate_slopes(x, y, slope_x, slope_y, mask, method) - height
            errors.append(remove_terms(x, y, error, mask, "piston_tilt") / NM)
        seconds = (perf_counter() - start) / len(surfaces)
        six, other, sphere = (rms(error, mask) for error in errors)
        gain = noise_gain(x, y, mask, method, draws=options.draws)
        print(
            f"| `{method}` | {six:.1e} | {np.nanmax(np.abs(errors[0])):.1e} | {other:.1e} | {sphere:.1e} "
            f"| {gain.nm_per_urad:.2f} ± {gain.standard_error:.2f} | {seconds:.2f} s |"
        )


if __name__ == "__main__":
    main()
