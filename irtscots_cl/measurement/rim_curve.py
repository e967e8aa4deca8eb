"""Closed curves in the picture: where the design's rim, or any other outline of known shape, is expected."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree
from skimage.draw import polygon2mask

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.edge_profile import edge_share
from irtscots_cl.optics.chief_rays import ChiefRays

POINTS = 2048  # of a rim: straight parts between them leave a circle of 1000 pixels by 0.001 pixel
CORNER_RAD = 0.3  # turn within CORNER_PX to each side, from which on a place is a corner
CORNER_PX = 2.0


@dataclass(frozen=True)
class RimCurve:
    """points: [n, 2] (row, column) along a closed curve. hole: the mirror lies around it, not inside."""

    points: FloatArray = field(repr=False)
    hole: bool = False

    @classmethod
    def of_design(cls, chief: ChiefRays, radius_mm: float, hole: bool = False) -> RimCurve:
        """A circle about the mirror's centre, on its surface, as the camera sees it."""
        turn = 2 * np.pi * np.arange(POINTS) / POINTS
        return cls.along(chief, np.stack([radius_mm * np.cos(turn), radius_mm * np.sin(turn)], -1), hole)

    @classmethod
    def along(cls, chief: ChiefRays, points_mm: FloatArray, hole: bool = False) -> RimCurve:
        """A closed curve [n, 2] in the mirror's x, y, on its surface, as the camera sees it."""
        points = np.stack(chief.pixel(*points_mm.T), -1)
        return cls(points[np.isfinite(points).all(-1)], hole)

    @classmethod
    def of_polygon(cls, corners: FloatArray) -> RimCurve:
        """Straight sides between corners [n, 2] (row, column)."""
        share = np.arange(POINTS // len(corners))[:, None] / (POINTS // len(corners))
        sides = [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        return cls(np.concatenate(sides))

    def moved(self, shift: FloatArray, scale: float, centre: FloatArray) -> RimCurve:
        """The curve magnified by scale about a centre [2], then shifted by [2] pixels."""
        return RimCurve(centre + scale * (self.points - centre) + shift, self.hole)

    @cached_property
    def centre(self) -> FloatArray:
        """Middle [2] of the area inside."""
        (r, c), (r1, c1) = self.points.T, np.roll(self.points, -1, axis=0).T
        cross = r * c1 - r1 * c
        middle: FloatArray = np.array([((r + r1) * cross).sum(), ((c + c1) * cross).sum()]) / (3 * cross.sum())
        return middle

    @cached_property
    def area(self) -> float:
        """Pixels inside; below 0 for a curve that runs the other way round."""
        (r, c), (r1, c1) = self.points.T, np.roll(self.points, -1, axis=0).T
        return float((r * c1 - r1 * c).sum() / 2)

    @property
    def radius_px(self) -> float:
        """Of the circle with the same area."""
        return float(np.sqrt(abs(self.area) / np.pi))

    @cached_property
    def length(self) -> FloatArray:
        """Pixels along the curve to each point [n + 1]; the last is the whole."""
        steps = np.linalg.norm(np.roll(self.points, -1, axis=0) - self.points, axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def outward(self) -> FloatArray:
        """Unit normals [n, 2] at the points, away from the mirror."""
        ahead = np.roll(self.points, -1, axis=0) - np.roll(self.points, 1, axis=0)
        normal = np.stack([ahead[:, 1], -ahead[:, 0]], -1) * np.sign(self.area) * (-1.0 if self.hole else 1.0)
        unit: FloatArray = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        return unit

    @property
    def curvature(self) -> FloatArray:
        """Turn of the normal per pixel [n] at the points; above 0 where the mirror bulges, below 0 around a hole."""
        ahead = np.roll(self.points, -1, axis=0) - np.roll(self.points, 1, axis=0)
        turn = np.roll(self.outward, -1, axis=0) - np.roll(self.outward, 1, axis=0)
        curvature: FloatArray = np.sum(turn * ahead, -1) / np.maximum(np.sum(ahead * ahead, -1), 1e-300)
        return curvature

    @cached_property
    def corner(self) -> BoolArray:
        """Points [n] near which the curve turns so much that no straight edge fits."""
        spacing = self.length[-1] / len(self.points)
        apart = max(int(CORNER_PX / spacing), 1)
        if self.length[-1] / (2 * np.pi) < 3 * CORNER_PX:  # a small circle turns everywhere
            return np.zeros(len(self.points), bool)
        alike = np.sum(np.roll(self.outward, apart, axis=0) * np.roll(self.outward, -apart, axis=0), -1)
        limit = max(CORNER_RAD, 3 * 2 * CORNER_PX / self.radius_px)
        return np.asarray(alike < np.cos(min(limit, np.pi)))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def nearest(self, places: FloatArray) -> tuple[FloatArray, IntArray]:
        """Distance towards the mirror of places [m, 2] from the curve, and the numbers of its points near them."""
        number = self._tree.query(places)[1]
        return -np.sum((places - self.points[number]) * self.outward[number], -1), number

    def coverage(self, shape: tuple[int, int]) -> FloatArray:
        """Share [rows, columns] of every pixel that lies on the mirror's side of the curve."""
        inside = polygon2mask(shape, self.points)
        share = np.where(inside != self.hole, 1.0, 0.0)
        row, column = self.near(shape, 1.5)
        distance, number = self.nearest(np.stack([row, column], -1).astype(float))
        half = np.abs(self.outward[number]).sum(-1) / 2  # exactly 1 or 0 beyond it
        share[row, column] = np.where(
            np.abs(distance) < half, np.clip(edge_share(distance, self.outward[number]), 0, 1), distance > 0
        )
        return share

    def near(self, shape: tuple[int, int], reach: float) -> tuple[IntArray, IntArray]:
        """Rows and columns of the picture's pixels that lie within so many pixels of the curve."""
        touched = np.zeros(shape, bool)
        spacing = self.length[-1] / len(self.points)
        more = max(int(np.ceil(spacing)), 1)
        share = np.arange(more)[:, None, None] / more
        between = (self.points + share * (np.roll(self.points, -1, axis=0) - self.points)).reshape(-1, 2)
        wide = int(np.ceil(reach + 1))
        cells = np.rint(between).astype(int)
        cells = cells[((cells > -wide) & (cells < np.array(shape) + wide)).all(-1)]
        padded = np.pad(touched, wide)
        padded[cells[:, 0] + wide, cells[:, 1] + wide] = True
        padded = binary_dilation(padded, np.ones((2 * wide + 1, 1), bool))
        padded = binary_dilation(padded, np.ones((1, 2 * wide + 1), bool))
        row, column = np.nonzero(padded[wide:-wide, wide:-wide])
        if not row.size:
            return row, column
        distance = self._tree.query(np.stack([row, column], -1))[0]
        close = distance <= reach + spacing
        return row[close], column[close]
