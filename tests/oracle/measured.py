"""Heights that a real test reports, independent of the package: its screen points, read with the set-up as described.

Chief rays of the pixels' centres give what the real set-up would record: grid coordinates (u, v). The described set-up
turns them into slopes, by the normal that halves the angle between the ways to camera and screen, and into heights, by
least squares with polynomials. Nothing here knows light curves, pixels' means or differences between neighbours.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from oracle.panel import unit
from oracle.rig import Path, Rig

ORDER = 10  # of the polynomials; 14 changes the figures of the tests by less than 0.01 nm
ROUNDS = 5  # of feeding heights back: each leaves about 1/100 of the last
TERMS = {
    "piston_tilt": 3,
    "piston_tilt_power": 4,
    "piston_tilt_power_astigmatism": 6,
    "piston_tilt_power_astigmatism_coma": 8,
}


@dataclass(frozen=True)
class Seen:
    """Pixels [n] whose centres the described set-up puts on the mirror, and what was recorded there: u, v.

    path: of their chief rays in the described set-up. pixels: (row, column). towards: directions from the camera.
    """

    described: Rig
    pixels: tuple[np.ndarray, np.ndarray]
    path: Path
    towards: np.ndarray
    u: np.ndarray
    v: np.ndarray

    @property
    def radius(self) -> float:
        return self.described.mirror.mirror.diameter_mm / 2

    @cached_property
    def polynomials(self) -> Polynomials:
        return Polynomials(self.path.mirror[:, 0], self.path.mirror[:, 1], self.radius)

    def through(self, real: Rig) -> Seen:
        """What the real set-up records on the same pixels."""
        there = real.back(*self.pixels)
        seen = dataclasses.replace(self, u=there.u, v=there.v)
        vars(seen)["polynomials"] = self.polynomials  # the points are the same
        return seen


def record(described: Rig) -> Seen:
    """What a set-up that is as described records."""
    row, column = described.pixel_grid()
    points = described.back(row, column).mirror
    used = described.mirror.contains(points)
    row, column = row[used], column[used]
    path = described.back(row, column)
    return Seen(described, (row, column), path, described.eye.looks_along(row, column)[1], path.u, path.v)


def design_at(rig: Rig, x, y) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Height and slopes of the design at mirror places."""
    down = np.zeros((*np.shape(x), 3))
    down[..., 2] = -1.0
    point = rig.mirror.meet(np.stack([x, y, np.zeros_like(x)], -1), down)
    gx, gy, gz = np.moveaxis(rig.mirror.implicit(point)[1], -1, 0)
    return point[..., 2], -gx / gz, -gy / gz


def seen_from(rig: Rig, points, u, v) -> np.ndarray:
    """World points [..., 3] in whose direction the pixels (u, v) appear from mirror points; glass lifts them."""
    start = rig.panel.world(u, v)
    for _ in range(8 if rig.panel.thickness else 0):
        start = rig.panel.leaves(u, v, points - start)
    return start


def halving_slopes(points, screen, camera) -> tuple[np.ndarray, np.ndarray]:
    normal = unit(screen - points) + unit(camera - points)
    return -normal[..., 0] / normal[..., 2], -normal[..., 1] / normal[..., 2]


class Polynomials:
    """Least-squares heights of slopes at points x, y of a disk: products of Chebyshev polynomials up to an order."""

    def __init__(self, x, y, radius: float, order: int = ORDER):
        unit_of = np.eye(order + 1)
        values = [[chebyshev.chebval(k / radius, c) for c in unit_of] for k in (x, y)]
        slopes = [[chebyshev.chebval(k / radius, chebyshev.chebder(c)) / radius for c in unit_of] for k in (x, y)]
        pairs = [(i, j) for i in range(order + 1) for j in range(order + 1 - i) if i + j]
        self.heights = np.stack([values[0][i] * values[1][j] for i, j in pairs], -1)
        by_x = np.stack([slopes[0][i] * values[1][j] for i, j in pairs], -1)
        by_y = np.stack([values[0][i] * slopes[1][j] for i, j in pairs], -1)
        matrix = np.concatenate([by_x, by_y])
        self.scale = np.linalg.norm(matrix, axis=0)
        self.directions, self.triangle = np.linalg.qr(matrix / self.scale)

    def fit(self, slope_x, slope_y) -> np.ndarray:
        """Heights of zero mean at the points."""
        found = np.linalg.solve(self.triangle, self.directions.T @ np.concatenate([slope_x, slope_y]))
        height = self.heights @ (found / self.scale)
        return height - height.mean()


def heights(seen: Seen, rounds: int = ROUNDS) -> np.ndarray:
    """Deviation [n] in mm from the design, zero mean, at the used pixels.

    With rounds = 1 the mirror points are the design's. Further rounds move each along its chief ray by the height
    found: the result is then the surface that, in the described set-up, sends the light where it was recorded.
    """
    rig, start = seen.described, seen.path.mirror
    _, slope_x, slope_y = design_at(rig, start[:, 0], start[:, 1])
    rise = seen.towards[:, 2] - slope_x * seen.towards[:, 0] - slope_y * seen.towards[:, 1]
    height = np.zeros(len(start))
    for _ in range(rounds):
        points = start + seen.towards * (height / rise)[:, None]
        found = halving_slopes(points, seen_from(rig, points, seen.u, seen.v), rig.eye.place)
        _, *design = design_at(rig, points[:, 0], points[:, 1])
        height = seen.polynomials.fit(found[0] - design[0], found[1] - design[1])
    return height


def heights_of_moved_devices(seen: Seen, moved: Rig) -> np.ndarray:
    """Deviation in mm when mirror points and grid coordinates stay, and only the devices move."""
    points = seen.path.mirror
    _, *design = design_at(seen.described, points[:, 0], points[:, 1])
    found = halving_slopes(points, seen_from(moved, points, seen.u, seen.v), moved.eye.place)
    return seen.polynomials.fit(found[0] - design[0], found[1] - design[1])


def left_nm(seen: Seen, height) -> dict[str, float]:
    """Rms in nm of what is left of a height map without low orders, fitted together by least squares."""
    x, y = seen.path.mirror[:, 0] / seen.radius, seen.path.mirror[:, 1] / seen.radius
    s = x * x + y * y
    basis = np.stack([np.ones_like(x), x, y, s, x * x - y * y, x * y, s * x, s * y], -1)
    left = {}
    for name, count in TERMS.items():
        fitted = basis[:, :count] @ np.linalg.lstsq(basis[:, :count], height, rcond=None)[0]
        left[name] = float(np.sqrt(np.mean((height - fitted) ** 2))) * 1e6
    return left
