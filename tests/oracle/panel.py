"""A real screen, independent of the package: turned, with unequal pitches, bent, behind glass.

A place on the screen is told by its grid coordinates (u, v) in mm: u = (k - (columns - 1) / 2) px + offset of column k.
A sheet says where that place is in the screen's frame: a function of (u, v) that returns the point and its derivatives
by u and by v, each [..., 3]. The screen shines towards -z.

Glass of thickness T on a sheet: two readings of "a plane-parallel plate that follows the shape". "offset": its outer
face is the sheet moved by T along its own normals; a ray is refracted there, then meets the sheet. "local": the plate
is plane, parallel to the sheet's tangent plane at the pixel that the ray meets. They are the same for a plane sheet.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from oracle.picture import frame_axes

Sheet = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


def unit(vector) -> np.ndarray:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def plane_sheet(u, v):
    one, none = np.ones_like(u * v), np.zeros_like(u * v)
    return (
        np.stack([u * one, v * one, none], -1),
        np.stack([one, none, none], -1),
        np.stack([none, one, none], -1),
    )


def sag_sheet(terms, half_width: float, half_height: float, middle=(0.0, 0.0)) -> Sheet:
    """X = u, Y = v, Z = sum c s^i t^j over terms (i, j, c): s = u / half_width, t = v / half_height from the middle."""

    def sheet(u, v):
        point, along_u, along_v = plane_sheet(u, v)
        s, t = (u - middle[0]) / half_width, (v - middle[1]) / half_height
        for i, j, c in terms:
            point[..., 2] += c * s**i * t**j
            if i:
                along_u[..., 2] += c * i * s ** (i - 1) * t**j / half_width
            if j:
                along_v[..., 2] += c * j * s**i * t ** (j - 1) / half_height
        return point, along_u, along_v

    return sheet


def map_sheet(where: Callable[[np.ndarray, np.ndarray], np.ndarray], step: float = 1e-3) -> Sheet:
    """The sheet of any smooth map from (u, v) to points [..., 3]; derivatives by differences over +-step.

    They steer Newton's method and tilt glass: the map's own points decide where a bare sheet is.
    """

    def sheet(u, v):
        u, v = np.broadcast_arrays(u, v)
        return (
            where(u, v),
            (where(u + step, v) - where(u - step, v)) / (2 * step),
            (where(u, v + step) - where(u, v - step)) / (2 * step),
        )

    return sheet


def bilinear_map(u_knots, v_knots, points) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Points [len(u_knots), len(v_knots), 3], bilinear between the knots; the outermost cells go on beyond."""
    u_knots, v_knots, points = (np.asarray(k, float) for k in (u_knots, v_knots, points))

    def where(u, v):
        i = np.clip(np.searchsorted(u_knots, u) - 1, 0, len(u_knots) - 2)
        j = np.clip(np.searchsorted(v_knots, v) - 1, 0, len(v_knots) - 2)
        s = ((u - u_knots[i]) / (u_knots[i + 1] - u_knots[i]))[..., None]
        t = ((v - v_knots[j]) / (v_knots[j + 1] - v_knots[j]))[..., None]
        low = (1 - s) * points[i, j] + s * points[i + 1, j]
        return (1 - t) * low + t * ((1 - s) * points[i, j + 1] + s * points[i + 1, j + 1])

    return where


def refracted(direction, normal, ratio: float) -> np.ndarray:
    """Unit direction behind a face: its part along the face grows by ratio = n1 / n2 (Snell). All unit [..., 3]."""
    cosine = np.sum(direction * normal, -1, keepdims=True)
    along = ratio * (direction - cosine * normal)
    return along + np.sign(cosine) * np.sqrt(1 - np.sum(along**2, -1, keepdims=True)) * normal


