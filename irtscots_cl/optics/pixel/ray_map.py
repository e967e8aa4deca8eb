"""The local map of a detector pixel: the origin of its light on the mirror and on the screen, to second order.

A ray that enters the camera is defined by its point on the pixel and its point on the aperture. Its points on the
screen and on the mirror are smooth functions of these four numbers; over one pixel a quadratic suffices. The quadratic
is fitted to float64 rays as a projection onto quadratics. The fit's points have the second moments of a uniform pixel
and aperture, so the mean effect of third-order aperture terms is preserved. The estimators that integrate light in
closed form use this map.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import product

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.system import interruption

OUTPUTS = ("u", "v", "x", "y")  # landing point in the screen's frame, mirror point in the world's [mm]
# Monomials of (s, t, a, b): position along column and row in half pixels, and on the aperture in radii.
_POWERS = np.array([p for order in range(3) for p in product(range(3), repeat=4) if sum(p) == order])
_INDEX = {tuple(p): k for k, p in enumerate(_POWERS.tolist())}


def _design() -> np.ndarray:
    """Points [25, 4] of the fit: a cross on the axes and, for the mixed terms, the corners with a uniform
    distribution's second moments (1/3 along a pixel, 1/4 along a disk)."""
    corners = np.array(list(product((-1, 1), repeat=4))) * [3**-0.5, 3**-0.5, 0.5, 0.5]
    cross = np.concatenate([sign * np.eye(4) for sign in (-1.0, 1.0)])
    return np.concatenate([np.zeros((1, 4)), cross, corners])


def _monomials(points: np.ndarray) -> np.ndarray:
    return np.prod(points[:, None, :] ** _POWERS, axis=-1)


@lru_cache
def _place(monomial: str) -> int:
    """Where a monomial such as "sa" is among _POWERS."""
    return _INDEX[tuple(monomial.count(name) for name in "stab")]


_POINTS = _design()
MANY_PIXELS = 2**15  # fitted at once; more go in parts of
PIXELS_OF_PART = 2**12
RAYS = len(_POINTS)  # to which a pixel's map is fitted
_FIT = np.linalg.pinv(_monomials(_POINTS))


@dataclass(frozen=True)
class RayMap:
    """Quadratic maps of n pixels.

    row, column: [n] of the pixels. coefficient: [15, 4, n] of the monomials of (s, t, a, b), for OUTPUTS. residual:
    [2, n] rms residual of the fit in u and v [mm].
    """

    row: np.ndarray
    column: np.ndarray
    coefficient: np.ndarray = field(repr=False)
    residual: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, chief: ChiefRays, row: np.ndarray, column: np.ndarray) -> RayMap:
        """Fit the maps of the pixels row, column [n]."""
        if row.size <= MANY_PIXELS:
            return cls._fitted(chief, row, column)
        coefficient, residual = np.empty((len(_POWERS), len(OUTPUTS), row.size)), np.empty((2, row.size))
        for first in range(0, row.size, PIXELS_OF_PART):
            part = slice(first, first + PIXELS_OF_PART)
            fitted = cls._fitted(chief, row[part], column[part])
            coefficient[..., part], residual[:, part] = fitted.coefficient, fitted.residual
        return cls(row, column, coefficient, residual)

    @classmethod
    def _fitted(cls, chief: ChiefRays, row: np.ndarray, column: np.ndarray) -> RayMap:
        radius = chief.scene.camera.aperture_diameter_mm / 2
        s, t, a, b = _POINTS.T[:, :, None]
        points, u, v = chief.reverse(row + t / 2, column + s / 2, a * radius, b * radius)
        interruption.check()
        values = np.stack([u, v, points[..., 0], points[..., 1]], 1)  # [25, 4, n]
        coefficient = np.tensordot(_FIT, values, 1)
        interruption.check()
        left = values[:, :2] - np.tensordot(_monomials(_POINTS), coefficient[:, :2], 1)
        return cls(row, column, coefficient, np.sqrt(np.mean(left**2, axis=0)))

    def part(self, chosen: np.ndarray) -> RayMap:
        """The maps of some of the pixels: an index array or a mask."""
        parts = (self.row, self.column, self.coefficient, self.residual)
        return RayMap(*(values[..., chosen] for values in parts))

    def term(self, output: str, monomial: str = "") -> np.ndarray:
        """Coefficient [n] of an output's monomial, such as "sa" for s a."""
        return self.coefficient[_place(monomial), OUTPUTS.index(output)]

    def centre(self, output: str, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The output [n, ...] of the chief ray (a = b = 0) at the pixels' points s, t [n, ...]."""
        one, ks, kt, kss, kst, ktt = self._terms(output, s, ("", "s", "t", "ss", "st", "tt"))
        return one + s * (ks + kss * s + kst * t) + t * (kt + ktt * t)

    def gradient(self, output: str, along: str, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Derivative [n, ...] of the output along "s", "t", "a" or "b", at a = b = 0 and s, t [n, ...]."""
        first, by_s, by_t = self._terms(output, s, (along, "s" + along, "t" + along))
        return first + by_s * s * (1 + (along == "s")) + by_t * t * (1 + (along == "t"))

    def _terms(self, output: str, like: np.ndarray, monomials: tuple[str, ...]) -> list[np.ndarray]:
        """Coefficients shaped to broadcast against `like` [n, ...]."""
        shape = (-1,) + (1,) * (np.ndim(like) - 1)
        return [self.term(output, monomial).reshape(shape) for monomial in monomials]

    @cached_property
    def corner_radius(self) -> np.ndarray:
        """Distances [n, 4] of the corners' mirror points from the mirror's axis [mm]."""
        s, t = (np.broadcast_to(edge, (len(self.row), 4)) for edge in ([-1.0, 1, -1, 1], [-1.0, -1, 1, 1]))
        return np.hypot(self.centre("x", s, t), self.centre("y", s, t))
