"""A drawing of a set-up to scale, with traced rays: from the side, from the end, and the light on the screen."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.screen_model import ScreenModel
from irtscots_cl.planning.sight import Sight
from irtscots_cl.scene.instrument import Screen

RAYS = 9  # drawn in each view
LIGHT, VIEW, GLASS = "#d55e00", "#0072b2", "#444444"  # colours that all eyes tell apart (Okabe, Ito)


def setup_figure(sight: Sight) -> Figure:
    """The set-up from the side (x, z), from the end (y, z), and the light on the screen."""
    figure = Figure(figsize=(12, 6), layout="constrained")
    side, end, screen = figure.subplots(1, 3, width_ratios=(1, 1, 1.2))
    for axes, k in ((side, 0), (end, 1)):
        draw_view(axes, sight, k)
    _draw_screen(screen, sight)
    figure.suptitle(f"{sight.scene.name}: {sight.measured:.0%} of the mirror is seen and lit")
    return figure


def draw_view(axes: Axes, sight: Sight, k: int) -> None:
    """The mirror, the devices and rays, along axis k (0: x, 1: y) and z, to one scale."""
    scene, surface = sight.scene, sight.chief.surface
    radius = scene.mirror.diameter_mm / 2
    along = np.linspace(-radius, radius, 101)
    flat = np.zeros_like(along)
    axes.plot(along, surface.sag(*((along, flat) if k == 0 else (flat, along))), color=GLASS, lw=2)
    middle = np.abs((sight.y_mm, sight.x_mm)[k]) < 0.35 * radius
    chosen = np.flatnonzero(middle & sight.detected & sight.lit)
    at = (sight.x_mm, sight.y_mm)[k]
    chosen = chosen[np.argsort(at[chosen])]
    chosen = chosen[np.unique(np.linspace(0, max(len(chosen) - 1, 0), RAYS).astype(int))] if len(chosen) else chosen
    points = np.stack([sight.x_mm, sight.y_mm, surface.sag(sight.x_mm, sight.y_mm)], -1)
    landing = _world(scene.screen, sight.screen_column, sight.screen_row)
    for n in chosen:
        for to, colour in ((landing[n], LIGHT), (np.array(scene.camera.position_mm), VIEW)):
            axes.plot([points[n, k], to[k]], [points[n, 2], to[2]], color=colour, lw=0.6, alpha=0.8)
    corners = _world(scene.screen, *_outline(scene.screen))
    axes.plot(corners[:, k], corners[:, 2], color=LIGHT, lw=2.5, label="screen")
    camera = scene.camera.position_mm
    axes.plot([camera[k]], [camera[2]], "s", color=VIEW, ms=6, label="camera")
    axes.set(aspect="equal", xlabel=f"{'xy'[k]} [mm]", ylabel="z [mm]", title=("from the side", "from the end")[k])
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def _draw_screen(axes: Axes, sight: Sight) -> None:
    """Where the light falls on the screen's pixels, as seen from the mirror's side in the screen's own axes."""
    axes.plot(*_outline(sight.scene.screen), color=GLASS, label="screen's pixels")
    axes.plot(sight.rim_columns.ravel(), sight.rim_rows.ravel(), ".", color=LIGHT, ms=1, alpha=0.5)
    axes.plot(sight.screen_column, sight.screen_row, ".", color=LIGHT, ms=3, label="light of the mirror's points")
    axes.set(aspect="equal", xlabel="screen column", ylabel="screen row", title="light on the screen")
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def _outline(screen: Screen) -> FloatArray:
    """Columns and rows [2, 5] of the grid's corners, once around."""
    columns, rows = screen.pixels
    right, top = columns - 0.5, rows - 0.5
    return np.array([[-0.5, right, right, -0.5, -0.5], [-0.5, -0.5, top, top, -0.5]])


def _world(screen: Screen, column: FloatArray, row: FloatArray) -> FloatArray:
    """World points [n, 3] of fractional pixels."""
    return ScreenModel.of(screen).to_world(*screen.places_mm(column, row))
