"""Figures of a mirror measured by fringes. All maps are upright: seen from the camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from irtscots_cl.imaging.orientation import upright
from irtscots_cl.maths.arrays import IntArray
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates
from irtscots_cl.report.fiducial import mark_x, x_direction
from irtscots_cl.report.figures import height_figure, slope_figure
from irtscots_cl.report.fringe_file import weakest_modulation
from irtscots_cl.system.atomic_files import replacing


def write_fringe_figures(
    folder: Path, result: Reconstruction, coordinates: ScreenCoordinates, reason: IntArray | None = None
) -> list[str]:
    """Write the figures as PNG files into the folder; return their names. reason: see quality_figure."""
    figures = {
        "quality.png": quality_figure(coordinates, result, reason),
        "screen.png": screen_figure(coordinates, result),
        "slopes.png": slope_figure(result),
        "height.png": height_figure(result, None),
    }
    for name, figure in figures.items():
        with replacing(folder / name) as temporary:
            figure.savefig(temporary, dpi=120)
    return list(figures)


def screen_figure(coordinates: ScreenCoordinates, result: Reconstruction) -> Figure:
    """The places on the screen, and the weakest modulation. coordinates: of the images as stored."""
    maps = {f"screen {axis}, fraction": one.fraction for axis, one in coordinates.axes.items()}
    maps["weakest modulation"] = weakest_modulation(coordinates)
    return _maps_figure(maps, coordinates, result, (1, 3))


def quality_figure(coordinates: ScreenCoordinates, result: Reconstruction, reason: IntArray | None = None) -> Figure:
    """One page: brightness, modulation, residual, samples left out, confidence in the orders, agreement of the series,
    and, where it is known, why pixels are not used (fringe_file.REASON_UNIT). coordinates, reason: as stored."""
    axes = coordinates.axes.values()
    with np.errstate(divide="ignore", invalid="ignore"):
        residual = [np.fmax.reduce(one.residual / one.amplitude) for one in axes]
        confidence = [np.log10(np.maximum(one.wrong, 1e-16)) for one in axes]
    maps: dict[str, np.ndarray] = {
        "brightness, counts": np.fmax.reduce([one.offset.mean(axis=0) for one in axes]),
        "weakest modulation": weakest_modulation(coordinates),
        "largest residual over amplitude": np.fmax.reduce(residual),
        "samples left out": np.sum([np.nan_to_num(one.missing) for one in axes], axis=0),
        "log10 of the probability of a wrong order": np.fmax.reduce(confidence),
        "misfit of the series over its freedom": np.fmax.reduce([one.misfit for one in axes]),
        "standard error of the place, fraction": np.fmax.reduce([one.standard_error for one in axes]),
    }
    if reason is not None:
        maps["not used: 1 masked, 2 dark, 3 samples, 4 order, 5 disagree, 6 edge, 7 mark"] = reason.astype(float)
    return _maps_figure(maps, coordinates, result, (2, 4))


def _maps_figure(
    maps: dict[str, np.ndarray], coordinates: ScreenCoordinates, result: Reconstruction, shape: tuple[int, int]
) -> Figure:
    """Maps [rows, columns] of the images as stored, drawn upright and cut to the pixels that were evaluated."""
    orientation, towards = result.nominal.camera.detector.orientation, x_direction(result.x_mm, result.y_mm)
    figure = Figure(figsize=(13 if shape[1] == 3 else 18, 4.2 * shape[0]), layout="tight")
    rows, columns = np.nonzero(upright(coordinates.mask, orientation))
    cut = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
    edges = (columns.min() - 0.5, columns.max() + 0.5, rows.min() - 0.5, rows.max() + 0.5)
    places = list(figure.subplots(*shape).flat)
    for axes in places[len(maps) :]:
        axes.set_axis_off()
    for axes, (title, values) in zip(places, maps.items(), strict=False):
        picture = axes.imshow(upright(values, orientation)[cut], origin="lower", extent=edges)
        axes.set_title(title, fontsize=10)
        axes.set(xlabel="detector column", ylabel="detector row")
        mark_x(axes, towards)
        figure.colorbar(picture, ax=axes)
    return figure
