"""Figures of a run. Images and maps lie as the camera sees the mirror, and a mark says where its +x is.

The mirror's x goes to the right and y up, but for a camera that is rolled: then they lie as its upright images.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from irtscots_cl.analysis.comparison import Comparison
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.pixel.chord import chord_cdf
from irtscots_cl.report.design_slopes import slopes_from_design
from irtscots_cl.report.fiducial import MapFrame, mark_x
from irtscots_cl.report.map_panel import (
    LIGHT,
    SEQUENTIAL,
    SIGNED,
    add_millimetres,
    add_pixels,
    magnified,
    signed_limit,
    statistics_text,
    with_prefix,
)
from irtscots_cl.report.mirror_edge import draw_edge
from irtscots_cl.system.atomic_files import replacing

LIT = 0.1  # of a light curve's peak over its lowest sample: lines with more are shown
IMAGE_PIXELS = 400  # of a shown image along a side, about those of its panel
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
        "images.png": image_figure(stack, MapFrame.of(result.x_mm, result.y_mm, result.mask)),
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
    """A figure of panels of that size in inches, with room for labels, titles and, with bars, for second axes and
    colour bars.

    The room is the same for all figures: finding it from the texts, by layout="tight", would lay out all of them twice.
    """
    figure = Figure(figsize=(width * columns, height * rows))
    left, bottom, top = 0.8, 0.55, 0.2 + 0.19 * title_lines + 0.3 * bars
    right = 0.8 if bars else 0.15
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


def image_figure(stack: ImageStack, frame: MapFrame | None = None) -> Figure:
    """Camera images under two lines of each scan, at a third and at half of the lines with light, on one scale.

    frame: of the mirror's maps, for the direction of its +x and its millimetres.
    """
    figure = _panels(2, 2, 5.4, 4.7)
    shown = [(scan, line) for scan in (stack.x, stack.y) for line in shown_lines(scan)]
    images = [scan.image(line) for scan, line in shown]
    known = [image[np.isfinite(image)] for image in images]
    lowest = min((float(one.min()) for one in known if one.size), default=0.0)
    factor, unit = with_prefix(max((float(one.max()) for one in known if one.size), default=0.0), stack.x.unit)
    highest = max((factor * float(one.max()) for one in known if one.size), default=1.0)
    for axes, (scan, line), image in zip(tuple(figure.axes), shown, images, strict=True):
        rows, columns = image.shape
        picture = axes.imshow(
            _brightest(image) * factor,
            origin="lower",
            extent=(-0.5, columns - 0.5, -0.5, rows - 0.5),
            cmap=LIGHT,
            vmin=min(0.0, factor * lowest),
            vmax=highest,
        )
        axes.set(xlabel="detector column", ylabel="detector row")
        where = f"{scan.positions_mm[line]:.2f}".replace("-", "\N{MINUS SIGN}")
        axes.set_title(f"{scan.axis} scan, line {line + 1} of {len(scan.positions_mm)} at {where} mm", fontsize=10)
        add_millimetres(axes, frame)
        mark_x(axes, frame.towards if frame else (1.0, 0.0))
        figure.colorbar(picture, ax=axes, fraction=0.05, pad=0.13, label=f"signal [{unit}]" if unit == "DN" else
                        f"flux [{unit}]")  # fmt: skip
    return figure


def shown_lines(scan: Scan) -> tuple[int, int]:
    """Numbers of the lines at a third and at half of those with light, of all pixels together.

    What all lines have alike, such as a camera's offset, is no light of a line.
    """
    count = len(scan.positions_mm)
    inside = scan.lines < count
    light = np.bincount(scan.lines[inside], np.nan_to_num(scan.mean_w()[inside]), count)
    light = light - light.min()
    lit = np.flatnonzero(light > LIT * light.max())
    lit = lit if lit.size else np.arange(count)
    return int(lit[len(lit) // 3]), int(lit[len(lit) // 2])


def _brightest(image: FloatArray) -> FloatArray:
    """An image of at most IMAGE_PIXELS along each side: the largest value of each block, so that a line as thin as a
    pixel does not fade away."""
    step = -(-max(image.shape) // IMAGE_PIXELS)
    if step == 1:
        return image
    rows, columns = (-(-size // step) for size in image.shape)
    whole = np.full((rows * step, columns * step), np.nan)
    whole[: image.shape[0], : image.shape[1]] = image
    blocks = whole.reshape(rows, step, columns, step)
    brightest: FloatArray = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    return brightest


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
        axes.axvline(centre, color="tab:red", lw=1, label=f"centroid {centre:.4f} mm".replace("-", "\N{MINUS SIGN}"))
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
    """Measured slopes less the design's in both directions, on one scale."""
    figure = _panels(1, 2, 5.4, 4.6, title_lines=2)
    slopes = {axis: values * 1e6 for axis, values in slopes_from_design(result).items()}
    limit = signed_limit(list(slopes.values()))
    for axes, (axis, values) in zip(tuple(figure.axes), slopes.items(), strict=True):
        _map(figure, axes, result, values, f"slope {axis} from the design", "µrad", limit)
    return figure


