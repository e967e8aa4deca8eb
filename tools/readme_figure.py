"""Draws docs/first-look.png from one run of the preset sphere-deviated: geometry, measured deviation, its error.

Usage: tools/readme_figure.py [--rays-per-pixel N] [--out FILE]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import irtscots_cl as irt
from irtscots_cl.maths.low_order import remove_terms
from irtscots_cl.optics.surface import Surface
from irtscots_cl.report.fiducial import mark_x

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rays-per-pixel", type=int, default=16384, metavar="N")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "first-look.png", metavar="FILE")
    options = parser.parse_args()
    scene = irt.load_scene("sphere-deviated")
    run = irt.trace(scene, rays_per_pixel=options.rays_per_pixel, seed=1)
    result = irt.reconstruct(run.images(irt.LineScan(scene)), scene.nominal())
    comparison = irt.compare(result, scene)
    rms_nm = comparison.height_error_nm["piston_tilt"]
    figure = Figure(figsize=(12, 3.5), layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.2, 1, 1))
    draw_geometry(left, scene)
    deviation = remove_terms(result.x_mm, result.y_mm, result.deviation_mm, result.mask, "piston_tilt")
    draw_map(middle, result, 1e6 * deviation, "measured deviation")
    draw_map(right, result, 1e6 * comparison.error_mm, f"its error: {rms_nm.value:.2g} nm rms")
    figure.savefig(options.out, dpi=110)
    print(f"{options.out}: height error, piston and tilt removed: {rms_nm} nm rms")
    return 0


def draw_geometry(axes: Axes, scene: irt.Scene) -> None:
    """The plane y = 0: mirror, screen, camera, and chief rays from the screen over the mirror to the camera."""
    surface = Surface.of(scene.mirror)
    half = scene.mirror.diameter_mm / 2
    x = np.linspace(-half, half, 200)
    axes.plot(surface.sag(x, 0 * x), x, color="black", linewidth=3)
    camera, screen = np.array(scene.camera.position_mm), np.array(scene.screen.position_mm)
    facing = screen - np.array(scene.screen.look_at_mm)
    for at in np.linspace(-0.9, 0.9, 7) * half:
        point = np.array([at, 0.0, float(surface.sag(at, 0.0))])
        normal = np.array([*(-float(slope) for slope in surface.gradient(at, 0.0)), 1.0])
        normal /= np.linalg.norm(normal)
        arriving = point - camera
        leaving = arriving - 2 * (arriving @ normal) * normal
        lit = point + leaving * ((screen - point) @ facing) / (leaving @ facing)
        axes.plot([lit[2], point[2], camera[2]], [lit[0], point[0], camera[0]], color="tab:orange", linewidth=0.8)
    for (x_mm, _, z_mm), name, marker in ((screen, "screen", "s"), (camera, "camera", "o")):
        axes.plot(z_mm, x_mm, marker, color="tab:blue", markersize=7)
        axes.annotate(name, (z_mm, x_mm), xytext=(-12, 10), textcoords="offset points", ha="right")
    axes.annotate("mirror", (float(surface.sag(half, 0.0)), half), xytext=(8, -2), textcoords="offset points")
    axes.set(title="the test", xlabel="z [mm]", ylabel="x [mm]", xlim=(-150, 1.08 * max(screen[2], camera[2])))


def draw_map(axes: Axes, result: object, map_nm: np.ndarray, title: str) -> None:
    """A map over the mirror, drawn as one looks at it: x to the right, y up; NaN outside the mask."""
    limit = np.nanmax(np.abs(map_nm))
    inside = result.mask
    extent = (np.nanmin(result.x_mm[inside]), np.nanmax(result.x_mm[inside]),
              np.nanmin(result.y_mm[inside]), np.nanmax(result.y_mm[inside]))  # fmt: skip
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    shown = np.where(inside, map_nm, np.nan)[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    picture = axes.imshow(shown, origin="lower", extent=extent, cmap="RdBu_r", vmin=-limit, vmax=limit)
    axes.set(title=title, xlabel="x [mm]", ylabel="y [mm]")
    mark_x(axes)
    axes.figure.colorbar(picture, ax=axes, label="nm")


if __name__ == "__main__":
    sys.exit(main())
