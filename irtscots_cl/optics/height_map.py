"""Height maps on a mirror: each is a cubic B-spline on its own grid, turned and placed there; they add up. Unit: mm.

Nothing is resampled. Heights that a map lacks are made up first (optics/map_edges.py).
"""

from __future__ import annotations

import functools
import math
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.bicubic import BicubicSpline
from irtscots_cl.optics.departure import polar_points
from irtscots_cl.optics.map_edges import Aperture, complete
from irtscots_cl.scene.validation import problem
from irtscots_cl.system.memory import check_memory

if TYPE_CHECKING:
    from irtscots_cl.scene.height_map import HeightMap, MirrorMap
    from irtscots_cl.scene.mirror import Mirror

Slopes = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
BESIDE = 1.02  # of the mirror's radius: how far out rays meet its departures
MARGIN = 8  # nodes that are kept around it: the edge of a spline is felt to 1e-5 there
MAX_NODES = 8192  # on the mirror, along each axis: more leave single precision too little of a cell
BYTES_PER_NODE = 80  # of the arrays that exist at a time
IDLE = ("the file tells no wavelength",)  # warnings of readers that do not matter to heights in mm
ROWS = 256  # of nodes looked at together
EXTREMES = 200  # nodes of each kind
RIM_ANGLES = 64
MAX_SLOPE = 1.0  # as of a design's aspheric terms
LARGE_MM = 0.1  # heights beyond which a deviation's unit is doubtful


class MapWarning(UserWarning):
    """What a map's file leaves open, or what was made up for heights that it lacks."""


