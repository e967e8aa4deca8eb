"""Where the pixels of a bent screen are in its frame: a polynomial sag, or splines through measured points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from scipy.interpolate import NdBSpline, RBFInterpolator, RectBivariateSpline

from irtscots_cl.scene.instrument import Screen
from irtscots_cl.scene.validation import SceneError

TABLE_NODES = 33  # along each axis, of the grid to which points without one are brought
MIN_SPREAD = 1e-3  # of the places across the direction of their largest extent: less spans no area
SAME_FRACTION = 1e-6  # of the screen: fractions that close are one row or column of a grid


class ScreenSurface(Protocol):
    """The pixels' places in the screen's frame, as functions of the grid's (u, v) [...] in mm."""

    def points(self, u_mm, v_mm) -> np.ndarray:
        """Points [..., 3] in mm."""

    def tangents(self, u_mm, v_mm) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives [..., 3] of the points by u and by v."""


def screen_surface(screen: Screen) -> ScreenSurface:
    """The surface of a bent screen's pixels. Raises SceneError if measured points fold over."""
    half = tuple(n * p / 2 for n, p in zip(screen.pixels, screen.pitch_xy_mm, strict=True))
    if screen.shape.sag_mm:
        return PolynomialSag(tuple(screen.shape.sag_mm), (half[0], half[1]), screen.centre_offset_mm)
    surface = _measured(screen.shape, (half[0], half[1]), screen.centre_offset_mm)
    _check_unfolded(surface, (half[0], half[1]), screen.centre_offset_mm)
    return surface


@dataclass(frozen=True)
class PolynomialSag:
    """X = u, Y = v, Z = sum of c (u/U)^i (v/V)^j; u, v from the grid's middle. Beyond the screen it goes on."""

    terms: tuple[tuple[int, int, float], ...]
    half_mm: tuple[float, float]
    middle_mm: tuple[float, float]

    def points(self, u_mm, v_mm) -> np.ndarray:
        u, v = np.broadcast_arrays(np.asarray(u_mm, float), np.asarray(v_mm, float))
        return np.stack([u, v, self._sum(u, v)], -1)

    def tangents(self, u_mm, v_mm) -> tuple[np.ndarray, np.ndarray]:
        u, v = np.broadcast_arrays(np.asarray(u_mm, float), np.asarray(v_mm, float))
        one, none = np.ones_like(u), np.zeros_like(u)
        return np.stack([one, none, self._sum(u, v, 0)], -1), np.stack([none, one, self._sum(u, v, 1)], -1)

    def _sum(self, u, v, along: int | None = None) -> np.ndarray:
        """The polynomial, or its derivative along u (0) or v (1)."""
        at = [(w - m) / h for w, m, h in zip((u, v), self.middle_mm, self.half_mm, strict=True)]
        total = np.zeros_like(u)
        for i, j, value in self.terms:
            power, factor = [i, j], value
            if along is not None:
                factor, power[along] = factor * power[along] / self.half_mm[along], max(power[along] - 1, 0)
            if factor:
                total = total + factor * at[0] ** power[0] * at[1] ** power[1]
        return total


@dataclass(frozen=True)
class MeasuredPoints:
    """Splines of X - u, Y - v and Z over the grid; beyond the measured points they go on straight."""

    spline: NdBSpline = field(repr=False)  # of (u, v), for all three
    first: tuple[float, float]  # of the knots: the range (u, v) that the points cover
    last: tuple[float, float]

    def points(self, u_mm, v_mm) -> np.ndarray:
        (u, v), place, beyond = self._placed(u_mm, v_mm)
        moves = self.spline(place)
        if np.any(beyond):
            moves = moves + beyond[0][..., None] * self.spline(place, nu=(1, 0))
            moves = moves + beyond[1][..., None] * self.spline(place, nu=(0, 1))
        return moves + np.stack([u, v, np.zeros_like(u)], -1)

    def tangents(self, u_mm, v_mm) -> tuple[np.ndarray, np.ndarray]:
        _, place, beyond = self._placed(u_mm, v_mm)
        by_u, by_v = self.spline(place, nu=(1, 0)), self.spline(place, nu=(0, 1))
        if np.any(beyond):
            twist, (beyond_u, beyond_v) = self.spline(place, nu=(1, 1)), beyond
            by_u = by_u + np.where(beyond_u == 0, beyond_v, 0.0)[..., None] * twist
            by_v = by_v + np.where(beyond_v == 0, beyond_u, 0.0)[..., None] * twist
        return by_u + [1.0, 0.0, 0.0], by_v + [0.0, 1.0, 0.0]

    def _placed(self, u_mm, v_mm) -> tuple[list[np.ndarray], np.ndarray, list[np.ndarray]]:
        """u, v; the nearest places [..., 2] that the points cover; how far u, v are beyond those."""
        grid = list(np.broadcast_arrays(np.asarray(u_mm, float), np.asarray(v_mm, float)))
        inside = [np.clip(w, a, b) for w, a, b in zip(grid, self.first, self.last, strict=True)]
        return grid, np.stack(inside, -1), [w - near for w, near in zip(grid, inside, strict=True)]


