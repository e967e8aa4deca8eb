"""Edges of a mirror that cross a pixel: circles and straight sides.

Positions on the mirror in mm, on a pixel in half of its edges (ray_map.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.pixel.ray_map import RayMap


class Edge(Protocol):
    """A line on the mirror. excess: [n, ...] growing from below 0 where the mirror lies to above 0 beyond the edge."""

    def excess(self, maps: RayMap, s: FloatArray, t: FloatArray) -> FloatArray: ...

    def growth(self, maps: RayMap, along: str, s: FloatArray, t: FloatArray) -> FloatArray:
        """Derivative of the excess along "s", "t", "a" or "b"."""

    def beyond(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance [mm] of points beyond the edge, above 0 there, and the direction in which it grows."""


@dataclass(frozen=True)
class Circle:
    """The mirror lies within the circle about (x_mm, y_mm); around it, if it is a hole's."""

    radius_mm: float
    x_mm: float = 0.0
    y_mm: float = 0.0

    def excess(self, maps: RayMap, s: FloatArray, t: FloatArray) -> FloatArray:
        x, y = maps.centre("x", s, t) - self.x_mm, maps.centre("y", s, t) - self.y_mm
        return x**2 + y**2 - self.radius_mm**2

    def growth(self, maps: RayMap, along: str, s: FloatArray, t: FloatArray) -> FloatArray:
        """Derivative of the excess along "s", "t", "a" or "b"."""
        middle = {"x": self.x_mm, "y": self.y_mm}
        parts = ((maps.centre(axis, s, t) - middle[axis]) * maps.gradient(axis, along, s, t) for axis in "xy")
        return 2 * sum(parts)

    def beyond(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance [mm] of points beyond the edge, above 0 there, and the direction in which it grows."""
        away_x, away_y = x_mm - self.x_mm, y_mm - self.y_mm
        radius = np.hypot(away_x, away_y)
        with np.errstate(invalid="ignore", divide="ignore"):
            return radius - self.radius_mm, away_x / radius, away_y / radius


@dataclass(frozen=True)
class Side:
    """A straight side from (x_mm, y_mm) to (x_mm + u_mm, y_mm + v_mm), the mirror to its left. Extended beyond its ends
    where it crosses a pixel."""

    x_mm: float
    y_mm: float
    u_mm: float
    v_mm: float

    @property
    def normal(self) -> tuple[float, float]:
        length = float(np.hypot(self.u_mm, self.v_mm))
        return self.v_mm / length, -self.u_mm / length

    def excess(self, maps: RayMap, s: FloatArray, t: FloatArray) -> FloatArray:
        to_x, to_y = self.normal
        return to_x * (maps.centre("x", s, t) - self.x_mm) + to_y * (maps.centre("y", s, t) - self.y_mm)

    def growth(self, maps: RayMap, along: str, s: FloatArray, t: FloatArray) -> FloatArray:
        """Derivative of the excess along "s", "t", "a" or "b"."""
        to_x, to_y = self.normal
        return to_x * maps.gradient("x", along, s, t) + to_y * maps.gradient("y", along, s, t)

    def beyond(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance [mm] of points beyond the edge, above 0 there, and the direction in which it grows."""
        to_x, to_y = self.normal
        distance = to_x * (x_mm - self.x_mm) + to_y * (y_mm - self.y_mm)
        return distance, np.full_like(distance, to_x), np.full_like(distance, to_y)

    def away(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Distance [mm] of points from the side itself, ends included."""
        from_x, from_y = x_mm - self.x_mm, y_mm - self.y_mm
        square = self.u_mm**2 + self.v_mm**2
        share = np.clip((from_x * self.u_mm + from_y * self.v_mm) / square, 0.0, 1.0)
        return np.hypot(from_x - share * self.u_mm, from_y - share * self.v_mm)