@dataclass(frozen=True, eq=False)
class PlacedMap:
    """A spline whose place (column, row) is matrix @ (x, y) + offset; matrix [2][2] in 1/mm."""

    spline: BicubicSpline
    matrix: tuple[tuple[float, float], tuple[float, float]]
    offset: tuple[float, float]

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        height, by_column, by_row = self.spline.at(*self._place(x_mm, y_mm))
        return height, *self.slopes(by_column, by_row)

    def bend(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Second derivatives by x twice, by x and y, by y twice [1/mm]."""
        twice, mixed, row_twice = self.spline.bend(*self._place(x_mm, y_mm))
        (a, b), (c, d) = self.matrix
        return (
            a * a * twice + 2 * a * c * mixed + c * c * row_twice,
            a * b * twice + (a * d + b * c) * mixed + c * d * row_twice,
            b * b * twice + 2 * b * d * mixed + d * d * row_twice,
        )

    def _place(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        (a, b), (c, d) = self.matrix
        return a * x_mm + b * y_mm + self.offset[0], c * x_mm + d * y_mm + self.offset[1]

    def slopes(self, by_column: FloatArray, by_row: FloatArray) -> tuple[FloatArray, FloatArray]:
        (a, b), (c, d) = self.matrix
        return a * by_column + c * by_row, b * by_column + d * by_row


def extreme_nodes(placed: PlacedMap, radius_mm: float) -> tuple[FloatArray, FloatArray]:
    """Points (x, y) [n] of the nodes within a radius with the largest slopes, heights, and heights times bends."""
    (a, b), (c, d) = np.linalg.inv(placed.matrix)
    rows, columns = placed.spline.shape
    from_left = np.arange(columns) - placed.offset[0]
    found = []
    for first in range(0, rows, ROWS):
        last = min(first + ROWS, rows)
        part = BicubicSpline(placed.spline.coefficients[first : last + 2])
        from_low = np.arange(first, last)[:, None] - placed.offset[1]
        x, y = a * from_left + b * from_low, c * from_left + d * from_low
        on = np.flatnonzero(x * x + y * y <= radius_mm**2)
        x, y = x.ravel()[on], y.ravel()[on]
        for score in _scores(part, placed.slopes):
            score = score.ravel()[on]
            best = np.argpartition(score, -EXTREMES)[-EXTREMES:] if len(on) > EXTREMES else slice(None)
            found.append((score[best], x[best], y[best]))
    kinds = (np.concatenate(found[k::3], axis=1) for k in range(3))
    x, y = np.concatenate([kind[1:, np.argsort(kind[0])[-EXTREMES:]] for kind in kinds], axis=1)
    return x, y


def _scores(spline: BicubicSpline, slopes_of: Slopes) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each [rows, columns] of a spline's nodes: slope squared, height, height times bend: what Newton steps feel."""
    height, by_column, by_row = spline.nodes()
    slope_x, slope_y = slopes_of(by_column, by_row)
    c = spline.coefficients
    bend = np.abs(c[1:-1, 2:] - 2 * c[1:-1, 1:-1] + c[1:-1, :-2]) + np.abs(
        c[2:, 1:-1] - 2 * c[1:-1, 1:-1] + c[:-2, 1:-1]
    )
    size = np.abs(height)
    return slope_x**2 + slope_y**2, size, size * bend


@dataclass(frozen=True, eq=False)
class MapDeparture:
    """The sum of height maps on a mirror of radius_mm."""

    maps: tuple[PlacedMap, ...]
    radius_mm: float

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height [mm] and its slopes dz/dx, dz/dy at points of any one shape."""
        height, slope_x, slope_y = (sum(parts) for parts in zip(*(m.at(x_mm, y_mm) for m in self.maps), strict=True))
        return height, slope_x, slope_y

    def bend(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Second derivatives by x twice, by x and y, by y twice [1/mm]."""
        twice, mixed, y_twice = (sum(parts) for parts in zip(*(m.bend(x_mm, y_mm) for m in self.maps), strict=True))
        return twice, mixed, y_twice

    @functools.cached_property
    def _extremes(self) -> list[tuple[FloatArray, FloatArray]]:
        return [extreme_nodes(placed, self.radius_mm) for placed in self.maps]

    def spread(self, aperture_radius_mm: float) -> tuple[FloatArray, FloatArray]:
        """Points (x, y) [n] of the mirror, close enough to find the extremes of the slopes; many on the rim."""
        points = [polar_points(aperture_radius_mm, RIM_ANGLES)]
        points += self._extremes
        return np.concatenate([x for x, _ in points]), np.concatenate([y for _, y in points])


def map_departure(mirror: Mirror) -> MapDeparture:
    """The maps of a scene's mirror, read from their files. The last ones are kept.

    Raises SceneError, with one line, for a file that cannot be read or a map that does not fit the mirror. What a file
    leaves open is a MapWarning.
    """
    stamps = tuple(entry.stamp() for entry in mirror.map)
    aperture = Aperture(mirror.diameter_mm / 2, mirror.obscuration_mm / 2, mirror.outline)
    return _departure(mirror.map, (*stamps, _mask_stamp(mirror)), aperture)


def _mask_stamp(mirror: Mirror) -> int | None:
    """What changes with the file of an outline's picture."""
    file = None if mirror.outline is None else mirror.outline.file
    return os.stat(file).st_mtime_ns if file is not None and os.path.isfile(file) else None


@functools.lru_cache(maxsize=2)
def _departure(tables: tuple[MirrorMap, ...], stamps: tuple, aperture: Aperture) -> MapDeparture:
    maps = []
    for number, table in enumerate(tables):
        read = table.read(number)
        for text in read.warnings:
            if text in IDLE:
                continue
            warnings.warn(f"{_named(table, number)}: {text}", MapWarning, stacklevel=2)
        maps.append(placed_map(table, read, number, aperture))
    departure = MapDeparture(tuple(maps), aperture.radius_mm)
    for number, (table, placed, place) in enumerate(zip(tables, maps, departure._extremes, strict=True)):
        _check_heights(placed, place, _named(table, number))
    return departure


def _check_heights(placed: PlacedMap, extremes: tuple[FloatArray, FloatArray], name: str) -> None:
    """Refuse slopes that no mirror has, warn of heights that no deviation has: a wrong unit makes both."""
    if not extremes[0].size:  # the map has a corner of the mirror's square, and the rest is made up
        return
    height, slope_x, slope_y = placed.at(*extremes)
    slope, height_mm = float(np.hypot(slope_x, slope_y).max()), float(np.abs(height).max())
    if not slope < MAX_SLOPE:
        must = f"must be below {MAX_SLOPE:g} (unit, factor, pitch_mm, scale)"
        raise problem(name, (), f"has slopes up to {slope:.3g} on the mirror: {must}")
    if height_mm > LARGE_MM:
        text = f"heights up to {height_mm:.3g} mm: a map is the deviation from the design; is its unit right?"
        warnings.warn(f"{name}: {text}", MapWarning, stacklevel=2)


def placed_map(table: MirrorMap, read: HeightMap, number: int, aperture: Aperture) -> PlacedMap:
    """A map as its table places it on a mirror, cut to it, with a height everywhere.

    Raises SceneError if it lies beside the mirror, has too many nodes, or lacks heights that it must have.
    """
    assert read.pitch_mm is not None
    matrix, offset = _place(table, read)
    radius_mm = aperture.radius_mm
    window = [  # nodes from first to last, by column and by row
        (math.floor(at - BESIDE * radius_mm * per_mm) - MARGIN, math.ceil(at + BESIDE * radius_mm * per_mm) + MARGIN)
        for at, per_mm in zip(offset, np.linalg.norm(matrix, axis=1), strict=True)
    ]
    rows, columns = read.heights_mm.shape
    kept = [(max(low, 0), min(high, count - 1)) for (low, high), count in zip(window, (columns, rows), strict=True)]
    if any(low > high for low, high in kept):
        x, y = np.linalg.solve(matrix, np.array([(columns - 1) / 2, (rows - 1) / 2]) - offset)
        text = f"the map lies beside the mirror, its middle at {x:.6g}, {y:.6g} mm: must lie on it (centre_mm, scale)"
        raise problem(_named(table, number), (), text)
    counts = [high - low + 1 for low, high in kept]
    if max(counts) > MAX_NODES:
        text = f"the mirror has {counts[0]} x {counts[1]} points of the map: must be at most {MAX_NODES} along an axis"
        raise problem(_named(table, number), (), text)
    check_memory(_named(table, number), BYTES_PER_NODE * counts[0] * counts[1])
    (left, right), (low, high) = kept
    heights = read.heights_mm[low : high + 1, left : right + 1] * table.factor
    shifted = offset - np.array([left, low])
    outer = [(start - first, last - end) for (first, last), (start, end) in zip(window, kept, strict=True)]
    edge = complete(heights, outer, matrix, shifted, table.outside, aperture)
    if edge.refused:
        raise problem(_named(table, number), (), edge.text)
    if edge.text:
        warnings.warn(f"{_named(table, number)}: {edge.text}", MapWarning, stacklevel=2)
    shifted = shifted + edge.added
    return PlacedMap(
        BicubicSpline.through(edge.heights),
        ((float(matrix[0, 0]), float(matrix[0, 1])), (float(matrix[1, 0]), float(matrix[1, 1]))),
        (float(shifted[0]), float(shifted[1])),
    )


def _place(table: MirrorMap, read: HeightMap) -> tuple[FloatArray, FloatArray]:
    """Matrix [2, 2] and offset [2] from (x, y) on the mirror to (column, row) of a map."""
    assert read.pitch_mm is not None
    turn, flip = math.radians(table.rotation_deg), table.flip or ""
    mirrored = np.diag([-1.0 if axis in flip else 1.0 for axis in "xy"])
    forward = table.scale * _rotation(turn) @ mirrored  # from the map's mm to the mirror's
    centre = forward @ read.centre_mm if table.centre_mm is None else np.array(table.centre_mm)
    matrix = np.diag(1 / np.array(read.pitch_mm)) @ np.linalg.inv(forward)
    rows, columns = read.heights_mm.shape
    return matrix, np.array([(columns - 1) / 2, (rows - 1) / 2]) - matrix @ centre


def _rotation(angle: float) -> FloatArray:
    """Anticlockwise; exact by multiples of a quarter, so that nodes stay where they are."""
    quarters = angle / (math.pi / 2)
    exact = round(quarters) if abs(quarters - round(quarters)) < 1e-12 else None
    cosine, sine = (
        (math.cos(angle), math.sin(angle)) if exact is None else ((1, 0, -1, 0)[exact % 4], (0, 1, 0, -1)[exact % 4])
    )
    return np.array([[cosine, -sine], [sine, cosine]], float)


def _named(table: MirrorMap, number: int) -> str:
    return f"mirror.map[{number}]" + (f".file = {table.file}" if table.file else "")
