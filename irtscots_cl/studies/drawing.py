"""Figures of the studies in the paper's style: normalised irradiance in rainbow colours, y up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from irtscots_cl.report.fiducial import mark_x

COLOURS = "jet"  # as the paper's


def maps(
    panels: Sequence[tuple[str, np.ndarray]],
    label: str | Sequence[str],
    limits: Sequence[tuple[float, float] | None] | None = None,
    axes_labels: tuple[str, str] = ("detector column", "detector row"),
    columns: int = 3,
    of_detector: Sequence[bool] | None = None,
) -> Figure:
    """Maps side by side, each [rows, columns] with a title and a colour bar. limits: colour range of each map.

    of_detector: whether each lies as the camera sees the mirror, and is marked as such; None: all do.
    """
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(4.8 * min(columns, len(panels)), 4.1 * rows), layout="tight")
    grid = figure.subplots(rows, min(columns, len(panels)), squeeze=False).ravel()
    labels = [label] * len(panels) if isinstance(label, str) else label
    for k, (axes, (title, values)) in enumerate(zip(grid, panels, strict=False)):
        low, high = (None, None) if limits is None or limits[k] is None else limits[k]
        picture = axes.imshow(values, origin="lower", cmap=COLOURS, vmin=low, vmax=high)
        axes.set(title=title, xlabel=axes_labels[0], ylabel=axes_labels[1])
        if of_detector is None or of_detector[k]:
            mark_x(axes)
        figure.colorbar(picture, ax=axes, label=labels[k])
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    return figure


def curves(series: Sequence[tuple[str, np.ndarray, np.ndarray, str]], x_label: str, y_label: str) -> Figure:
    """Lines and symbols in one panel: (label, x, y, Matplotlib format) each."""
    figure = Figure(figsize=(6.4, 4.6), layout="tight")
    axes = figure.subplots()
    for label, x, y, style in series:
        axes.plot(x, y, style, label=label, fillstyle="none")
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return figure
