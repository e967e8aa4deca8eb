"""Figures of a mirror measured by fringes. All maps are upright: seen from the camera."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from irtscots_cl.imaging.orientation import upright
from irtscots_cl.maths.arrays import IntArray
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.fiducial import MapFrame, mark_x
from irtscots_cl.report.figures import height_figure, slope_figure
from irtscots_cl.report.fringe_file import (
    REASON_WORDS,
    FringeMaps,
    noise_map,
    phase_residual,
    saturated_share,
    weakest_modulation,
)
from irtscots_cl.report.map_panel import SEQUENTIAL, SIGNED, add_millimetres
from irtscots_cl.report.mirror_edge import draw_edge
from irtscots_cl.system.atomic_files import replacing

COLOURS = (  # of the reasons, used first
    "#dddddd", "#7f7f7f", "#1f1f1f", "#d62728", "#ff7f0e", "#9467bd", "#8c564b", "#17becf", "#e377c2",
)  # fmt: skip
LEAST_WRONG = 1e-16  # probability of a wrong order: below, all are alike
QUANTILES = (0.5, 99.5)  # percent: single pixels at the rim do not set a scale


@dataclass(frozen=True)
class _Map:
    """values: [rows, columns] as stored. limits: None for those of nearly all pixels."""

    title: str
    unit: str
    values: np.ndarray
    colours: str = SEQUENTIAL
    limits: tuple[float, float] | None = None


def write_fringe_figures(folder: Path, result: Reconstruction, maps: FringeMaps) -> list[str]:
    """Write the figures as PNG files into the folder; return their names, the page of quality first."""
    figures = {
        "quality.png": quality_figure(maps, result),
        "screen.png": screen_figure(maps, result),
        "slopes.png": slope_figure(result),
        "height.png": height_figure(result, None),
    }
    for name, figure in figures.items():
        with replacing(folder / name) as temporary:
            figure.savefig(temporary, dpi=120)
    return list(figures)


def screen_figure(maps: FringeMaps, result: Reconstruction) -> Figure:
    """The places on the screen and their standard error, and the series' agreement."""
    axes = maps.coordinates.axes
    shown = [_Map(f"place on the screen, {axis}", "fraction", one.fraction) for axis, one in axes.items()]
    error = np.fmax.reduce([one.standard_error for one in axes.values()])
    misfit = np.fmax.reduce([one.misfit for one in axes.values()])
    shown += [
        _Map("standard error of the place", "fraction", error),
        _Map("misfit of the series", "chi² / freedom", misfit),
    ]
    figure = Figure(figsize=(18, 4.2), layout="tight")
    for place, one in zip(figure.subplots(1, 4), shown, strict=True):
        _draw(figure, place, one, maps, result)
    return figure


def quality_figure(maps: FringeMaps, result: Reconstruction) -> Figure:
    """One page: what the images say of every pixel, the worse of both axes, and why pixels are not used."""
    figure = Figure(figsize=(18, 8.6), layout="tight")
    places = list(figure.subplots(2, 4).flat)
    for place, one in zip(places, _quality_maps(maps), strict=False):
        _draw(figure, place, one, maps, result)
    if maps.reason is None:
        places[-1].set_axis_off()
    else:
        _draw_reasons(places[-1], maps.reason, maps, result)
    return figure


