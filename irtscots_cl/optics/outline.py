"""The outline of a mirror that is no whole disk, in float64: which points lie in it, and how far from its edge.

Frame: the mirror's x, y. Unit: mm. The device kernels have their own versions (kernels/mirror/outline_*.cl).
"""

from __future__ import annotations

import functools
import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.outline import corners_mm

if TYPE_CHECKING:
    from irtscots_cl.scene.mirror import Mirror
    from irtscots_cl.scene.outline import Outline as OutlineTable

LATTICE = 256  # points across a part where what spiders leave is looked for
ON_EDGE = 1e-9  # of a shape's size: nearer points get the direction of the side, not that from the nearest point

Depth = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Polygon:
    """A simple polygon. points: [n, 2] its corners, counterclockwise."""

    points: FloatArray = field(repr=False)

    @functools.cached_property
    def sides(self) -> tuple[FloatArray, FloatArray]:
        """Start [n, 2] and vector [n, 2] of each side."""
        return self.points, np.roll(self.points, -1, axis=0) - self.points

    @functools.cached_property
    def normals(self) -> FloatArray:
        """Unit normals [n, 2] of the sides, inwards."""
        along = self.sides[1]
        normal: FloatArray = np.stack([-along[:, 1], along[:, 0]], -1) / np.linalg.norm(along, axis=1, keepdims=True)
        return normal

    def contains(self, x_mm, y_mm) -> BoolArray:
        """Whether points lie inside, by the number of sides that a ray towards +x crosses."""
        inside = np.zeros(np.shape(x_mm), bool)
        # heights are compared with the corners' own: one that is computed anew may leave a gap between two sides
        for (x0, y0), (x1, y1) in zip(self.points, np.roll(self.points, -1, axis=0), strict=True):
            if y1 != y0:
                crossed = ((y0 <= y_mm) != (y1 <= y_mm)) & (x_mm < x0 + (y_mm - y0) * ((x1 - x0) / (y1 - y0)))
                inside ^= crossed
        return inside

    def box(self) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest (x, y)."""
        return self.points.min(0), self.points.max(0)

    def depth(self, x_mm, y_mm) -> Depth:
        """As Outline.depth."""
        nearest, toward_x, toward_y = (np.full(np.shape(x_mm), np.inf) for _ in range(3))
        inside = self.contains(x_mm, y_mm)
        sign = np.where(inside, 1.0, -1.0)
        tiny = ON_EDGE * float(np.abs(self.points).max())
        for (x0, y0), (u, v), (normal_x, normal_y) in zip(*self.sides, self.normals, strict=True):
            share = np.clip(((x_mm - x0) * u + (y_mm - y0) * v) / (u * u + v * v), 0.0, 1.0)
            away_x, away_y = x_mm - x0 - share * u, y_mm - y0 - share * v
            distance = np.hypot(away_x, away_y)
            closer = distance < nearest
            far = distance > tiny
            with np.errstate(invalid="ignore", divide="ignore"):
                toward_x = np.where(closer, np.where(far, sign * away_x / distance, normal_x), toward_x)
                toward_y = np.where(closer, np.where(far, sign * away_y / distance, normal_y), toward_y)
            nearest = np.where(closer, distance, nearest)
        return sign * nearest, toward_x, toward_y


@dataclass(frozen=True)
class Ring:
    """A disk about (x, y), or the ring between two circles."""

    x_mm: float
    y_mm: float
    outer_mm: float
    inner_mm: float = 0.0

    def contains(self, x_mm, y_mm) -> BoolArray:
        radius = np.hypot(x_mm - self.x_mm, y_mm - self.y_mm)
        return (radius <= self.outer_mm) & (radius >= self.inner_mm)

    def box(self) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest (x, y)."""
        middle = np.array([self.x_mm, self.y_mm])
        return middle - self.outer_mm, middle + self.outer_mm

    def depth(self, x_mm, y_mm) -> Depth:
        """As Outline.depth."""
        away_x, away_y = x_mm - self.x_mm, y_mm - self.y_mm
        radius = np.hypot(away_x, away_y)
        beyond, within = self.outer_mm - radius, radius - self.inner_mm
        outer = (beyond <= within) | (self.inner_mm == 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            turn = np.where(outer, -1.0, 1.0) / radius
            toward = np.nan_to_num(away_x * turn), np.nan_to_num(away_y * turn)
        return np.where(outer, beyond, within), *toward


@dataclass(frozen=True)
class Grid:
    """A picture of the mirror. values: [rows, columns] true on the mirror; row 0 has the lowest y. low_mm: the corner
    (x, y) of its first pixel; pitch_mm: along x and y."""

    values: BoolArray = field(repr=False)
    low_mm: tuple[float, float]
    pitch_mm: tuple[float, float]

    def _pixel(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray, BoolArray]:
        """Row and column of the pixels that points lie in, within the picture, and which points do lie in it."""
        rows, columns = self.values.shape
        places = [(np.asarray(v) - low) / pitch for v, low, pitch in
                  zip((x_mm, y_mm), self.low_mm, self.pitch_mm, strict=True)]  # fmt: skip
        with np.errstate(invalid="ignore"):
            within = (places[0] >= 0) & (places[0] < columns) & (places[1] >= 0) & (places[1] < rows)
            column, row = (np.clip(np.nan_to_num(place), 0, n - 1).astype(int)
                           for place, n in zip(places, (columns, rows), strict=True))  # fmt: skip
        return row, column, within

    def meets(self, radius_mm: float, hole_mm: float) -> bool:
        """Whether a pixel of the mirror reaches into the disk about 0, 0 beyond its hole."""
        rows, columns = self.values.shape
        nearest, farthest = [], []
        for low, pitch, count in zip(self.low_mm, self.pitch_mm, (columns, rows), strict=True):
            start = low + pitch * np.arange(count)
            ends = np.stack([start, start + pitch])
            nearest.append(np.where(np.prod(ends, 0) <= 0, 0.0, np.abs(ends).min(0)) ** 2)
            farthest.append(np.abs(ends).max(0) ** 2)
        reaches = (np.add.outer(nearest[1], nearest[0]) <= radius_mm**2) & (
            np.add.outer(farthest[1], farthest[0]) >= hole_mm**2
        )
        return bool(np.any(reaches & self.values))

    def contains(self, x_mm, y_mm) -> BoolArray:
        row, column, within = self._pixel(x_mm, y_mm)
        return np.asarray(self.values[row, column] & within)

    @functools.cached_property
    def _steps(self) -> FloatArray:
        """Least distance [rows + 2, columns + 2] in mm of a point of a pixel from the edge: above 0 on the mirror."""
        from scipy.ndimage import distance_transform_edt  # imported late: few mirrors have a picture

        padded = np.pad(self.values, 1)
        spacing = self.pitch_mm[::-1]
        diagonal = float(np.hypot(*self.pitch_mm))
        tiny = 1e-6 * diagonal
        inside = np.maximum(distance_transform_edt(padded, spacing) - diagonal, tiny)
        outside = np.maximum(distance_transform_edt(~padded, spacing) - diagonal, tiny)
        return np.where(padded, inside, -outside)

    def depth(self, x_mm, y_mm) -> Depth:
        """As Outline.depth; the edge may be farther, by up to two pixels. Its directions are not told: 0."""
        row, column, within = self._pixel(x_mm, y_mm)
        high = [low + pitch * n for low, pitch, n in zip(self.low_mm, self.pitch_mm, self.values.shape[::-1],
                                                         strict=True)]  # fmt: skip
        beside = np.hypot(*(np.maximum(np.maximum(low - v, v - top), 0.0)
                            for v, low, top in zip((x_mm, y_mm), self.low_mm, high, strict=True)))  # fmt: skip
        depth = np.where(within, self._steps[row + 1, column + 1], np.minimum(-beside, -1e-12))
        none = np.zeros_like(depth)
        return depth, none, none


Part = Polygon | Ring | Grid


def _check_left(mirror: Mirror) -> None:
    """Refuse a mask that lies beside the mirror's disk or in its hole, and spiders that cover all of the mirror."""
    table = mirror.outline
    changed = os.stat(table.file).st_mtime_ns if table.is_mask else 0
    if _is_left(table, mirror.diameter_mm, mirror.obscuration_mm, changed):
        return
    if table.is_mask:
        raise ValueError(
            f"mirror.outline.file = {table.file!r}: has no pixel on the mirror, a disk of diameter "
            f"{mirror.diameter_mm:g} mm about 0, 0: must have one (centre_mm, pitch_mm)"
        )
    count = len(table.spider)
    raise ValueError(
        f"mirror.outline.spider = {count} table{'s' * (count > 1)}: must leave a part of the mirror, and nothing is "
        f"left at {LATTICE} x {LATTICE} points"
    )


@functools.lru_cache(maxsize=8)
def _is_left(table: OutlineTable, diameter_mm: float, obscuration_mm: float, changed: int) -> bool:
    """Whether something is left of the mirror. What spiders leave is looked for where the parts are. changed: when the
    mask's file was."""
    outline, radius = Outline.of_table(table, diameter_mm), diameter_mm / 2
    for part in outline.parts:
        if isinstance(part, Grid):
            return part.meets(radius, obscuration_mm / 2)
    middles = (np.arange(LATTICE) + 0.5) / LATTICE
    boxes = [part.box() for part in outline.parts if not isinstance(part, Grid)]
    for low, high in boxes or [(np.full(2, -radius), np.full(2, radius))]:
        low_x, low_y, high_x, high_y = *np.maximum(low, -radius), *np.minimum(high, radius)
        x, y = np.meshgrid(low_x + (high_x - low_x) * middles, low_y + (high_y - low_y) * middles)
        away = np.hypot(x, y)
        if np.any(outline.contains(x, y) & (away <= radius) & (away >= obscuration_mm / 2)):
            return True
    return False


@dataclass(frozen=True)
class Outline:
    """The union of parts, none of them for the whole plane, without the strips.

    is_convex: it is one convex polygon and nothing else.
    """

    parts: tuple[Part, ...]
    strips: tuple[Polygon, ...] = ()
    is_convex: bool = False

    @classmethod
    def of(cls, mirror: Mirror) -> Outline | None:
        """The outline of a scene's mirror; None of one that is a whole disk. Raises ValueError for a mask's file, and
        where spiders or a mask leave nothing of the mirror."""
        if mirror.outline is None:
            return None
        found = cls.of_table(mirror.outline, mirror.diameter_mm)
        if found.strips or found.has_grid:
            _check_left(mirror)
        return found

    @classmethod
    def of_table(cls, outline: OutlineTable, diameter_mm: float) -> Outline:
        """The outline of a table [mirror.outline], on a disk. Raises ValueError for a mask's file."""
        strips = [strip for spider in outline.spider for strip in spider.strips_mm(diameter_mm)]
        parts: tuple[Part, ...] = tuple(_part(shape) for shape in outline.shapes)
        if outline.is_mask:
            from irtscots_cl.scene.outline_mask import outline_mask  # imported late: few outlines are pictures

            values = outline_mask(outline)
            pitch, (rows, columns) = outline.pitch_xy_mm, values.shape
            low = tuple(c - n * p / 2 for c, n, p in zip(outline.centre_mm, (columns, rows), pitch, strict=True))
            parts = (Grid(values, (low[0], low[1]), pitch),)
        return cls(parts, tuple(Polygon(np.array(strip)) for strip in strips), outline.is_convex)

    @property
    def has_grid(self) -> bool:
        return any(isinstance(part, Grid) for part in self.parts)

    def contains(self, x_mm, y_mm, margin_mm: float = 0.0) -> BoolArray:
        """Whether points lie within the outline, widened by margin_mm; by up to two pixels more of a mask."""
        if margin_mm != 0.0:
            with np.errstate(invalid="ignore"):
                widened: BoolArray = self.depth(x_mm, y_mm)[0] >= (-margin_mm - self._blur_mm)
            return widened
        x, y = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(y_mm, float))
        inside = np.zeros(x.shape, bool) if self.parts else np.ones(x.shape, bool)
        with np.errstate(invalid="ignore"):
            for part in self.parts:
                inside |= part.contains(x, y)
            for strip in self.strips:
                inside &= ~strip.contains(x, y)
        return inside

    @property
    def _blur_mm(self) -> float:
        return max((2 * float(np.hypot(*part.pitch_mm)) for part in self.parts if isinstance(part, Grid)), default=0.0)

    def depth(self, x_mm, y_mm) -> Depth:
        """Distance [mm] of points from the edge, above 0 inside, and the direction (x, y) in which it grows.

        Where parts overlap, and beside the corner of a strip, the edge may be farther; it is never nearer.
        """
        x, y = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(y_mm, float))
        found = np.full(x.shape, -np.inf if self.parts else np.inf), np.zeros(x.shape), np.zeros(x.shape)
        with np.errstate(invalid="ignore"):
            for part in self.parts:
                found = _larger(found, part.depth(x, y))
            for strip in self.strips:
                depth, toward_x, toward_y = strip.depth(x, y)
                found = _smaller(found, (-depth, -toward_x, -toward_y))
        return found


def _part(shape) -> Part:
    if shape.shape == "circle":
        return Ring(*shape.centre_mm, shape.diameter_mm / 2, shape.obscuration_mm / 2)
    return Polygon(np.array(corners_mm(shape)))


def _larger(one: Depth, other: Depth) -> Depth:
    take = ~(one[0] > other[0])
    return tuple(np.where(take, b, a) for a, b in zip(one, other, strict=True))  # type: ignore[return-value]


def _smaller(one: Depth, other: Depth) -> Depth:
    take = ~(one[0] < other[0])
    return tuple(np.where(take, b, a) for a, b in zip(one, other, strict=True))  # type: ignore[return-value]