@dataclass(frozen=True)
class Panel:
    """axes [3, 3]: rows x, y, z. pitch: (px, py). thickness, index, plate: of the cover glass, none where 0."""

    place: np.ndarray
    axes: np.ndarray
    size: tuple[int, int]
    pitch: tuple[float, float]
    offset: tuple[float, float] = (0.0, 0.0)
    sheet: Sheet = plane_sheet
    thickness: float = 0.0
    index: float = 1.0
    plate: str = "offset"
    radiance: float = 1.0

    @classmethod
    def of(cls, screen: dict, sheet: Sheet | None = None, plate: str = "offset") -> Panel:
        """The screen of a table [screen]. sheet: of measured points, which leave open what is between them."""
        place, target = np.array(screen["position_mm"], float), screen.get("look_at_mm", (0.0, 0.0, 0.0))
        pitch = screen["pitch_mm"]
        pitch = tuple(pitch) if isinstance(pitch, (list, tuple)) else (pitch, pitch)
        size = tuple(screen["pixels"])
        shape, glass = screen.get("shape"), screen.get("cover_glass", {})
        offset = tuple(screen.get("centre_offset_mm", (0.0, 0.0)))
        if sheet is None and shape is not None:
            sheet = sag_sheet(shape["sag_mm"], size[0] * pitch[0] / 2, size[1] * pitch[1] / 2, offset)
        return cls(
            place=place,
            axes=frame_axes(place, target, math.radians(screen.get("clocking_deg", 0.0))),
            size=size,
            pitch=pitch,
            offset=offset,
            sheet=sheet or plane_sheet,
            thickness=glass.get("thickness_mm", 0.0),
            index=glass.get("index", 1.0),
            plate=plate,
            radiance=screen.get("radiance", 1.0),
        )

    def world(self, u, v) -> np.ndarray:
        """World points [..., 3] of the pixels at (u, v), which glass does not move."""
        return self.place + self.sheet(*np.broadcast_arrays(u, v))[0] @ self.axes

    def line_edges(self, axis: int, first: int = 0, step: int = 1, width: int = 1) -> np.ndarray:
        """[lines, 2]: from where to where along u (axis 0) or v (axis 1) each line of a scan is lit, in mm."""
        begin = np.arange(first, self.size[axis] - width + 1, step)
        low = (begin - self.size[axis] / 2) * self.pitch[axis] + self.offset[axis]
        return np.stack([low, low + width * self.pitch[axis]], -1)

    def _normals(self, along_u, along_v) -> np.ndarray:
        return unit(np.cross(along_u, along_v))  # away from the mirror

    def meets(self, points, directions) -> tuple[np.ndarray, np.ndarray]:
        """(u, v) [...] of the pixels that rays through world points along world directions [..., 3] come from."""
        at, along = (points - self.place) @ self.axes.T, unit(directions @ self.axes.T)
        if self.thickness and self.plate == "offset":
            u, v = self._solve(at, along, lambda normals: -self.thickness * normals)
            point, *tangents = self.sheet(u, v)
            normals = self._normals(*tangents)
            inside = refracted(along, normals, 1 / self.index)
            return self._solve(point - self.thickness * normals, inside, None)
        if self.thickness:
            return self._solve(at, along, lambda normals: self._from_pixel(along, normals))
        return self._solve(at, along, None)

    def _from_pixel(self, along, normals) -> np.ndarray:
        """From a pixel to where the ray through it crosses the plate's outer face; along: outside, unit."""
        inside = refracted(along, normals, 1 / self.index)
        return -self.thickness * inside / np.sum(inside * normals, -1, keepdims=True)

    def _solve(self, at, along, lifted) -> tuple[np.ndarray, np.ndarray]:
        """(u, v) where lines cross the sheet, moved by lifted(normals) if given: Newton's method in (u, v, way)."""
        way = -at[..., 2] / along[..., 2]
        u, v = at[..., 0] + way * along[..., 0], at[..., 1] + way * along[..., 1]
        for _ in range(80):
            point, along_u, along_v = self.sheet(u, v)
            if lifted is not None:
                point = point + lifted(self._normals(along_u, along_v))
            miss = at + way[..., None] * along - point
            across = np.cross(along_u, along_v)
            step = -np.sum(miss * across, -1) / np.sum(along * across, -1)  # along the line, to the tangent plane
            way = way + step
            miss = miss + step[..., None] * along
            square = np.sum(across**2, -1)
            du = np.sum(np.cross(miss, along_v) * across, -1) / square
            dv = np.sum(np.cross(along_u, miss) * across, -1) / square
            u, v = u + du, v + dv
            if max(np.nanmax(np.abs(du)), np.nanmax(np.abs(dv))) < 5e-12:  # mm; each step is below 1/100 of the last
                return u, v
        raise ValueError("no crossing with the screen found")

    def leaves(self, u, v, directions) -> np.ndarray:
        """World points [..., 3] where light from the pixels (u, v) leaves the glass, to go on along directions."""
        along = unit(directions @ self.axes.T)
        point, *tangents = self.sheet(*np.broadcast_arrays(u, v))
        if self.thickness and self.plate == "offset":
            point = self._outer(point, along, self._normals(*tangents), u, v)
        elif self.thickness:
            point = point + self._from_pixel(along, self._normals(*tangents))
        return self.place + point @ self.axes

    def _outer(self, pixel, along, normals, u, v) -> np.ndarray:
        """Points of the offset face where light from pixels leaves along a direction; its normal by iteration."""
        for _ in range(80):
            inside = refracted(along, normals, 1 / self.index)
            foot_u, foot_v = self._solve(pixel, inside, lambda n: -self.thickness * n)
            foot, *tangents = self.sheet(foot_u, foot_v)
            before, normals = normals, self._normals(*tangents)
            if np.max(np.abs(normals - before)) < 1e-16:
                break
        return foot - self.thickness * normals