def _quality_maps(maps: FringeMaps) -> list[_Map]:
    axes = maps.coordinates.axes.values()
    seen = list(maps.second_harmonic.values()) or [np.full(maps.coordinates.mask.shape, np.nan)]
    largest = np.fmax.reduce([np.abs(values) for values in seen])
    second = np.where(np.isfinite(largest), np.fmax.reduce([np.where(np.abs(v) == largest, v, np.nan) for v in seen]),
                      np.nan)  # fmt: skip
    title = "second harmonic over the first" + ("" if np.isfinite(second).any() else "\n(these steps do not show it)")
    with np.errstate(divide="ignore", invalid="ignore"):
        wrong = np.log10(np.fmax(np.fmax.reduce([one.wrong for one in axes]), LEAST_WRONG))
    wrong = np.where(maps.coordinates.mask, wrong, np.nan)
    return [
        _Map("brightness", "counts", np.fmax.reduce([one.offset.mean(axis=0) for one in axes])),
        _Map("weakest modulation", "amplitude / mean", weakest_modulation(maps.coordinates)),
        _Map("largest phase residual", "rad", np.fmax.reduce([np.fmax.reduce(phase_residual(one)) for one in axes])),
        _Map("noise of a sample", "counts", np.fmax.reduce([noise_map(one) for one in axes])),
        _Map(title, "part of the first", second, SIGNED),
        _Map("saturated samples", "share", np.fmax.reduce([saturated_share(one) for one in axes]), "magma", (0.0, 1.0)),
        _Map("wrong fringe order", "log10 of the probability", wrong, "cividis", (np.log10(LEAST_WRONG), 0.0)),
    ]


def _limits(one: _Map, values: np.ndarray) -> dict[str, Any]:
    if one.limits is not None:
        return {"vmin": one.limits[0], "vmax": one.limits[1]}
    known = values[np.isfinite(values)]
    if not known.size:
        return {"vmin": 0.0, "vmax": 1.0}
    low, high = np.percentile(known, QUANTILES)
    if one.colours == SIGNED:
        low, high = -max(-low, high), max(-low, high)
    spare = 0.0 if high > low else 0.1 * abs(low) or 1.0  # one value is drawn in the middle of the scale
    return {"vmin": low - spare, "vmax": high + spare}


def _frame(maps: FringeMaps, result: Reconstruction) -> MapFrame:
    """The part of the images that was evaluated or lies on the mirror."""
    orientation = result.nominal.camera.detector.orientation
    mask = upright(maps.coordinates.mask, orientation) | result.on_mirror
    frame = MapFrame.of(result.x_mm, result.y_mm, mask)
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    # pixels beside the mirror see no point of it: the images' own rows and columns
    edges = columns[0] - 0.5, columns[-1] + 0.5, rows[0] - 0.5, rows[-1] + 0.5
    return MapFrame(frame.cut, edges, "detector column", "detector row", frame.towards)


def _draw(figure: Figure, axes: Axes, one: _Map, maps: FringeMaps, result: Reconstruction) -> None:
    frame = _frame(maps, result)
    values = upright(one.values, result.nominal.camera.detector.orientation)[frame.cut]
    picture = axes.imshow(values, origin="lower", extent=frame.extent, cmap=one.colours, **_limits(one, values))
    axes.set(title=one.title, xlabel=frame.x_label, ylabel=frame.y_label)
    add_millimetres(axes, MapFrame.of(result.x_mm, result.y_mm, result.on_mirror))
    mark_x(axes, frame.towards)
    draw_edge(axes, result, frame)
    figure.colorbar(picture, ax=axes, label=one.unit, shrink=0.8, pad=0.16)


def _draw_reasons(axes: Axes, reason: IntArray, maps: FringeMaps, result: Reconstruction) -> None:
    """Categories, with their counts on the mirror in the legend."""
    frame, orientation = _frame(maps, result), result.nominal.camera.detector.orientation
    lying = upright(reason, orientation)
    counts = np.bincount(lying[result.on_mirror], minlength=len(REASON_WORDS))
    shown = np.where(result.on_mirror | (lying == 0), lying, np.nan)[frame.cut]
    norm = BoundaryNorm(np.arange(len(COLOURS) + 1) - 0.5, len(COLOURS))
    axes.imshow(shown, origin="lower", extent=frame.extent, cmap=ListedColormap(COLOURS), norm=norm)
    axes.set(title="why pixels of the mirror are not used", xlabel=frame.x_label, ylabel=frame.y_label)
    mark_x(axes, frame.towards)
    draw_edge(axes, result, frame)
    parts = [
        Patch(facecolor=colour, edgecolor="black", linewidth=0.5, label=f"{words}: {count}")
        for colour, words, count in zip(COLOURS, REASON_WORDS, counts, strict=True)
        if count
    ]
    axes.legend(handles=parts, loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8, frameon=False)