def _measured(shape: Any, half: tuple[float, float], middle: tuple[float, float]) -> MeasuredPoints:
    fractions = np.array(shape.fractions)
    points = np.array(shape.points_mm)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    places = (2 * fractions - 1) * half + middle  # (u, v) on the grid
    moves = points - np.column_stack([places, np.zeros(len(places))])
    u, v, values = _on_grid(places, moves, shape.interpolation)
    order = 1 if shape.interpolation == "linear" else 3
    powers = min(order, len(u) - 1), min(order, len(v) - 1)
    fits = [RectBivariateSpline(u, v, field, kx=powers[0], ky=powers[1]) for field in values]
    shape_of = tuple(len(knots) - power - 1 for knots, power in zip(fits[0].tck[:2], powers, strict=True))
    coefficients = np.stack([fit.tck[2].reshape(shape_of) for fit in fits], -1)
    # of a linear spline RectBivariateSpline itself gives no derivatives
    return MeasuredPoints(NdBSpline(fits[0].tck[:2], coefficients, powers), (u[0], v[0]), (u[-1], v[-1]))


def _on_grid(places: np.ndarray, moves: np.ndarray, interpolation: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates u, v of a grid and the moves [3, u, v] there: the points' own grid, or one through their cloud."""
    (u, of_u), (v, of_v) = (_levels(places[:, k]) for k in (0, 1))
    cell = of_u * len(v) + of_v
    if min(len(u), len(v)) > 1 and len(np.unique(cell)) == len(places) == len(u) * len(v):
        return u, v, moves[np.argsort(cell)].T.reshape(3, len(u), len(v))
    spread = np.linalg.svd(places - places.mean(0), compute_uv=False)
    if not spread[1] > MIN_SPREAD * spread[0]:
        raise SceneError("screen.shape.fractions: all places lie on a line; must span the screen in both directions")
    u, v = (np.linspace(places[:, k].min(), places[:, k].max(), TABLE_NODES) for k in (0, 1))
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
    kernel = "linear" if interpolation == "linear" else "thin_plate_spline"
    scale = np.ptp(places, axis=0).max()
    found = RBFInterpolator(places / scale, moves, kernel=kernel, degree=1)(grid / scale)
    return u, v, found.T.reshape(3, len(u), len(v))


def _levels(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The different values, where those closer than SAME_FRACTION of the range count as one; which [n] each is."""
    order = np.argsort(values)
    gap = np.diff(values[order], prepend=-np.inf) > SAME_FRACTION * max(np.ptp(values), 1e-30)
    groups = np.empty(len(values), np.int64)
    groups[order] = np.cumsum(gap) - 1
    return np.bincount(groups, values) / np.bincount(groups), groups


def _check_unfolded(surface: ScreenSurface, half: tuple[float, float], middle: tuple[float, float]) -> None:
    """Raise SceneError where the measured points put neighbours on the screen the wrong way round."""
    steps = np.linspace(-1, 1, 4 * TABLE_NODES)
    u, v = np.meshgrid(middle[0] + half[0] * steps, middle[1] + half[1] * steps, indexing="ij")
    along_u, along_v = surface.tangents(u, v)
    area = along_u[..., 0] * along_v[..., 1] - along_u[..., 1] * along_v[..., 0]
    if not area.min() > 0:
        at = np.unravel_index(np.argmin(area), area.shape)
        place = [round(float((s + 1) / 2), 3) for s in (steps[at[0]], steps[at[1]])]
        raise SceneError(
            f"screen.shape.points_mm: fold over near the place {place} of the screen (fractions x, y); neighbours "
            "there must lie in the order of their fractions, along the screen's +x and +y"
        )
