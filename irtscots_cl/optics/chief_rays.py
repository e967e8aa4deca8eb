"""Chief rays in float64: the part of the mirror that each detector pixel sees, and the place on the screen.

The measurement uses the chief rays of the nominal scene; the tracer uses those of the true scene to place its windows.
All maps have the detector's shape [rows, columns]; coordinates in mm.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from irtscots_cl.maths.frame import Frame, turned
from irtscots_cl.optics.aperture_rims import RIM, ApertureRims
from irtscots_cl.optics.camera_model import CameraModel, camera_frame
from irtscots_cl.optics.screen_model import ScreenModel
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system import interruption
from irtscots_cl.system.memory import check_memory

BYTES_PER_PIXEL = 550  # peak memory while the maps are made; measured
SUBPIXELS = 16  # per axis, in pixels that the mirror's edge crosses: footprint areas are accurate to about 0.5 %
RAYS_OF_PART = 2**14  # traced at once: their dozens of arrays take little memory and stay near the processor
MANY_RAYS = 2**18  # from which several threads trace parts
WORKERS = min(4, os.cpu_count() or 1)
SAMPLED = 32  # rows and columns of pixels that tell how much room near the mirror is enough
ROOM = 2.0  # times the blur of those


@dataclass(frozen=True)
class Footprint:
    """The part of the mirror that the detector pixels see.

    x_mm, y_mm: the centroid of the part of the pixel's footprint that lies on the mirror (NaN if there is none).
    u_mm, v_mm: the mean of that part's chief rays on the screen's plane, in the screen's frame. It differs
    slightly from the landing point of the centroid's chief ray, because the landing point is not linear over a
    footprint.
    coverage: the fraction of the footprint that lies on the mirror.
    """

    x_mm: np.ndarray
    y_mm: np.ndarray
    u_mm: np.ndarray
    v_mm: np.ndarray
    coverage: np.ndarray


@dataclass(frozen=True)
class ChiefRays:
    """Reverse chief rays of a scene: detector -> centre of the camera's aperture -> mirror -> screen.

    every: only of every so many rows and columns of pixels are the footprints and the rays of the aperture's rim made;
    the others have no coverage.
    """

    scene: Scene
    every: int = field(default=1, kw_only=True)

    @cached_property
    def surface(self) -> Surface:
        return Surface.of(self.scene.mirror)

    @cached_property
    def screen_model(self) -> ScreenModel:
        return ScreenModel.of(self.scene.screen)

    @property
    def screen_frame(self) -> Frame:
        return self.screen_model.frame

    @cached_property
    def camera_model(self) -> CameraModel:
        return CameraModel.of(self.scene.camera)

    @cached_property
    def camera_frame(self) -> Frame:
        return camera_frame(self.scene.camera)

    @property
    def shape(self) -> tuple[int, int]:
        """Detector (rows, columns)."""
        columns, rows = self.scene.camera.detector.pixels
        return rows, columns

    def reverse(self, row, column, a_mm=0.0, b_mm=0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Trace from image points backwards through aperture point (a, b).

        Returns the mirror points [..., 3] (NaN where a ray misses the surface, also where the surface is only behind
        the camera; the rim is ignored) and the places (u, v) on the screen's grid of pixels [mm], which for a flat
        screen is its frame's plane (NaN also where the reflected ray does not come onto the screen's front).
        """
        rays = np.broadcast_arrays(row, column, a_mm, b_mm)
        if rays[0].size <= RAYS_OF_PART:
            return self._reverse(row, column, a_mm, b_mm)
        shape = rays[0].shape
        points, u, v = np.empty((*shape, 3)), np.empty(shape), np.empty(shape)
        axis = int(np.argmax(shape))

        def fill(some: slice) -> None:
            part = (*(slice(None),) * axis, some)
            points[part], u[part], v[part] = self._reverse(*(values[part] for values in rays))

        _for_parts(shape[axis], math.prod(shape), fill)
        return points, u, v

    def _reverse(self, row, column, a_mm, b_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same for few rays."""
        points, outgoing = self._to_mirror(row, column, a_mm, b_mm)
        return points, *self.screen_model.arrive(points, outgoing)

    def _to_mirror(self, row, column, a_mm=0.0, b_mm=0.0) -> tuple[np.ndarray, np.ndarray]:
        """Mirror points and reflected directions [..., 3] of few rays."""
        interruption.check()
        camera, frame = self.scene.camera, self.camera_frame
        image_x, image_y = self.camera_model.image_point(row, column)
        slope_a = a_mm / camera.focus_mm - image_x / camera.image_distance_mm
        slope_b = b_mm / camera.focus_mm - image_y / camera.image_distance_mm
        slopes = np.stack(np.broadcast_arrays(slope_a, slope_b, 1.0), -1)
        start = frame.to_world(*np.broadcast_arrays(a_mm, b_mm))
        directions = turned(-slopes, frame.axes)
        points, outgoing = self.surface.meet(start, directions)
        interruption.check()
        behind = (points[..., 2] - start[..., 2]) * directions[..., 2] < 0  # where the line meets it backwards
        points[behind] = np.nan
        return points, outgoing

    def pixel(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray]:
        """Fractional (row, column) of the pixels whose chief rays meet the surface at points of the mirror: what
        `reverse` undoes. NaN behind the camera."""
        camera, frame = self.camera_model, self.camera_frame
        points = np.stack(np.broadcast_arrays(x_mm, y_mm, self.surface.sag(x_mm, y_mm)), -1)
        along = (points - frame.position_mm) @ frame.axes.T
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = np.where(along[..., 2] < 0, -camera.image_distance_mm / along[..., 2], np.nan)
            return camera.pixel(along[..., 0] * scale, along[..., 1] * scale)

    @cached_property
    def wanted(self) -> np.ndarray:
        """Pixels [rows, columns] that are looked at: all, unless `every` says otherwise."""
        wanted = np.zeros(self.shape, bool)
        wanted[self.every // 2 :: self.every, self.every // 2 :: self.every] = True
        return wanted

    @cached_property
    def corners(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Chief rays of the pixels' corners, [rows + 1, columns + 1]: mirror points and screen crossings."""
        rows, columns = self.shape
        return self.reverse(*np.meshgrid(np.arange(rows + 1) - 0.5, np.arange(columns + 1) - 0.5, indexing="ij"))

    @cached_property
    def rims(self) -> ApertureRims:
        """Rays through the aperture's rim, of the wanted pixels whose light may come from the mirror."""
        room = ROOM * self._sampled_blur_mm + self._corner_distance
        rims = self._rims_of(self.wanted & ~self._parted(room)[2])
        return rims if self._margin(rims) <= room else self._rims_of(self.wanted)

    @cached_property
    def _sampled_blur_mm(self) -> float:
        """Blur of the aperture on the mirror, of pixels all over the detector and on its border."""
        sample = np.zeros(self.shape, bool)
        steps = [max(1, count // SAMPLED) for count in self.shape]
        sample[steps[0] // 2 :: steps[0], steps[1] // 2 :: steps[1]] = True
        sample[[0, -1]] = sample[:, [0, -1]] = True
        return self._rims_of(sample if self.every == 1 else sample & self.wanted).blur_mm

    def _rims_of(self, chosen: np.ndarray) -> ApertureRims:
        pixels = np.flatnonzero(chosen)
        row, column = np.divmod(pixels[:, None], self.shape[1])
        a, b = (self.scene.camera.aperture_diameter_mm / 2 * RIM).T
        return ApertureRims(self.shape, pixels, *self.reverse(row, column, a, b))

    @cached_property
    def _corner_distance(self) -> float:
        """Largest distance between opposite corners of pixels on the mirror."""
        corners = self.corners[0]
        return float(np.nanmax(np.linalg.norm(corners[1:, 1:, :2] - corners[:-1, :-1, :2], axis=-1), initial=0.0))

    def _margin(self, rims: ApertureRims) -> float:
        """How far from the mirror a pixel's footprint may be for light to reach it [mm]."""
        return max(rims.blur_mm, self._sampled_blur_mm) + self._corner_distance / SUBPIXELS

    @cached_property
    def footprint(self) -> Footprint:
        """Mirror points and coverage of all pixels, from chief rays."""
        return self._footprint(0.0)

    def _footprint(self, margin_mm: float) -> Footprint:
        inside, edge, _ = self._parted(margin_mm)
        maps = np.full((4, *self.shape), np.nan)
        coverage = np.zeros(self.shape)
        for pixels, per_axis in ((inside, 2), (edge, SUBPIXELS)):
            maps[:, pixels], coverage[pixels] = self._sampled(*np.nonzero(pixels), per_axis, margin_mm)
        return Footprint(*maps, coverage)

    def _parted(self, margin_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels [rows, columns] whose footprints lie in the mirror widened by a margin, on its edge, or outside."""
        corners = self.corners[0][..., :2]
        radius = np.hypot(corners[..., 0], corners[..., 1])
        of_pixel = np.stack([radius[:-1, :-1], radius[1:, :-1], radius[:-1, 1:], radius[1:, 1:]])
        diagonal = np.linalg.norm(corners[1:, 1:] - corners[:-1, :-1], axis=-1)
        rim = self.surface.aperture_radius_mm + margin_mm
        hole = max(self.surface.obscuration_radius_mm - margin_mm, 0.0)
        if self.surface.outline is not None:
            depth = self.surface.depth(corners[..., 0], corners[..., 1])[0] + margin_mm
            of_corners = np.stack([depth[:-1, :-1], depth[1:, :-1], depth[:-1, 1:], depth[1:, 1:]])
        with np.errstate(invalid="ignore"):
            inside = (of_pixel.max(0) <= rim) & ((hole == 0) | (of_pixel.min(0) > hole + diagonal))
            outside = (of_pixel.min(0) > rim + diagonal) | (of_pixel.max(0) + diagonal < hole)
            if self.surface.outline is not None:
                inside, outside = inside & (of_corners.min(0) > diagonal), outside | (of_corners.max(0) < -diagonal)
        if self.every > 1:
            inside, outside = inside & self.wanted, outside | ~self.wanted
        return inside, ~inside & ~outside, outside

    def _sampled(self, row, column, per_axis: int, margin_mm: float) -> tuple[np.ndarray, np.ndarray]:
        """Means of x, y, u, v [4, n] and covered fraction [n] of pixels (row, column) [n], per_axis^2 rays each."""
        step_row, step_column = _steps(per_axis)
        points, u, v = self.reverse(row[:, None] + step_row, column[:, None] + step_column)
        with np.errstate(invalid="ignore", divide="ignore"):
            on = self.surface.contains(points[..., 0], points[..., 1], margin_mm)
            count = on.sum(1)
            values = np.stack([points[..., 0], points[..., 1], u, v])
            return np.where(on, values, 0.0).sum(2) / count, count / per_axis**2

    @cached_property
    def sees_mirror(self) -> np.ndarray:
        """Pixels [rows, columns] that light from the mirror can reach through any point of the aperture."""
        margin = self._margin(self.rims)
        inside, edge, _ = self._parted(margin)
        seen = inside.copy()  # no need to ask rays
        seen[edge] = self._touched(*np.nonzero(edge), margin)
        return seen

    @cached_property
    def clear_of_edges(self) -> np.ndarray:
        """Pixels [rows, columns] no part of whose light, through any point of the aperture, comes near an edge.

        False where that is not known.
        """
        room = 2 * max(self.rims.blur_mm, self._sampled_blur_mm) + self._corner_distance / SUBPIXELS
        return self._parted(-room)[0]

    def _touched(self, row, column, margin_mm: float) -> np.ndarray:
        """Whether any of SUBPIXELS^2 rays of pixels (row, column) [n] meets the mirror widened by a margin."""
        step_row, step_column = _steps(SUBPIXELS)
        touched = np.zeros(len(row), bool)

        def fill(part: slice) -> None:
            points, _ = self._to_mirror(row[part][:, None] + step_row, column[part][:, None] + step_column)
            touched[part] = self.surface.contains(points[..., 0], points[..., 1], margin_mm).any(1)

        _for_parts(len(row), len(row) * step_row.size, fill)
        return touched

    def landing_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Screen columns and rows (fractional indices) that can light each pixel.

        Returns (lowest, highest), each [rows, columns, 2] in the order column, row. The range comes from the chief rays
        of the pixel's corners, widened by the aperture's image. NaN where no ray reaches the screen.
        """
        screen = self.scene.screen
        _, corner_u, corner_v = self.corners
        lowest, highest = [], []
        grid = zip(screen.centre_offset_mm, screen.pitch_xy_mm, screen.pixels, strict=True)
        for k, (corner, (offset, pitch, count)) in enumerate(zip((corner_u, corner_v), grid, strict=True)):
            four = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[:-1, 1:], corner[1:, 1:]])
            reach = self.rims.half_range(k) * 1.1  # eight rim points reach at least 0.92 of the true extreme
            for edge, out in ((np.fmin.reduce(four) - reach, lowest), (np.fmax.reduce(four) + reach, highest)):
                out.append((edge - offset) / pitch + (count - 1) / 2)
        return np.stack(lowest, -1), np.stack(highest, -1)

    def light_shape(self, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A pixel's light along the screen's x (k = 0) or y (k = 1) by its local linear map, [rows, columns] mm.

        Returns the half-width of the aperture's image, and the widths of the pixel's own image along its row step and
        its column step: the profile is the aperture's chord spread over these two boxes.
        """
        corner = self.corners[1 + k]
        along_row = (corner[1:, :-1] - corner[:-1, :-1] + corner[1:, 1:] - corner[:-1, 1:]) / 2
        along_column = (corner[:-1, 1:] - corner[:-1, :-1] + corner[1:, 1:] - corner[1:, :-1]) / 2
        return self.rims.half_width(k), np.abs(along_row), np.abs(along_column)


def _steps(per_axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Places [per_axis^2] within a pixel, in rows and columns from its centre.

    Two points per axis: the Gauss rule, exact for a footprint's cubic distortion.
    """
    step = np.array([-0.5, 0.5]) / np.sqrt(3.0) if per_axis == 2 else (np.arange(per_axis) + 0.5) / per_axis - 0.5
    row, column = np.meshgrid(step, step, indexing="ij")
    return row.ravel(), column.ravel()


def _for_parts(length: int, rays: int, act: Callable[[slice], None]) -> None:
    """act(part) for parts of `length` things with so many rays, of RAYS_OF_PART each; where there are many on several
    threads."""
    step = max(1, RAYS_OF_PART * length // max(rays, 1))
    parts = [slice(first, first + step) for first in range(0, length, step)]
    if rays < MANY_RAYS:
        for part in parts:
            act(part)
        return
    with ThreadPoolExecutor(WORKERS) as pool:
        list(pool.map(act, parts))


def trace_chief_rays(scene: Scene) -> ChiefRays:
    """The chief rays of a scene's detector pixels.

    Raises ValueError if the memory cannot hold maps of so many detector pixels.
    """
    columns, rows = scene.camera.detector.pixels
    check_memory(f"scene {scene.name}: camera.detector.pixels = {[columns, rows]}", columns * rows * BYTES_PER_PIXEL)
    return ChiefRays(scene)


def check_visible(chief: ChiefRays, source: str) -> None:
    """Raise SceneError if the detector does not see the mirror, or sees no screen pixel in it.

    source: the scene's file or preset, for the message.
    """
    scene = chief.scene
    if not chief.sees_mirror.any():
        raise SceneError(
            f"{source}: camera.look_at_mm = {list(scene.camera.look_at_mm)}: "
            "no detector pixel sees the mirror; must bring the mirror into the field of view"
        )
    lowest, highest = (edge[chief.sees_mirror] for edge in chief.landing_range())
    size = np.array(scene.screen.pixels)
    if not np.any(np.all((highest >= -0.5) & (lowest <= size - 0.5), axis=-1)):
        if not np.isfinite(lowest + highest).all(-1).any():
            raise SceneError(
                f"{source}: screen.position_mm = {list(scene.screen.position_mm)}: no ray from the detector by way of "
                "the mirror comes onto the screen's front; must lie where the mirror sends the camera's rays"
            )
        offset = (np.nanmean((lowest + highest) / 2, axis=0) - (size - 1) / 2) * scene.screen.pitch_xy_mm
        spread = (np.nanmax(highest, axis=0) - np.nanmin(lowest, axis=0)) * scene.screen.pitch_xy_mm
        raise SceneError(
            f"{source}: screen.position_mm = {list(scene.screen.position_mm)}: no detector pixel sees the "
            f"screen in the mirror; the pixel grid must reach the light, which lands about "
            f"{offset[0]:.1f}, {offset[1]:.1f} mm from its centre in the screen's x, y, over {spread[0]:.1f} x "
            f"{spread[1]:.1f} mm"
        )
