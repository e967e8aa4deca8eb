"""Figures of a run. Images and maps lie as the camera sees the mirror, and a mark says where its +x is.

The mirror's x goes to the right and y up, but for a camera that is rolled: then they lie as its upright images.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from irtscots_cl.analysis.comparison import Comparison
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.pixel.chord import chord_cdf
from irtscots_cl.report.fiducial import MapFrame, mark_x, x_direction
from irtscots_cl.report.mirror_edge import draw_edge
from irtscots_cl.system.atomic_files import replacing

LIT = 0.1  # of a light curve's peak over its lowest sample: lines with more are shown
ALIKE = 2.0  # ratio of two curves' variances up to which they are compared


def write_figures(
    folder: Path,
    stack: ImageStack,
    result: Reconstruction,
    comparison: Comparison | None,
    parts: tuple[ErrorTerm, ...] = (),
) -> list[str]:
    """Write the figures of a run as PNG files into the folder; return their names.

    comparison: for a simulation, whose truth is known; None for images from a lab. parts: terms of the height error,
    empty if they were not computed.
    """
    figures = {
        "images.png": image_figure(stack, x_direction(result.x_mm, result.y_mm)),
        "light_curve.png": light_curve_figure(stack, result),
        "slopes.png": slope_figure(result),
        "height.png": height_figure(result, comparison),
    }
    if parts:
        figures["error_parts.png"] = parts_figure(result, parts)
    for name, figure in figures.items():
        with replacing(folder / name) as temporary:
            figure.savefig(temporary, dpi=120)
    return list(figures)


def _panels(rows: int, columns: int, width: float, height: float, bars: bool = True, title_lines: int = 1) -> Figure:
    """A figure of panels of that size in inches, with room for labels, titles and, with bars, for colour bars.

    The room is the same for all figures: finding it from the texts, by layout="tight", would lay out all of them twice.
    """
    figure = Figure(figsize=(width * columns, height * rows))
    left, bottom, top = 0.8, 0.55, 0.2 + 0.19 * title_lines
    right = 0.7 if bars else 0.15
    figure.subplots(
        rows,
        columns,
        gridspec_kw={
            "left": left / (width * columns),
            "right": 1 - right / (width * columns),
            "bottom": bottom / (height * rows),
            "top": 1 - top / (height * rows),
            "wspace": (left + right) / (width - left - right),
            "hspace": (bottom + top) / (height - bottom - top),
        },
    )
    return figure


def image_figure(stack: ImageStack, towards_x: tuple[float, float] = (1.0, 0.0)) -> Figure:
    """Camera images under a line at a third and one in the middle of the lines with light of each scan.

    towards_x: direction (column, row) of the mirror's +x.
    """
    figure = _panels(2, 2, 5, 4.25)
    for row, scan in zip((figure.axes[:2], figure.axes[2:4]), (stack.x, stack.y), strict=True):
        count = len(scan.positions_mm)
        lit = _lit_lines(scan)
        for axes, line in zip(row, (lit[len(lit) // 3], lit[len(lit) // 2]), strict=True):
            picture = axes.imshow(scan.image(line), origin="lower", cmap="inferno")
            axes.set(
                title=f"{scan.axis} scan, line {line + 1} of {count} at {scan.positions_mm[line]:.2f} mm",
                xlabel="detector column",
                ylabel="detector row",
            )
            mark_x(axes, towards_x)
            figure.colorbar(picture, ax=axes, fraction=0.06, pad=0.04, label=f"flux [{scan.unit}]")
    return figure


def _lit_lines(scan: Scan) -> IntArray:
    """Numbers of the lines with light, of all pixels together; all of them where none has any."""
    count = len(scan.positions_mm)
    inside = scan.lines < count
    light = np.bincount(scan.lines[inside], np.nan_to_num(scan.mean_w()[inside]), count)
    lit = np.flatnonzero(light > LIT / 10 * light.max())
    return lit if lit.size else np.arange(count)


def light_curve_figure(stack: ImageStack, result: Reconstruction) -> Figure:
    """Light curves of the used pixel nearest to the detector's centre, with centroids and the aperture's chord."""
    rows, columns = np.nonzero(result.mask)
    shape = result.mask.shape
    middle = np.argmin((rows - (shape[0] - 1) / 2) ** 2 + (columns - (shape[1] - 1) / 2) ** 2)
    row, column = rows[middle], columns[middle]
    figure = _panels(1, 2, 5, 4.2, bars=False)
    diameter = result.nominal.camera.aperture_diameter_mm
    for axes, scan, centroid in zip(
        figure.axes, (stack.x, stack.y), (result.centroid_x_mm, result.centroid_y_mm), strict=True
    ):
        n = np.flatnonzero(scan.pixels == row * shape[1] + column)[0]
        curve, error = scan.mean_w()[n], scan.standard_error_w()[n]
        inside = scan.lines[n] < len(scan.positions_mm)
        position = scan.positions_mm[scan.lines[n][inside]]
        centre = centroid[row, column]
        axes.errorbar(position, curve[inside], error[inside], fmt="o", capsize=3, label="images")
        draw_chord(axes, scan, position, curve[inside], centre, diameter)
        axes.axvline(centre, color="tab:red", lw=1, label=f"centroid {centre:.4f} mm")
        axes.set(
            title=f"{scan.axis} scan, pixel [{row}, {column}]",
            xlabel=f"line {scan.axis} on the screen [mm]",
            ylabel=f"flux [{scan.unit}]",
        )
        axes.legend(fontsize=8)
    return figure


def draw_chord(axes: Axes, scan: Scan, position: FloatArray, curve: FloatArray, centre: float, diameter: float) -> None:
    """Show the lines that have light, at least as much as the aperture's image, and the chord of the aperture there.

    The chord is the light of a mirror that is tested near its centre of curvature. Where the pixel's light is much
    narrower or wider than it, it is left out.
    """
    pitch = np.diff(scan.positions_mm).mean() if len(scan.positions_mm) > 1 else diameter
    half = pitch * scan.line_width / 2
    above = curve - np.nanmin(curve)
    lit = above > LIT * np.nanmax(above)
    if not lit.any():
        return
    low = min(centre - 0.8 * diameter, position[lit].min() - 1.5 * pitch)
    high = max(centre + 0.8 * diameter, position[lit].max() + 1.5 * pitch)
    axes.set_xlim(low, high)
    variance = np.average((position[lit] - centre) ** 2, weights=above[lit])
    of_chord = diameter**2 / 16 + half**2 / 3
    if of_chord / ALIKE < variance < of_chord * ALIKE:
        line = np.linspace(low, high, 400)
        chord = chord_cdf((line - centre + half) / (diameter / 2)) - chord_cdf((line - centre - half) / (diameter / 2))
        axes.plot(line, chord * (np.nansum(curve) / scan.line_width), "k:", label="Eq. (2), unit magnification")


def slope_figure(result: Reconstruction) -> Figure:
    """Measured slopes in both directions."""
    figure = _panels(1, 2, 5, 4.2)
    for axes, slope, axis in zip(tuple(figure.axes), (result.slope_x, result.slope_y), "xy", strict=True):
        _map(figure, axes, result, slope * 1e3, f"slope {axis}", "mrad", "viridis")
    return figure


def height_figure(result: Reconstruction, comparison: Comparison | None) -> Figure:
    """Height, deviation from the design and, if the truth is known, the error of the deviation."""
    count = 2 if comparison is None else 3
    figure = _panels(1, count, 5, 4.2)
    axes = tuple(figure.axes)
    _map(figure, axes[0], result, result.height_mm, "height", "mm", "viridis")
    deviation = result.levelled(result.deviation_mm) * 1e6
    _map(figure, axes[1], result, deviation, "deviation, piston and tilt removed", "nm", "RdBu_r")
    if comparison is not None:
        _map(figure, axes[2], result, comparison.error_mm * 1e6, "error, piston and tilt removed", "nm", "RdBu_r")
    return figure


def parts_figure(result: Reconstruction, parts: tuple[ErrorTerm, ...]) -> Figure:
    """A map for each term of the height error, each with its own scale."""
    columns = min(4, len(parts))
    rows = -(-len(parts) // columns)
    figure = _panels(rows, columns, 4.6, 4.0, title_lines=2)
    grid = tuple(figure.axes)
    for axes, part in zip(grid, parts, strict=False):
        name = f"{part.name}:\n{part.height_nm:.2g} nm rms"
        _map(figure, axes, result, part.height_mm * 1e6, name, "nm", "RdBu_r")
    for axes in grid[len(parts) :]:
        axes.set_axis_off()
    return figure


def _map(
    figure: Figure, axes: Axes, result: Reconstruction, values: FloatArray, title: str, unit: str, colours: str
) -> None:
    """One map on the detector's grid, labelled with the mirror coordinates of its rows and columns.

    Where the grid is turned against the mirror, or seen at a slant, it is labelled with rows and columns.
    """
    limits: dict[str, Any] = {}
    if colours == "RdBu_r":
        # single noisy rim pixels do not set the scale; a map of zeros gets scale 1
        largest = np.nanpercentile(np.abs(values), 99.5) or 1.0
        limits = {"vmin": -largest, "vmax": largest}
    frame = MapFrame.of(result.x_mm, result.y_mm, result.mask)
    picture = axes.imshow(values[frame.cut], origin="lower", extent=frame.extent, cmap=colours, **limits)
    axes.set(title=title, xlabel=frame.x_label, ylabel=frame.y_label)
    mark_x(axes, frame.towards)
    draw_edge(axes, result, frame)
    figure.colorbar(picture, ax=axes, fraction=0.06, pad=0.04, label=unit)
