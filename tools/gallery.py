#!/usr/bin/env python3
"""Draws the pictures of docs/gallery.md: runs the scripts of examples/ and draws what they have found.

Usage: tools/gallery.py [--quick] [NAME...], names of scripts without .py; all by default. Writes docs/gallery/NAME.png.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import runpy
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from readme_figure import draw_map

import irtscots_cl as irt
from irtscots_cl.formats.maps import open_map

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "gallery"
MOST_BYTES = 60_000  # of a picture
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")
Found = dict[str, Any]  # the script's variables; "printed": what it has said, "folder": where its files are


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="as the scripts' own option")
    parser.add_argument("names", nargs="*", metavar="NAME")
    options = parser.parse_args()
    for name in options.names or DRAWN:
        figure = Figure(figsize=(7, 2.8), layout="constrained")
        with tempfile.TemporaryDirectory() as folder:
            DRAWN[name](figure, run(name, options.quick, folder))
        path = OUT / f"{name}.png"
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=90)
        picture = Image.open(buffer).convert("RGB").quantize(128)
        picture.save(path, optimize=True)
        size = path.stat().st_size
        print(f"{path}: {size} bytes")
        if size > MOST_BYTES:
            print(f"tools/gallery.py: {path}: {size} bytes; must be at most {MOST_BYTES}", file=sys.stderr)
            return 1
    return 0


def run(name: str, quick: bool, folder: str) -> Found:
    """The variables of a script of examples/ after its run. folder: takes the place of its temporary ones."""
    path, printed = str(ROOT / "examples" / f"{name}.py"), io.StringIO()
    kept = mock.patch("tempfile.TemporaryDirectory", return_value=contextlib.nullcontext(folder))
    arguments = mock.patch.object(sys, "argv", [path] + ["--quick"] * quick)
    with kept, arguments, contextlib.redirect_stdout(printed):
        found = runpy.run_path(path, run_name="__main__")
    return found | {"printed": printed.getvalue(), "folder": Path(folder)}


def maps(figure: Figure, found: Found) -> None:
    """The measured deviation and its error."""
    result = found["result"]
    comparison = found["found"] if "found" in found else irt.compare(result, found["made"])
    left, right = figure.subplots(1, 2)
    inside = result.mask
    deviation_nm = 1e6 * (result.deviation_mm - np.mean(result.deviation_mm[inside]))
    rms = comparison.height_error_nm["piston_tilt"].value
    draw_map(left, result, deviation_nm, "measured deviation")
    draw_map(right, result, 1e6 * comparison.error_mm, f"its error: {rms:.2g} nm rms")


def study(figure: Figure, found: Found) -> None:
    """Height error against rays, a line for each aperture."""
    rows = [NUMBER.findall(line) for line in found["printed"].splitlines()[1:]]
    table = np.array([[float(number) for number in row[:4]] for row in rows])
    axes = figure.subplots()
    for aperture in np.unique(table[:, 0]):
        own = table[table[:, 0] == aperture]
        axes.errorbar(own[:, 1], own[:, 2], abs(own[:, 3]), marker="o", capsize=3, label=f"aperture {aperture:g} mm")
    axes.set(xscale="log", yscale="log", xlabel="rays per pixel", ylabel="height error [nm rms]")
    axes.legend()


def budget(figure: Figure, found: Found) -> None:
    """Bars of the sources' costs."""
    nm = {name: left[0] for name, left in found["found"].linear.nm.items()}
    names = sorted(nm, key=nm.get)[-10:]
    axes = figure.subplots()
    axes.barh(names, [nm[name] for name in names])
    axes.set(xlabel="rms height error [nm], piston and tilt removed", xscale="log")


def calibration(figure: Figure, found: Found) -> None:
    """Values found of the camera's place, less those it was built with, in their standard errors."""
    fit, true = found["found"].fit, {"camera.x_mm": 0.3, "camera.z_mm": 0.0, "camera.tilt_x_rad": 2e-4}
    for axes, (name, built) in zip(figure.subplots(1, len(true)), true.items(), strict=True):
        k = list(fit.names).index(name)
        axes.errorbar([0], [fit.values[k]], [fit.errors[k]], marker="o", capsize=6, label="found")
        axes.axhline(built, color="tab:orange", label="built")
        axes.axhline(0.0, color="grey", linestyle=":", label="believed")
        axes.set(title=name, xticks=[])
    axes.legend()


def fringes(figure: Figure, found: Found) -> None:
    """An image of the camera, and the measured map."""
    left, right = figure.subplots(1, 2)
    image = max((np.asarray(Image.open(path)) for path in found["paths"]), key=lambda seen: seen[seen > 0].std())
    left.imshow(image, cmap="gray")
    left.set(title="an image of the camera", xticks=[], yticks=[])
    measured = open_map(found["folder"] / "result" / "result.h5")
    shown = 1e6 * (measured.heights_mm - np.nanmean(measured.heights_mm))
    picture = right.imshow(shown, origin="lower", cmap="RdBu_r")
    right.set(title=f"deviation: {np.nanstd(shown):.0f} nm rms", xticks=[], yticks=[])
    figure.colorbar(picture, ax=right, label="nm")


def ghosts(figure: Figure, found: Found) -> None:
    """Height that ghosts add, by the coating."""
    reflected = [float(one) for one in re.findall(r"reflects ([\d.]+)%", found["printed"])]
    height = [float(one) for one in re.findall(r"ghost: .* light, ([\d.e-]+)", found["printed"])]
    axes = figure.subplots()
    axes.loglog(reflected, height, "o-")
    axes.set(xlabel="each surface of the lens reflects [%]", ylabel="height by ghosts [nm rms]")


def scatter(figure: Figure, found: Found) -> None:
    """Scattered light of the mirror and of the lens, and what it does to the heights."""
    rows = re.findall(r"(\w+): ([\d.e-]+) of the direct light, ([\d.e-]+)", found["printed"])
    parts = [row[0] for row in rows]
    for axes, k, label in zip(figure.subplots(1, 2), (1, 2), ("over the direct light", "height [nm rms]"), strict=True):
        axes.bar(parts, [float(row[k]) for row in rows], width=0.5)  # the mirror's is smaller by far
        axes.set(ylabel=label, yscale="log")


def devices(figure: Figure, found: Found) -> None:
    """The light curve of one pixel, from one device and from all."""
    axes = figure.subplots()
    for flux, name, style in zip(found["images"], ("one device", "all devices"), ("o", "-"), strict=True):
        axes.plot(flux.mean(0)[flux.shape[1] // 2] * 1e6, style, label=name)
    axes.set(xlabel="line of the screen", ylabel="flux of a pixel [µW]", title=found["printed"].splitlines()[-1])
    axes.legend()


DRAWN: dict[str, Callable[[Figure, Found], None]] = {
    "paper_in_20_lines": maps,
    "own_paraboloid": maps,
    "off_axis_with_a_map": maps,
    "fringes_from_files": fringes,
    "budget_and_tolerances": budget,
    "calibration_with_a_prior": calibration,
    "own_study": study,
    "ghost_study": ghosts,
    "scatter_study": scatter,
    "gpu_or_cluster": devices,
}


if __name__ == "__main__":
    sys.exit(main())
