"""Figures of the error budget: tornado, cumulative sum, and maps of the sources that cost most."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from irtscots_cl.budget.assess import ErrorBudget
from irtscots_cl.budget.linear import LinearBudget
from irtscots_cl.budget.sensitivity import NM
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.report.fiducial import MapFrame, mark_x
from irtscots_cl.report.map_panel import SEQUENTIAL, SIGNED, add_pixels, statistics_text
from irtscots_cl.system.atomic_files import replacing

LEVELS = (0, 2, 3)  # of LEFT_AFTER, in the tornado: piston and tilt, + astigmatism, + coma
LABELS = ("piston, tilt removed", "+ power, astigmatism", "+ coma")
MOST_BARS, MOST_MAPS = 20, 5
SAME = 1e-3  # of the total: correlations that do not show


def write_budget_figures(found: ErrorBudget, folder: Path) -> list[str]:
    """Write them as PNG files into the folder; their names. Nothing for a budget without sources."""
    if found.linear is None:
        return []
    figures = {
        "tornado.png": tornado_figure(found.linear),
        "cumulative.png": cumulative_figure(found.linear),
        "maps.png": map_figure(found),
    }
    for name, figure in figures.items():
        with replacing(folder / name) as temporary:
            figure.savefig(temporary, dpi=120)
    return list(figures)


def _ranked(linear: LinearBudget) -> list[str]:
    return sorted(linear.nm, key=lambda name: -linear.nm[name][0])


def tornado_figure(linear: LinearBudget) -> Figure:
    """Bars of what each source costs, the largest at the top, with terms removed."""
    figure = Figure(figsize=(8, 1.6 + 0.32 * min(len(linear.nm), MOST_BARS)), layout="tight")
    draw_tornado(figure.subplots(), linear)
    return figure


def draw_tornado(axes: Axes, linear: LinearBudget) -> None:
    """tornado_figure on axes of one's own."""
    names = _ranked(linear)[:MOST_BARS]
    place = np.arange(len(names))
    for level, label, colour in zip(LEVELS, LABELS, ("#9ecae1", "#4292c6", "#084594"), strict=True):
        axes.barh(place, [linear.nm[name][level] for name in names], color=colour, label=label)
    axes.set_yticks(place, names)
    axes.invert_yaxis()
    left_out = len(linear.nm) - len(names)
    more = f"; {left_out} smaller ones are not shown" if left_out else ""
    axes.set(xlabel="rms height error [nm]", title=f"Height error of each source's standard deviation{more}")
    axes.legend(loc="lower right", fontsize=8)


def cumulative_figure(linear: LinearBudget) -> Figure:
    """Root of the sum of squares as sources are taken in, the largest first."""
    names = _ranked(linear)
    figure = Figure(figsize=(8, 4.8), layout="tight")
    axes: Axes = figure.subplots()
    for level, label, colour in zip(LEVELS, LABELS, ("#9ecae1", "#4292c6", "#084594"), strict=True):
        squares = np.cumsum([linear.nm[name][level] ** 2 for name in names])
        axes.plot(np.arange(1, len(names) + 1), np.sqrt(squares), "o-", ms=3, color=colour, label=label)
    shown = names[:MOST_BARS]
    axes.set_xticks(np.arange(1, len(shown) + 1), shown, rotation=60, ha="right", fontsize=7)
    title, total = "Root of the sum of squares of all sources up to this one", linear.total_nm[0]
    if abs(np.sqrt(sum(linear.nm[name][0] ** 2 for name in names)) - total) > SAME * total:
        title += f"; {total:.3g} nm with what is correlated"
    axes.set(ylabel="rms height error [nm]", ylim=(0, None), title=title)
    axes.legend(fontsize=8)
    return figure


def map_figure(found: ErrorBudget) -> Figure:
    """Height maps of one standard deviation of the sources that cost most, piston and tilt removed, on one scale; of a
    process one draw. And the standard deviation of the whole error at each pixel."""
    assert found.linear is not None
    names = _ranked(found.linear)[:MOST_MAPS]
    design = found.trials.design
    maps = []
    for name in names:
        height = np.atleast_2d(found.sensitivities[name].height_mm)[0] * found.trials.budget.sources[name].sigma
        maps.append(design.response.without(height[None], "piston_tilt")[0] * NM)
    figure = Figure(figsize=(15, 9), layout="tight")
    grid = figure.subplots(2, 3).ravel()
    largest = max((float(np.percentile(np.abs(values), 99.5)) for values in maps), default=1.0) or 1.0
    for axes, name, values in zip(grid, names, maps, strict=False):
        which = ", one draw" if found.sensitivities[name].source.kind.is_random else ""
        title = f"{name}{which}:\n{statistics_text(values, 'nm')}"
        _map(axes, found, values, title, SIGNED, -largest, largest)
    whole = found.linear.deviation_mm * NM
    _map(grid[-1], found, whole, f"standard deviation of all:\n{statistics_text(whole, 'nm')}", SEQUENTIAL, 0.0,
         float(np.percentile(whole, 99.5)) or 1.0)  # fmt: skip
    for axes in grid[len(names) : -1]:
        axes.set_axis_off()
    return figure


def _map(
    axes: Axes, found: ErrorBudget, values: FloatArray, title: str, colours: str, lowest: float, highest: float
) -> None:
    seen = found.trials.design.seen
    frame = MapFrame.of(seen.x_mm, seen.y_mm, seen.mask)
    picture = axes.imshow(seen.on_grid(values)[frame.cut], origin="lower", extent=frame.extent, cmap=colours,
                          vmin=lowest, vmax=highest)  # fmt: skip
    axes.set(xlabel=frame.x_label, ylabel=frame.y_label)
    axes.set_title(title, fontsize=9)
    mark_x(axes, frame.towards)
    add_pixels(axes, frame)
    axes.figure.colorbar(picture, ax=axes, label="nm", shrink=0.85, pad=0.13)
