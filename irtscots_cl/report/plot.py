"""Quick looks: a scene, a trace, images, a result or a budget on Matplotlib axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from irtscots_cl.analysis.comparison import Comparison
from irtscots_cl.budget.assess import ErrorBudget
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.results.paths import PathLight
from irtscots_cl.tracing.results.transport import LineLight, Transport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIGNED, SEQUENTIAL = "PuOr_r", "cividis"  # colours that all eyes tell apart
OUTLIERS = 0.5  # percent of the pixels that do not set the scale of a signed map
MAPS = ("deviation", "height", "standard-error", "slope-x", "slope-y")


def plot(
    shown: Scene | Transport | LineLight | PathLight | ImageStack | Scan | Reconstruction | Comparison | ErrorBudget,
    axes: Axes | None = None,
    *,
    what: str | None = None,
    line: int | None = None,
) -> Axes:
    """Draw on Matplotlib axes, by default pyplot's current ones, and return them.

    A scene: the set-up to scale, along what = "x" (default) or "y". A trace: the light of each detector pixel. Images:
    those of the scan what = "x" (default) or "y" under a line, by default the brightest. A result: a map of MAPS, by
    default the deviation from the design, piston and tilt removed. A comparison: the error of the height. A budget:
    what each source costs. Raises ValueError for another `what` or line, or a budget without sources, TypeError for
    other objects.
    """
    if axes is None:
        from matplotlib import pyplot

        axes = pyplot.gca()
    if isinstance(shown, Scene):
        from irtscots_cl.planning.sight import Sight
        from irtscots_cl.report.setup_drawing import draw_view

        draw_view(axes, Sight.of(shown), "xy".index(_choice(what, ("x", "y"))))
    elif isinstance(shown, ErrorBudget):
        from irtscots_cl.report.budget_figures import draw_tornado

        if shown.linear is None:
            raise ValueError("the budget has no sources: nothing to draw; must have some, in scene.budget")
        draw_tornado(axes, shown.linear)
    elif isinstance(shown, Transport | LineLight | PathLight):
        _draw_light(axes, shown)
    elif isinstance(shown, ImageStack | Scan):
        scan = shown if isinstance(shown, Scan) else getattr(shown, _choice(what, ("x", "y")))
        _draw_image(axes, scan, line)
    elif isinstance(shown, Reconstruction):
        _draw_map(axes, shown, _choice(what, MAPS))
    elif isinstance(shown, Comparison):
        _draw_grid(axes, shown.error_mm * 1e6, "error of the height", "nm", signed=True)
    else:
        raise TypeError(f"{type(shown).__name__}: must be a scene, trace, images, result, comparison or budget")
    return axes


def _choice(what: str | None, allowed: tuple[str, ...]) -> str:
    if what is not None and what not in allowed:
        raise ValueError(f"what = {what!r}: must be one of {', '.join(allowed)}")
    return what or allowed[0]


def _draw_map(axes: Axes, result: Reconstruction, what: str) -> None:
    """A map over the mirror's x and y."""
    if what == "deviation":
        values, unit = result.levelled(result.deviation_mm) * 1e6, "nm"
    elif what == "standard-error":
        values, unit = result.height_standard_error_mm() * 1e6, "nm"
    else:
        maps = {"height": (result.height_mm, "mm"), "slope-x": (result.slope_x * 1e3, "mrad"),
                "slope-y": (result.slope_y * 1e3, "mrad")}  # fmt: skip
        values, unit = maps[what]
    drawn = axes.pcolormesh(*result.grid_mm(), values, shading="nearest", **_scale(values, what == "deviation"))
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", title=f"{result.nominal.name}: {what.replace('-', ' ')}")
    axes.figure.colorbar(drawn, ax=axes, label=unit)


def _draw_image(axes: Axes, scan: Scan, line: int | None) -> None:
    """The camera's image under a line."""
    count = len(scan.positions_mm)
    if line is None:
        inside = scan.lines < count
        light = np.bincount(scan.lines[inside], np.nan_to_num(scan.mean_w()[inside]), count)
        line = int(light.argmax())
    if not 0 <= line < count:
        raise ValueError(f"line = {line}: must be 0 to {count - 1}")
    title = f"{scan.axis} scan, line {line + 1} of {count}"
    _draw_grid(axes, scan.image(line), title, f"flux [{scan.unit}]")


def _draw_light(axes: Axes, run: Transport | LineLight | PathLight) -> None:
    """The flux of each detector pixel while the whole screen is lit."""
    columns, rows = run.scene.camera.detector.pixels
    light = np.zeros(rows * columns)
    light[run.windows.pixels] = run.mean_curves_w("x").sum(1)
    _draw_grid(axes, light.reshape(rows, columns), f"{run.scene.name}: light of the whole screen", "flux [W]")


def _draw_grid(axes: Axes, values: FloatArray, title: str, unit: str, signed: bool = False) -> None:
    """A map on the detector's rows and columns."""
    drawn = axes.imshow(values, origin="lower", **_scale(values, signed))
    axes.set(xlabel="detector column", ylabel="detector row", title=title)
    axes.figure.colorbar(drawn, ax=axes, label=unit)


def _scale(values: FloatArray, signed: bool) -> dict[str, Any]:
    """Colours, and for a signed map the limits on both sides of zero."""
    if not signed:
        return {"cmap": SEQUENTIAL}
    largest = float(np.nanpercentile(np.abs(values), 100 - OUTLIERS)) or 1.0
    return {"cmap": SIGNED, "vmin": -largest, "vmax": largest}
