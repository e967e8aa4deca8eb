"""Chief rays to first order: how the place (u, v) on the screen's grid moves with each part of a ray's way.

A ray leaves the aperture's centre C along d, meets the mirror z = S(x, y) at P = C + t d, leaves along
r = d - 2 (d.g) g / g.g with g = (-S_x, -S_y, 1), and ends at Q(u, v) = P + s r. With the end fixed by
Q_u du + Q_v dv - r ds = dP + s dr - dQ, dots with n_u = Q_v x r / (Q_u . Q_v x r) and its counterpart give du and dv.
All is exact to first order; the rays are those of optics.chief_rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.height_map import MapDeparture
from irtscots_cl.optics.screen_model import ScreenModel
from irtscots_cl.optics.surface import Surface

DEPARTURE_STEP = 1e-3  # of their radius, of five-point differences of the departures' slopes
GLASS_STEP = (1e-2, 1e-4)  # mm and slope: the derivatives of a cover glass's shift to 1e-8 of themselves


@dataclass(frozen=True)
class RayChanges:
    """Of n chief rays: their points, and the changes (du, dv) [2, n, ...] in mm per change of each part.

    start: C [3]. along [n, 3]: d with d.z = -1 in the camera's frame. reach [n]: t. points [n, 3]: P. u, v [n]: the
    ends. screen_points [n, 3]: Q, of the pixel where the ray ends, also behind glass. by_place, by_direction [2, n, 3]:
    per mm of C and per unit of d at fixed P. by_height [2, n]: per mm of the surface's height at fixed x, y; by_slope
    [2, n, 2]: per radian of its slopes. by_screen [2, n, 3]: per mm of Q at a fixed place of the grid. by_screen_turn
    [2, n, 3]: per radian of the frame of a screen with a cover glass, besides what by_screen says; None for others.
    """

    chief: ChiefRays
    row: FloatArray
    column: FloatArray
    start: FloatArray
    along: FloatArray
    reach: FloatArray
    points: FloatArray
    u: FloatArray
    v: FloatArray
    screen_points: FloatArray
    by_place: FloatArray
    by_direction: FloatArray
    by_height: FloatArray
    by_slope: FloatArray
    by_screen: FloatArray
    by_screen_turn: FloatArray | None


def ray_changes(chief: ChiefRays, row: ArrayLike, column: ArrayLike) -> RayChanges:
    """The first-order changes of the chief rays of image points (row, column) [n] of the upright grid.

    NaN where a ray misses the mirror or the screen's surface.
    """
    row, column = (np.asarray(at, float).ravel() for at in (row, column))
    frame, surface, screen = chief.camera_frame, chief.surface, chief.screen_model
    camera = chief.camera_model
    x, y = (v / camera.image_distance_mm for v in camera.image_point(row, column))
    along = np.stack([x, y, -np.ones_like(x)], -1) @ frame.axes
    points, u, v = chief.reverse(row, column)
    reach = (points[:, 2] - frame.position_mm[2]) / along[:, 2]
    gradient = np.stack(surface.gradient(points[:, 0], points[:, 1]), -1)
    normal = np.column_stack([-gradient, np.ones(len(points))])
    square, cosine = _dot(normal, normal), _dot(along, normal)  # g.g and d.g
    outgoing = along - (2 * cosine / square)[:, None] * normal
    hit_u, hit_v = _without_glass(screen, points, outgoing, u, v)
    screen_points = screen.to_world(hit_u, hit_v)
    ahead = _dot(screen_points - points, outgoing) / _dot(outgoing, outgoing)  # s
    ends = _end_rows(screen, hit_u, hit_v, outgoing)
    glass = _GlassRows.of(screen, hit_u, hit_v, outgoing) if screen.glass is not None else None

    def landed(point: FloatArray | float, out: FloatArray) -> FloatArray:
        """(du, dv) [2, n, k] of changes [n, 3, k] of the mirror point and of the outgoing direction."""
        there: FloatArray = np.einsum("ani,nik->ank", ends, point + ahead[:, None, None] * out)
        if glass is not None:
            there = glass.carried(there) + np.einsum("ani,nik->ank", glass.by_out, out)
        return there

    bend = _bend(surface, points)
    # the incoming ray moved by e at P: dP = e - d (g.e) / (d.g); the surface raised by h: dP = d h / (d.g)
    by_place = np.eye(3) - along[:, :, None] * (normal / cosine[:, None])[:, None, :]
    by_height = (along / cosine[:, None])[:, :, None]
    tilt = _tilted_outgoing(along, normal, square, cosine)
    direct = np.eye(3) - 2 * normal[:, :, None] * (normal / square[:, None])[:, None, :]  # dr per unit of dd
    return RayChanges(
        chief, row, column, frame.position_mm, along, reach, points, u, v, screen_points,
        by_place=landed(by_place, tilt @ -(bend @ by_place[:, :2])),
        by_direction=landed(0.0, direct),
        by_height=landed(by_height, tilt @ -(bend @ by_height[:, :2]))[..., 0],
        by_slope=landed(0.0, -tilt),
        by_screen=-ends if glass is None else -glass.carried(ends),
        by_screen_turn=None if glass is None else np.cross(glass.by_out, outgoing),
    )  # fmt: skip


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = np.einsum("...i,...i->...", a, b)
    return product


def _without_glass(
    screen: ScreenModel, points: FloatArray, outgoing: FloatArray, u: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where rays would meet the pixels if there were no cover glass."""
    return (u, v) if screen.glass is None else ScreenModel(screen.frame, screen.surface).arrive(points, outgoing)


