"""What a mirror's outline needs on a device: kernel file, structures and their values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.opencl.structs import outline_grid_dtype, outline_parts_dtypes, outline_polygon_dtypes
from irtscots_cl.optics.outline import Grid, Outline, Polygon, Ring

BITS = 16  # of a mask in each real of the tables: as kernels/mirror/outline_mask.cl


@dataclass(frozen=True)
class PackedOutline:
    """choice: member of the family of kernel files. structs: C structures, those that others contain first. value: of
    the scene's structure [()]. tables: [n] numbers that do not fit there."""

    choice: str
    structs: dict[str, np.dtype]
    value: np.ndarray
    tables: np.ndarray


def pack_outline(outline: Outline, real, first: int) -> PackedOutline:
    """An outline for the kernels. first: number of reals before it in the tables."""
    only = outline.parts[0] if len(outline.parts) == 1 else None
    if isinstance(only, Polygon) and outline.is_convex:
        return _polygon(only, real)
    if isinstance(only, Grid):
        return _grid(only, real, first)
    return _parts(outline, real)


def _polygon(polygon: Polygon, real) -> PackedOutline:
    structs = outline_polygon_dtypes(real, len(polygon.points))
    value = np.zeros((), structs["Outline"])
    value["planes"]["normal_x"], value["planes"]["normal_y"] = -polygon.normals.T
    value["planes"]["distance"] = -np.sum(polygon.points * polygon.normals, -1)
    return PackedOutline("polygon", structs, value, np.zeros(0))


def _parts(outline: Outline, real) -> PackedOutline:
    shapes = [*outline.parts, *outline.strips]
    sides = [_sides(shape) for shape in shapes]
    structs = outline_parts_dtypes(real, len(shapes), max(sum(len(side) for side in sides), 1))
    value = np.zeros((), structs["Outline"])
    value["part_count"], value["strip_count"] = len(outline.parts), len(outline.strips)
    first = 0
    for k, (shape, of_shape) in enumerate(zip(shapes, sides, strict=True)):
        part = value["parts"][k : k + 1]
        if isinstance(shape, Ring):
            part["x"], part["y"] = shape.x_mm, shape.y_mm
            part["outer2"], part["inner2"] = shape.outer_mm**2, shape.inner_mm**2
        part["first_side"], part["side_count"] = first, len(of_shape)
        for name, values in zip(("low_x", "low_y", "high_y", "slope"), of_shape.T, strict=True):
            value["sides"][name][first : first + len(of_shape)] = values
        first += len(of_shape)
    return PackedOutline("parts", structs, value, np.zeros(0))


def _sides(shape: object) -> np.ndarray:
    """Lower end x, y, upper end's y, and dx / dy [n, 4] of a polygon's sides that are not level."""
    if not isinstance(shape, Polygon):
        return np.zeros((0, 4))
    start, end = shape.points, np.roll(shape.points, -1, axis=0)
    steep = start[:, 1] != end[:, 1]
    rises = (end[:, 1] > start[:, 1])[:, None]
    low, high = np.where(rises, start, end)[steep], np.where(rises, end, start)[steep]
    return np.column_stack([low, high[:, 1], (high - low)[:, 0] / (high - low)[:, 1]])


def _grid(grid: Grid, real, first: int) -> PackedOutline:
    structs = outline_grid_dtype(real)
    value = np.zeros((), structs["Outline"])
    value["low_x"], value["low_y"] = grid.low_mm
    value["inverse_pitch_x"], value["inverse_pitch_y"] = (1 / pitch for pitch in grid.pitch_mm)
    value["rows"], value["columns"] = grid.values.shape
    value["first"] = first
    bits = np.zeros((-(-grid.values.size // BITS), BITS), bool)
    bits.ravel()[: grid.values.size] = grid.values.ravel()
    return PackedOutline("mask", structs, value, bits @ 2.0 ** np.arange(BITS))