def height_figure(result: Reconstruction, comparison: Comparison | None) -> Figure:
    """Height, deviation from the design and, if the truth is known, the error of the deviation."""
    count = 2 if comparison is None else 3
    figure = _panels(1, count, 5.4, 4.6, title_lines=2)
    axes = tuple(figure.axes)
    _map(figure, axes[0], result, result.height_mm, "height", "mm", None)
    maps = {"deviation, piston and tilt removed": result.levelled(result.deviation_mm) * 1e6}
    if comparison is not None:
        maps["error, piston and tilt removed"] = comparison.error_mm * 1e6
    for one, (name, values) in zip(axes[1:], maps.items(), strict=True):
        _map(figure, one, result, values, name, "nm", signed_limit([values]))
    return figure


def parts_figure(result: Reconstruction, parts: tuple[ErrorTerm, ...]) -> Figure:
    """A map for each term of the height error, on one scale; of small ones ten, a hundred ... times the map."""
    columns = min(4, len(parts))
    rows = -(-len(parts) // columns)
    figure = _panels(rows, columns, 5.0, 4.4, title_lines=2)
    grid = tuple(figure.axes)
    maps = [part.height_mm * 1e6 for part in parts]
    limit = signed_limit(maps)
    for axes, part, values in zip(grid, parts, maps, strict=False):
        _map(figure, axes, result, values, part.name, "nm", limit, magnified(values, limit))
    for axes in grid[len(parts) :]:
        axes.set_axis_off()
    return figure


def _map(
    figure: Figure,
    axes: Axes,
    result: Reconstruction,
    values: FloatArray,
    name: str,
    unit: str,
    limit: float | None,
    times: int = 1,
) -> None:
    """One map on the detector's grid, labelled with the mirror coordinates of its rows and columns and with their
    numbers; its rms and PV in the title.

    limit: of colours about zero; None for a map that is not about zero. times: that many times the map is shown.
    Where the grid is turned against the mirror, or seen at a slant, it is labelled with rows and columns alone.
    """
    colours: dict[str, Any] = {"cmap": SEQUENTIAL}
    if limit is not None:
        colours = {"cmap": SIGNED, "vmin": -limit, "vmax": limit}
    frame = MapFrame.of(result.x_mm, result.y_mm, result.mask)
    picture = axes.imshow(times * values[frame.cut], origin="lower", extent=frame.extent, **colours)
    axes.set(xlabel=frame.x_label, ylabel=frame.y_label)
    axes.set_title(f"{name}\n{statistics_text(values, unit, limit is not None)}", fontsize=10)
    if times > 1:
        outline = [withStroke(linewidth=2, foreground="white")]
        axes.text(
            0.03,
            0.97,
            f"shown \N{MULTIPLICATION SIGN} {times:,}",
            transform=axes.transAxes,
            va="top",
            fontsize=9,
            path_effects=outline,
        )
    add_pixels(axes, frame)
    mark_x(axes, frame.towards)
    draw_edge(axes, result, frame)
    figure.colorbar(picture, ax=axes, fraction=0.05, pad=0.13, label=unit)
