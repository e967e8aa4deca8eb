"""Heights where a map of a mirror has none: an edge is extrapolated, more is refused or made up as its table says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import FloatArray

if TYPE_CHECKING:
    from irtscots_cl.scene.outline import Outline as OutlineTable

EDGE_SHARE = 0.01  # of the mirror's diameter: an edge that is extrapolated
EDGE_NODES = 3.0  # and at least so many nodes
LATTICE = 401  # points across the mirror at which heights are looked for
NEAR = 0.75  # of a cell's diagonal: a point nearer to a height than that has one
RIM_NODES = 4  # added to the edge, so that the edge of the spline lies beside the mirror
CLIFF_NODES = 8  # of zeros around a map: its spline is flat beyond them


@dataclass(frozen=True)
class Aperture:
    """The part of a mirror that a map must cover: a disk without a hole, and of it what lies within an outline."""

    radius_mm: float
    hole_mm: float = 0.0
    outline: OutlineTable | None = None

    def points(self) -> tuple[FloatArray, int]:
        """Points (x, y) [2, n] of the mirror, and how many of them, the first ones, tell its area."""
        along = np.linspace(-self.radius_mm, self.radius_mm, LATTICE)
        x, y = (a.ravel() for a in np.meshgrid(along, along))
        radius, angle = np.hypot(x, y), np.linspace(0, 2 * np.pi, 4 * LATTICE)
        on = (radius <= self.radius_mm) & (radius >= self.hole_mm)
        area, rim = np.stack([x[on], y[on]]), self.radius_mm * np.stack([np.cos(angle), np.sin(angle)])
        if self.outline is not None:
            from irtscots_cl.optics.outline import Outline  # imported late: few mirrors are no disks

            outline = Outline.of_table(self.outline, 2 * self.radius_mm)
            area, rim = (points[:, outline.contains(*points)] for points in (area, rim))
        return np.concatenate([area, rim], axis=1), area.shape[1]


@dataclass(frozen=True)
class Completed:
    """heights: [rows, columns] without NaN. added: [2] columns and rows before the first. text: what was missing."""

    heights: FloatArray
    added: NDArray[np.intp]
    text: str
    refused: bool


def complete(
    heights: FloatArray,
    outer: list[tuple[int, int]],
    matrix: FloatArray,
    offset: FloatArray,
    outside: str,
    aperture: Aperture,
) -> Completed:
    """A map [rows, columns] with a height at every node, and with further nodes around it where the mirror needs them.

    outer: nodes that the mirror would have before the first and after the last, by column and by row. matrix, offset:
    from (x, y) on the mirror to (column, row). outside: of scene.height_map.MirrorMap.
    """
    pitch = 1 / np.linalg.norm(matrix, axis=1)  # along columns and rows
    edge_mm = max(2 * aperture.radius_mm * EDGE_SHARE, EDGE_NODES * float(pitch.max()))
    if outside == "refuse":  # a map that is far too small is not first given an edge
        text, refused = _missing(heights.shape, None, pitch, matrix, offset, edge_mm, aperture)
        if refused:
            return Completed(heights, np.zeros(2, int), text, True)
    most = {"refuse": np.ceil(edge_mm / pitch) + RIM_NODES, "nearest": np.zeros(2), "zero": np.full(2, CLIFF_NODES)}
    pads = [(min(before, int(n)), min(after, int(n))) for (before, after), n in zip(outer, most[outside], strict=True)]
    columns, rows = pads
    short = [max(0, 2 - size - sum(pad)) for size, pad in zip(heights.shape[::-1], pads, strict=True)]  # a single node
    columns, rows = (columns[0], columns[1] + short[0]), (rows[0], rows[1] + short[1])
    added = np.array([columns[0], rows[0]])
    if any(columns + rows):
        heights = np.pad(heights, (rows, columns), constant_values=np.nan)
    valid = np.isfinite(heights)
    if outside == "zero":
        return Completed(np.where(valid, heights, 0.0), added, "", False)
    if not valid.any():
        return Completed(heights, added, "has no valid height on the mirror", True)
    distance, nearest = _distances(valid, pitch)
    text, refused = "", False
    if outside == "refuse":
        text, refused = _missing(heights.shape, nearest, pitch, matrix, offset + added, edge_mm, aperture)
    if not refused and nearest is not None:
        heights = heights.copy() if not any(columns + rows) else heights
        _fill(heights, valid, distance, nearest, edge_mm if outside == "refuse" else 0.0)
    return Completed(heights, added, text, refused)


def _distances(valid: NDArray[np.bool_], pitch: FloatArray) -> tuple[FloatArray, NDArray[np.intp] | None]:
    """From every node to the nearest valid one [mm], and its indices [2, rows, columns]; None where all are valid."""
    if valid.all():
        return np.zeros(valid.shape), None
    from scipy.ndimage import distance_transform_edt  # imported late: few surfaces have a map

    distance, nearest = distance_transform_edt(~valid, sampling=(pitch[1], pitch[0]), return_indices=True)
    return distance, nearest


def _missing(
    shape: tuple[int, ...],
    nearest: NDArray[np.intp] | None,
    pitch: FloatArray,
    matrix: FloatArray,
    offset: FloatArray,
    edge_mm: float,
    aperture: Aperture,
) -> tuple[str, bool]:
    """What is said of the part of the mirror without heights, and whether it is too wide.

    nearest: of _distances, for a map of this shape [rows, columns].
    """
    points, inside = aperture.points()
    far = _gaps(matrix @ points + offset[:, None], shape, nearest, pitch)
    lacks = far > NEAR * np.hypot(*pitch)
    if not lacks.any():
        return "", False
    share, farthest = float(lacks[:inside].mean()) * 100, float(far.max())
    what = f"has no height on {share:.3g} % of the mirror, up to {farthest:.3g} mm from the nearest"
    if farthest > edge_mm:
        must = f'must come to within {edge_mm:.3g} mm, or outside must be "nearest" or "zero"'
        return f"{what}: {must}", True
    return f"{what}: extrapolated there", False


def _gaps(place: FloatArray, shape: tuple[int, ...], nearest: NDArray[np.intp] | None, pitch: FloatArray) -> FloatArray:
    """Distance [n] in mm of places (column, row) [2, n] from the middle of the nearest pixel with a height: of those
    that are nearest to one of the four nodes around a place."""
    last = np.array(shape[::-1])[:, None] - 1
    low = np.clip(np.floor(place), 0, last)
    found = np.full(place.shape[1], np.inf)
    for step in ((0, 0), (0, 1), (1, 0), (1, 1)):
        column, row = np.minimum(low + np.array(step)[:, None], last).astype(np.intp)
        valid = np.stack([column, row] if nearest is None else [nearest[1, row, column], nearest[0, row, column]])
        found = np.minimum(found, np.hypot(*((place - valid) * pitch[:, None])))
    return found


def _fill(
    heights: FloatArray, valid: NDArray[np.bool_], distance: FloatArray, nearest: NDArray[np.intp], edge_mm: float
) -> None:
    """Give nodes without a height that of the nearest one with; within edge_mm, go on with its slope.

    The slope is that between the nearest height and the one as far behind it: heights are mirrored about a point. From
    edge_mm to twice that it runs out, so that there is no step.
    """
    row, column = np.nonzero(~valid)
    near_row, near_column = (index[row, column] for index in nearest)
    made = heights[near_row, near_column]
    if edge_mm > 0:
        far_row, far_column = 2 * near_row - row, 2 * near_column - column
        rows, columns = heights.shape
        there = (far_row >= 0) & (far_row < rows) & (far_column >= 0) & (far_column < columns)
        there[there] = valid[far_row[there], far_column[there]]
        weight = np.clip(2 - distance[row, column] / edge_mm, 0, 1)[there]
        made[there] += weight * (made[there] - heights[far_row[there], far_column[there]])
    heights[row, column] = made
