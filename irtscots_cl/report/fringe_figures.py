"""Figures of a mirror measured by fringes. Maps show the mirror from the front, places on the screen as stored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates
from irtscots_cl.report.figures import height_figure, slope_figure
from irtscots_cl.report.fringe_file import weakest_modulation
from irtscots_cl.system.atomic_files import replacing


def write_fringe_figures(folder: Path, result: Reconstruction, coordinates: ScreenCoordinates) -> list[str]:
    """Write the figures as PNG files into the folder; return their names."""
    figures = {
        "screen.png": screen_figure(coordinates),
        "slopes.png": slope_figure(result),
        "height.png": height_figure(result, None),
    }
    for name, figure in figures.items():
        with replacing(folder / name) as temporary:
            figure.savefig(temporary, dpi=120)
    return list(figures)


def screen_figure(coordinates: ScreenCoordinates) -> Figure:
    """The places on the screen, and the weakest modulation, with the rows and columns of the images."""
    figure = Figure(figsize=(13, 4.2), layout="tight")
    maps = {f"screen {axis}, fraction": one.fraction for axis, one in coordinates.axes.items()}
    maps["weakest modulation"] = weakest_modulation(coordinates)
    rows, columns = np.nonzero(coordinates.mask)
    cut = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
    edges = (columns.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5, rows.min() - 0.5)
    for axes, (title, values) in zip(figure.subplots(1, len(maps)), maps.items(), strict=True):
        picture = axes.imshow(values[cut], extent=edges)
        axes.set(title=title, xlabel="column", ylabel="row")
        figure.colorbar(picture, ax=axes)
    return figure