def _end_rows(screen: ScreenModel, u: FloatArray, v: FloatArray, outgoing: FloatArray) -> FloatArray:
    """Vectors [2, n, 3] whose dot with a ray's sideways move at the screen is (du, dv)."""
    along_u, along_v = screen.tangents(u, v)
    for_u, for_v = np.cross(along_v, outgoing), np.cross(along_u, outgoing)
    return np.stack([for_u / _dot(along_u, for_u)[:, None], for_v / _dot(along_v, for_v)[:, None]])


def _bend(surface: Surface, points: FloatArray) -> FloatArray:
    """Second derivatives [n, 2, 2] of the surface's height at points [n, 3]; of all but maps, by differences."""
    (x, y, z), q = points.T, surface.quadric
    height = z if not surface.departures else q.meet(x, y, 0.0, 0.0)
    slope_x, slope_y = q.gradient(x, y, height)
    down = 1.0 - q.q_zz * height - q.q_xz * x
    xx = (q.q_xx + 2 * q.q_xz * slope_x + q.q_zz * slope_x**2) / down
    xy = (q.q_xz + q.q_zz * slope_x) * slope_y / down
    yy = (q.q_yy + q.q_zz * slope_y**2) / down
    bend = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -1)
    maps = [departure for departure in surface.departures if isinstance(departure, MapDeparture)]
    for departure in maps:  # their scale is their own: no step would suit every one
        xx, xy, yy = departure.bend(x, y)
        bend += np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -1)
    others = tuple(departure for departure in surface.departures if departure not in maps)
    smooth = Surface(q, surface.aperture_radius_mm, deviation=others)
    if smooth.departures:
        step = DEPARTURE_STEP * smooth.departure_radius_mm
        for k, (a, b) in enumerate(((step, 0.0), (0.0, step))):
            for where, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
                bend[..., k] += weight / step * np.stack(smooth.departure_at(x + where * a, y + where * b)[1:], -1)
    return bend


def _tilted_outgoing(along: FloatArray, normal: FloatArray, square: FloatArray, cosine: FloatArray) -> FloatArray:
    """Derivatives [n, 3, 2] of r = d - 2 (d.g) g / g.g per change of g's x and y."""
    each = along / square[:, None] - (2 * cosine / square**2)[:, None] * normal
    outer = normal[:, :, None] * each[:, None, :2]
    return -2 * (outer + (cosine / square)[:, None, None] * np.eye(3)[:, :2])


@dataclass(frozen=True)
class _GlassRows:
    """A cover glass moves a ray by shift(u, v, slopes) on the grid.

    matrix [n, 2, 2]: change of the final place per change of that without glass. by_out [2, n, 3]: per change of the
    outgoing direction in the world, through the angle at the glass.
    """

    matrix: FloatArray
    by_out: FloatArray

    @classmethod
    def of(cls, screen: ScreenModel, u: FloatArray, v: FloatArray, outgoing: FloatArray) -> _GlassRows:
        axes, out = screen.frame.axes, outgoing @ screen.frame.axes.T
        slopes = out[:, 0] / out[:, 2], out[:, 1] / out[:, 2]
        columns = []
        for k in range(4):
            step = np.zeros(4)
            step[k] = GLASS_STEP[k // 2]
            after, before = (
                np.stack(screen.glass_shift(u + sign * step[0], v + sign * step[1],
                                            slopes[0] + sign * step[2], slopes[1] + sign * step[3]))
                for sign in (1, -1)
            )  # fmt: skip
            columns.append((after - before) / (2 * step[k]))
        by = np.stack(columns, -1)  # [2, n, (u, v, slope x, slope y)]
        rows = np.stack([(axes[k] - slopes[k][:, None] * axes[2]) / out[:, 2:] for k in (0, 1)])  # d slope per d out
        return cls(np.eye(2) + by[..., :2].transpose(1, 0, 2), np.einsum("anb,bni->ani", by[..., 2:], rows))

    def carried(self, moved: FloatArray) -> FloatArray:
        """Changes [2, n, k] of the final place from those without glass."""
        product: FloatArray = np.einsum("nab,bnk->ank", self.matrix, moved)
        return product
