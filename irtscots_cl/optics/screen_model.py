"""A screen between the places on its grid of pixels and points of the world, in float64.

Places (u, v) are mm on the grid as it was drawn: pixel numbers times pitch, from the middle, plus the grid's offset. A
bent screen puts them at (X, Y, Z)(u, v) of the screen's frame; its front is towards -z. A cover glass moves a ray
sideways: where it meets the pixels is not where it seems to go from outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from irtscots_cl.maths.frame import Frame, turned
from irtscots_cl.scene.instrument import Screen
from irtscots_cl.system import interruption

if TYPE_CHECKING:
    from irtscots_cl.optics.screen_surface import ScreenSurface

NEWTON_STEPS = 12  # for where a line meets a bent screen
PRECISION_MM = 1e-11
GLASS_ROUNDS = 8  # for where a point behind glass seems to be: each leaves thickness / radius of the last error


def screen_frame(screen: Screen) -> Frame:
    """The screen's frame: origin at its centre."""
    return Frame.looking(screen.position_mm, screen.look_at_mm, np.radians(screen.clocking_deg))


@dataclass(frozen=True)
class ScreenModel:
    """A screen's frame and, unless it is flat, the surface of its pixels; glass: a CoverGlass or None."""

    frame: Frame
    surface: ScreenSurface | None = None
    glass: Any = None

    @classmethod
    def of(cls, screen: Screen) -> ScreenModel:
        """Raises SceneError if the screen's measured points fold over."""
        surface = None
        if screen.shape is not None:
            from irtscots_cl.optics.screen_surface import screen_surface  # imported late: few screens are bent

            surface = screen_surface(screen)
        return cls(screen_frame(screen), surface, screen.cover_glass)

    @cached_property
    def is_plain(self) -> bool:
        """Whether the pixels lie in a plane, bare."""
        return self.surface is None and self.glass is None

    def to_world(self, u_mm, v_mm) -> np.ndarray:
        """World points [..., 3] of places on the grid."""
        if self.surface is None:
            return self.frame.to_world(u_mm, v_mm)
        return self.frame.position_mm + turned(self.surface.points(u_mm, v_mm), self.frame.axes)

    def tangents(self, u_mm, v_mm) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives [..., 3] of the world points by u and by v."""
        if self.surface is None:
            shape = np.broadcast_shapes(np.shape(u_mm), np.shape(v_mm))
            along = [np.broadcast_to(axis, (*shape, 3)) for axis in self.frame.axes[:2]]
            return along[0], along[1]
        along_u, along_v = self.surface.tangents(u_mm, v_mm)
        return turned(along_u, self.frame.axes), turned(along_v, self.frame.axes)

    def arrive(self, points_mm: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (u, v) [...] in mm that rays from world points [..., 3] along directions [..., 3] light.

        NaN where a ray does not come onto the screen's front, or misses the bent surface. The grid's edges are ignored:
        the surface goes on as a plane.
        """
        u, v = self.frame.arrive(points_mm, directions, in_front=True)
        if self.is_plain:
            return u, v
        along = turned(directions, self.frame.axes.T)
        with np.errstate(all="ignore"):
            slope_u, slope_v = along[..., 0] / along[..., 2], along[..., 1] / along[..., 2]
            if self.surface is not None:
                u, v = self._meet(u, v, slope_u, slope_v)
            if self.glass is not None:
                shift_u, shift_v = self.glass_shift(u, v, slope_u, slope_v)
                u, v = u + shift_u, v + shift_v
        return u, v

    def seen_from(self, points_mm: np.ndarray, u_mm, v_mm) -> np.ndarray:
        """World points [..., 3] towards which a ray from points_mm [..., 3] goes to light the places (u, v).

        They are where the places are, or seem to be behind the cover glass.
        """
        return self.to_world(*self.seen_places(points_mm, u_mm, v_mm))

    def seen_places(self, points_mm: np.ndarray, u_mm, v_mm) -> tuple[np.ndarray, np.ndarray]:
        """Places on the grid that a ray would light without the cover glass, if it lights (u, v): see seen_from."""
        if self.glass is None:
            return u_mm, v_mm
        seen_u, seen_v = u_mm, v_mm
        for _ in range(GLASS_ROUNDS):
            along = turned(self.to_world(seen_u, seen_v) - points_mm, self.frame.axes.T)
            shifts = self.glass_shift(seen_u, seen_v, along[..., 0] / along[..., 2], along[..., 1] / along[..., 2])
            seen_u, seen_v = u_mm - shifts[0], v_mm - shifts[1]
        return seen_u, seen_v

    def _meet(self, at_u, at_v, slope_u, slope_v) -> tuple[np.ndarray, np.ndarray]:
        """Places where lines that cross the frame's plane at (at_u, at_v) with slopes dx/dz, dy/dz meet the pixels."""
        assert self.surface is not None
        u, v = np.array(at_u, float), np.array(at_v, float)
        for _ in range(NEWTON_STEPS):
            interruption.check()
            x, y, z = np.moveaxis(self.surface.points(u, v), -1, 0)
            (x_u, y_u, z_u), (x_v, y_v, z_v) = (np.moveaxis(t, -1, 0) for t in self.surface.tangents(u, v))
            left_x, left_y = x - at_u - slope_u * z, y - at_v - slope_v * z
            xx, xy, yx, yy = x_u - slope_u * z_u, x_v - slope_u * z_v, y_u - slope_v * z_u, y_v - slope_v * z_v
            determinant = xx * yy - xy * yx
            step_u, step_v = (yy * left_x - xy * left_y) / determinant, (xx * left_y - yx * left_x) / determinant
            u, v = u - step_u, v - step_v
            moved = np.abs(step_u) + np.abs(step_v)
            if not np.any(moved > PRECISION_MM):
                break
        lost = ~(moved <= 1e4 * PRECISION_MM)
        return np.where(lost, np.nan, u), np.where(lost, np.nan, v)

    def glass_shift(self, u, v, slope_u, slope_v) -> tuple[np.ndarray, np.ndarray]:
        """How far (u, v) the glass moves rays with slopes dx/dz, dy/dz on the pixels about (u, v), in mm.

        A ray at the angle i to the local normal meets the pixels t (tan i - tan i') nearer, sin i = n sin i'.
        """
        thickness, index = self.glass.thickness_mm, self.glass.index
        if self.surface is None:
            tan2 = slope_u**2 + slope_v**2
            factor = thickness * (1 / np.sqrt(index**2 * (1 + tan2) - tan2) - 1)
            return factor * slope_u, factor * slope_v
        along_u, along_v = self.surface.tangents(u, v)
        normal = np.cross(along_u, along_v)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        way = np.stack(np.broadcast_arrays(slope_u, slope_v, 1.0), -1)
        way = way / np.sum(way * normal, -1, keepdims=True)
        across = way - normal  # tan i along the surface
        tan2 = np.sum(across**2, -1)
        shift = across * (thickness * (1 / np.sqrt(index**2 * (1 + tan2) - tan2) - 1))[..., None]
        uu, uv, vv = (np.sum(a * b, -1) for a, b in ((along_u, along_u), (along_u, along_v), (along_v, along_v)))
        by_u, by_v = np.sum(shift * along_u, -1), np.sum(shift * along_v, -1)
        determinant = uu * vv - uv * uv
        return (vv * by_u - uv * by_v) / determinant, (uu * by_v - uv * by_u) / determinant
