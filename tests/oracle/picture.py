"""A real camera, independent of the package: a lens in focus, an aperture, and OpenCV's picture of what it sees.

Everything is read from the tables of a scene file (`tomllib`), by the meaning of their keys. World = the mirror's
frame, lengths in mm. A ray is told by where it crosses the aperture's plane, (a, b) from the aperture's centre, and
by its slopes (p, q) = (dx/dz, dy/dz) in the camera's frame. The lens maps all rays through one point of the plane in
focus to one image point: x = (a + a0) / F - p and y = (b + b0) / F - q, in units of the image distance, with F the
distance in focus and (a0, b0) the aperture's centre from the optical axis. OpenCV's picture has its y down: (x, -y)
is distorted, then scaled. Places in a picture are in pixels, whole at the pixels' centres, (0, 0) in the top left
pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


def frame_axes(position, look_at, turn_rad: float = 0.0) -> np.ndarray:
    """Rows x, y, z of a device that looks at a point, x and y turned about z against the clock as seen from +z."""
    z = np.subtract(position, look_at)
    z = z / math.sqrt(z @ z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x = x / math.sqrt(x @ x)
    y = np.cross(z, x)
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    return np.stack([c * x + s * y, c * y - s * x, z])


# --- OpenCV's distortion (calib3d, "Detailed Description"): k1, k2, p1, p2, k3, then k4, k5, k6 ---------------------


def bend(x, y, terms) -> tuple[np.ndarray, np.ndarray]:
    """Distorted image point of an ideal one, y down."""
    k1, k2, p1, p2, k3, k4, k5, k6 = terms
    s = x * x + y * y
    ratio = (1 + k1 * s + k2 * s**2 + k3 * s**3) / (1 + k4 * s + k5 * s**2 + k6 * s**3)
    return (
        x * ratio + 2 * p1 * x * y + p2 * (s + 2 * x * x),
        y * ratio + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
    )


def bend_slopes(x, y, terms) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives (dX/dx, dX/dy, dY/dx, dY/dy) of bend."""
    k1, k2, p1, p2, k3, k4, k5, k6 = terms
    s = x * x + y * y
    above, below = 1 + k1 * s + k2 * s**2 + k3 * s**3, 1 + k4 * s + k5 * s**2 + k6 * s**3
    by_s = ((k1 + 2 * k2 * s + 3 * k3 * s**2) * below - above * (k4 + 2 * k5 * s + 3 * k6 * s**2)) / below**2
    ratio, cross = above / below, 2 * x * y * by_s + 2 * p1 * x + 2 * p2 * y
    return (
        ratio + 2 * x * x * by_s + 2 * p1 * y + 6 * p2 * x,
        cross,
        cross,
        ratio + 2 * y * y * by_s + 6 * p1 * y + 2 * p2 * x,
    )


def unbend(x_bent, y_bent, terms) -> tuple[np.ndarray, np.ndarray]:
    """Ideal image point of a distorted one, y down, to 1e-14 by Newton's method. Raises ValueError if it fails."""
    x, y = (np.array(v, float) for v in np.broadcast_arrays(x_bent, y_bent))
    for _ in range(60):
        got_x, got_y = bend(x, y, terms)
        a, b, c, d = bend_slopes(x, y, terms)
        miss_x, miss_y = got_x - x_bent, got_y - y_bent
        if max(np.max(np.abs(miss_x)), np.max(np.abs(miss_y))) < 1e-15:
            break
        determinant = a * d - b * c
        x, y = x - (d * miss_x - b * miss_y) / determinant, y - (a * miss_y - c * miss_x) / determinant
    arrived = max(np.max(np.abs(miss_x)), np.max(np.abs(miss_y))) < 1e-14
    if not (arrived and np.all(a > 0) and np.all(a * d - b * c > 0)):  # else beyond a fold
        raise ValueError("the distortion cannot be undone there")
    return x, y


