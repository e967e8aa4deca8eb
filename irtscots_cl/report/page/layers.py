"""The maps of a page: what there is to see of a measurement, on the detector's grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irtscots_cl.analysis.comparison import Comparison
from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.design_slopes import slopes_from_design
from irtscots_cl.report.fiducial import MapFrame, x_direction
from irtscots_cl.report.page.arrays import packed

MOST_PIXELS = 256  # of a map along its longer side: of larger detectors every so many rows and columns are shown


@dataclass(frozen=True)
class Layer:
    """One map. heights: whether low-order terms may be taken off it. signed: whether its colours are about zero. group:
    maps of one group share their scale."""

    name: str
    unit: str
    values: FloatArray = field(repr=False)
    heights: bool = False
    signed: bool = False
    group: str = ""


def layers_of(
    result: Reconstruction, bars: ErrorBars | None, comparison: Comparison | None, parts: tuple[ErrorTerm, ...]
) -> list[Layer]:
    """The maps of a result, the deviation first. comparison: of a simulation, whose truth is known."""
    error_mm = bars.height_mm if bars else result.height_standard_error_mm()
    layers = [Layer("deviation from the design", "nm", result.deviation_mm * 1e6, True, True, "deviation")]
    if comparison is not None:
        layers.append(Layer("error of the deviation", "nm", comparison.error_mm * 1e6, True, True))
    layers.append(Layer("standard error of the height", "nm", error_mm * 1e6))
    for axis, off in slopes_from_design(result).items():
        layers.append(Layer(f"slope {axis} from the design", "µrad", off * 1e6, False, True, "slope"))
    layers += [Layer(f"error: {part.name}", "nm", part.height_mm * 1e6, True, True, "parts") for part in parts]
    layers.append(Layer("height of the surface", "mm", result.height_mm))
    return layers


def grid_data(x_mm: FloatArray, y_mm: FloatArray, used: BoolArray, layers: Sequence[Layer]) -> dict[str, Any]:
    """Maps [rows, columns] as JSON for maps.js: every `step` rows and columns of the detector's, from the first.

    x_mm, y_mm: mirror points. used: the pixels that low-order terms are fitted to.
    """
    step = step_of(used.shape)
    shown = (slice(None, None, step), slice(None, None, step))
    return {
        "rows": used.shape[0],
        "columns": used.shape[1],
        "step": step,
        "towards": list(x_direction(x_mm, y_mm)),
        "mm": _edges_mm(x_mm, y_mm, used),
        "x": packed(x_mm[shown]),
        "y": packed(y_mm[shown]),
        "used": packed(used[shown].astype(np.int32)),
        "layers": [
            {"name": layer.name, "unit": layer.unit, "heights": layer.heights, "signed": layer.signed,
             "group": layer.group, "map": packed(layer.values[shown])}
            for layer in layers
        ],
    }  # fmt: skip


def _edges_mm(x_mm: FloatArray, y_mm: FloatArray, used: BoolArray) -> dict[str, list[float]] | None:
    """The mirror's x at the left and the right edge of the grid, and its y at the bottom and the top; None where the
    grid is turned against the mirror or seen at a slant."""
    if not used.any():
        return None
    frame = MapFrame.of(x_mm, y_mm, used)
    if "mm" not in frame.x_label:
        return None
    ends = {}
    for axis, cut, (low, high), count in (
        ("x", frame.cut[1], frame.extent[:2], used.shape[1]), ("y", frame.cut[0], frame.extent[2:], used.shape[0]),
    ):  # fmt: skip
        pitch = (high - low) / (cut.stop - cut.start)
        ends[axis] = [low - cut.start * pitch, high + (count - cut.stop) * pitch]
    return ends


def step_of(shape: tuple[int, ...]) -> int:
    """Of a detector [rows, columns], every so many rows and columns are shown."""
    return max(1, -(-max(shape) // MOST_PIXELS))


def map_data(
    result: Reconstruction, bars: ErrorBars | None, comparison: Comparison | None, parts: tuple[ErrorTerm, ...]
) -> dict[str, Any]:
    """The maps of a result as JSON for report.js, with what is told of a pixel."""
    step = step_of(result.mask.shape)
    shown = (slice(None, None, step), slice(None, None, step))
    details = {"slope x": (result.slope_x, "rad"), "slope y": (result.slope_y, "rad"),
               "centroid x": (result.centroid_x_mm, "mm"), "centroid y": (result.centroid_y_mm, "mm")}  # fmt: skip
    return grid_data(result.x_mm, result.y_mm, result.height_mask, layers_of(result, bars, comparison, parts)) | {
        "flags": packed(result.flags[shown].astype(np.int32)),
        "details": [{"name": name, "unit": unit, "map": packed(v[shown])} for name, (v, unit) in details.items()],
    }