# --- camera ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Eye:
    """axes [3, 3]: rows x, y, z. focus: F. centre, scale: of the calibrated picture, in its pixels (column, row).

    terms: eight of OpenCV's. first, joined: the stored picture begins at this pixel and joins so many (columns, rows).
    size: (columns, rows) that are stored. stop: diameter of the aperture; stop_offset: (a0, b0).
    """

    place: np.ndarray
    axes: np.ndarray
    focus: float
    centre: tuple[float, float]
    scale: tuple[float, float]
    size: tuple[int, int]
    terms: tuple[float, ...] = (0.0,) * 8
    first: tuple[float, float] = (0.0, 0.0)
    joined: tuple[int, int] = (1, 1)
    stop: float = 1.0
    stop_offset: tuple[float, float] = (0.0, 0.0)
    transmittance: float = 1.0

    @classmethod
    def of(cls, camera: dict) -> Eye:
        """The camera of a scene file's table [camera]."""
        place, target = np.array(camera["position_mm"], float), camera.get("look_at_mm", (0.0, 0.0, 0.0))
        inner, detector = camera.get("intrinsics", {}), camera["detector"]
        focus = camera.get("focus_distance_mm", math.dist(place, target))
        image = 1 / (1 / camera["focal_length_mm"] - 1 / focus)
        joined = tuple(inner.get("binning", (1, 1)))
        size = tuple(detector["pixels"])
        whole = inner.get("image_size_px", [n * b for n, b in zip(size, joined, strict=True)])
        plain = [image / (detector["pitch_mm"] / b) for b in joined]
        return cls(
            place=place,
            axes=frame_axes(place, target, math.radians(camera.get("roll_deg", 0.0))),
            focus=focus,
            centre=tuple(inner.get("principal_point_px", [(n - 1) / 2 for n in whole])),
            scale=(inner.get("fx", plain[0]), inner.get("fy", plain[1])),
            size=size,
            terms=(*inner.get("distortion", ()), *[0.0] * 8)[:8],
            first=tuple(inner.get("roi_px", (0, 0))),
            joined=joined,
            stop=camera["aperture_diameter_mm"],
            stop_offset=tuple(camera.get("aperture_offset_mm", (0.0, 0.0))),
            transmittance=camera.get("transmittance", 1.0),
        )

    def ideal_point(self, row, column) -> tuple[np.ndarray, np.ndarray]:
        """Undistorted image point (x, y up), over the image distance, of a place on the upright grid."""
        line = self.size[1] - 1 - np.asarray(row, float)  # of the stored picture, its first at the top
        places = [
            first + (k + 0.5) * b - 0.5
            for first, k, b in zip(self.first, (np.asarray(column, float), line), self.joined, strict=True)
        ]
        bent = [(k - c) / f for k, c, f in zip(places, self.centre, self.scale, strict=True)]
        x, y_down = unbend(*bent, self.terms)
        return x, -y_down

    def grid_place(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        """(row, column) on the upright grid of an undistorted image point: ideal_point turned round."""
        bent = bend(x, -y, self.terms)
        places = [c + f * k for k, c, f in zip(bent, self.centre, self.scale, strict=True)]
        column, line = (
            (k - first + 0.5) / b - 0.5 for k, first, b in zip(places, self.first, self.joined, strict=True)
        )
        return self.size[1] - 1 - line, column

    def picture_area(self, row, column) -> np.ndarray:
        """d(x) d(y) per d(row) d(column) of the upright grid, above 0."""
        x, y = self.ideal_point(row, column)
        a, b, c, d = bend_slopes(x, -y, self.terms)
        return self.joined[0] * self.joined[1] / (self.scale[0] * self.scale[1]) / (a * d - b * c)

    def looks_along(self, row, column, a=0.0, b=0.0) -> tuple[np.ndarray, np.ndarray]:
        """World points on the aperture and directions to the mirror [..., 3] of the rays that make a pixel's image."""
        x, y = self.ideal_point(row, column)
        p = (a + self.stop_offset[0]) / self.focus - x
        q = (b + self.stop_offset[1]) / self.focus - y
        p, q, a, b = np.broadcast_arrays(p, q, a, b)
        start = self.place + a[..., None] * self.axes[0] + b[..., None] * self.axes[1]
        return start, -(p[..., None] * self.axes[0] + q[..., None] * self.axes[1] + self.axes[2])

    def receives(self, points, directions) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(row, column, a, b) of lines through world points along world directions; the aperture's rim is ignored."""
        at, along = (points - self.place) @ self.axes.T, directions @ self.axes.T
        p, q = along[..., 0] / along[..., 2], along[..., 1] / along[..., 2]
        a, b = at[..., 0] - p * at[..., 2], at[..., 1] - q * at[..., 2]
        row, column = self.grid_place(
            (a + self.stop_offset[0]) / self.focus - p, (b + self.stop_offset[1]) / self.focus - q
        )
        return row, column, a, b
