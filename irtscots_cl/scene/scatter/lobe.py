"""Properties of every lobe of scattered light: density, table for the kernels, total. float64 on the host.

A direction is given by beta [..., 2], the projection of its unit vector onto the surface's tangent plane (its direction
cosines); beta0 is the projection of the specular direction. All lobes here are shift-invariant: their BSDF [1/sr]
depends only on d = |beta - beta0|. Since cos(theta) dOmega = d^2 beta, the scattered fraction of the light is the
integral of the BSDF over the unit disk of beta, the hemisphere. The part of a lobe outside the disk is cut off.
"""

from __future__ import annotations

import abc

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import exprel, hyp2f1

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.validation import problem

OBLIQUE_NODES = 1024  # only rounding errors remain, even for the steepest lobe at grazing incidence
MIN_COSINE = 1e-12  # of the angle of incidence; closer to grazing incidence, no lobe of an allowed width changes
TABLE_NODES = 4096
MIN_SHARE = 1e-22  # of a lobe, where the table begins; no generator gives such small uniform numbers
NEWTON_STEPS = 3  # from the middle of a cell, 1 % of d; the error is then 1e-13
GAUSS_NODES = (np.array([0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5]), np.array([5, 8, 5]) / 18)  # of three points in (0, 1)


class ScatterModel(abc.ABC):
    """A lobe, BSDF = _scale * _profile(d), with the methods that all models share."""

    @property
    @abc.abstractmethod
    def _scale(self) -> float:
        """The BSDF's scale [1/sr]."""

    @abc.abstractmethod
    def _profile(self, d: FloatArray) -> FloatArray:
        """The BSDF's shape, without its scale, at distances d of any shape."""

    @abc.abstractmethod
    def _area(self, x: FloatArray) -> FloatArray:
        """2 pi times the integral of _profile(d) d from 0 to x."""

    @abc.abstractmethod
    def _distance(self, area: FloatArray) -> FloatArray:
        """The x whose _area is `area`, for values from 0 to _area(2); rounding may make `area` slightly larger."""

    def bsdf(self, d: ArrayLike) -> FloatArray:
        """BSDF [1/sr] at distances d [...] from the specular direction."""
        return self._scale * self._profile(np.asarray(d, float))

    def lobe(self, x: ArrayLike) -> FloatArray:
        """Integral of the BSDF over d < x [...], including the part below the horizon."""
        return self._scale * self._area(np.asarray(x, float))

    def tis_at(self, sin0: ArrayLike = 0.0) -> FloatArray:
        """Total integrated scatter [...]: the fraction into the hemisphere when |beta0| = sin0 [...], 0 to 1."""
        return self.above_horizon(check_sine("tis_at", sin0))

    def above_horizon(self, sin0: ArrayLike = 0.0) -> FloatArray:
        """Integral of the BSDF [...] over the hemisphere when |beta0| = sin0 [...], 0 to 1: the lobe without its cut.

        In polar coordinates about beta0 it is the mean over the azimuth of lobe(D), where D = -sin0 cos(azimuth) +
        (1 - sin0^2 sin^2(azimuth))^(1/2) is the distance to the horizon. With sin0 cos(azimuth) = cos0 sinh(w) that is
        D = cos0 exp(-w), |w| <= W = arsinh(tan0). This is a smooth function of w even near grazing incidence, where D
        spans decades. With w = W sin(t) the midpoint rule in t converges exponentially.
        """
        sin0 = check_sine("above_horizon", sin0)
        t = (np.arange(OBLIQUE_NODES) + 0.5) * (np.pi / OBLIQUE_NODES) - np.pi / 2
        cos0 = np.maximum(np.sqrt((1 - sin0) * (1 + sin0)), MIN_COSINE)[..., None]
        top = np.maximum(np.arcsinh(sin0[..., None] / cos0), 1e-9)  # W; the square of the minimum is negligible
        w = top * np.sin(t)
        to_top, to_bottom = (2 * top * np.sin(np.pi / 4 + sign * t / 2) ** 2 for sign in (-1, 1))  # W - w, W + w
        weight = top * np.cos(t) * np.cosh(w) / np.sqrt(np.sinh(to_top) * np.sinh(to_bottom))
        oblique = np.mean(weight * self.lobe(cos0 * np.exp(-w)), -1)
        return np.where(sin0 == 0, self.lobe(1.0), oblique)[()]

    def sample(self, u: ArrayLike, beta0: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Directions beta [..., 2] drawn from the lobe about beta0 [..., 2] by u [..., 2], uniform in (0, 1).

        Returns the directions, and whether each lies above the horizon [...]. u[..., 0] is the share of
        lobe(1 + |beta0|) that lies nearer to beta0; u[..., 1] is the azimuth in turns.
        """
        u, beta0 = np.asarray(u, float), np.asarray(beta0, float)
        farthest = 1 + np.hypot(beta0[..., 0], beta0[..., 1])
        d = np.minimum(self._distance(u[..., 0] * self._area(farthest)), farthest)
        azimuth = 2 * np.pi * u[..., 1]
        beta = beta0 + np.stack([d * np.cos(azimuth), d * np.sin(azimuth)], -1)
        return beta, np.hypot(beta[..., 0], beta[..., 1]) <= 1

    def pdf(self, beta: ArrayLike, beta0: ArrayLike) -> FloatArray:
        """Density [...] per d^2 beta of sample's outcomes, at beta [..., 2] of at most 1 + |beta0| from beta0."""
        beta, beta0 = np.asarray(beta, float), np.asarray(beta0, float)
        away = beta - beta0
        farthest = 1 + np.hypot(beta0[..., 0], beta0[..., 1])
        return self._profile(np.hypot(away[..., 0], away[..., 1])) / self._area(farthest)


def mean_profile(c: float, z: FloatArray) -> FloatArray:
    """2F1(1, c; 1 + c; -z) for c > 0, z >= 0: the mean of 1 / (1 + z s) over s in (0, 1) with the density c s^(c - 1).

    Up to z = 4, Pfaff's transformation (DLMF 15.8.1) gives a series of positive terms. Beyond it, the integral over
    y = z s from 4 to z uses 1 / (1 + y) = 1/y - 1/y^2 + ..., integrated term by term. The usual transformation to
    1 / z, which SciPy uses, has poles that cancel at integer c, and loses nine digits near g = 2.
    """
    near, far = np.minimum(z, 4.0), np.maximum(z, 4.0)
    inner = hyp2f1(1.0, 1.0, 1 + c, near / (1 + near)) / (1 + near)
    rise = np.log(far / 4.0)  # 0 if z <= 4
    outer = np.zeros_like(rise)
    for n in range(28):  # 4^-28 is 1e-17
        q = c - 1 - n  # the integral of y^(q - 1) from 4 to z, divided by z^c, in a form that does not overflow
        term = far ** (-1.0 - n) * exprel(-q * rise) if q > 0 else far**-c * 4.0**q * exprel(q * rise)
        outer += term if n % 2 == 0 else -term
    mean: FloatArray = np.exp(-c * rise) * inner + c * rise * outer
    return mean


def check_all(source: str, key: str, value: FloatArray, allowed: BoolArray, text: str) -> None:
    """Raise SceneError for the first value where `allowed`, of the same shape, is false."""
    if not np.all(allowed):
        raise problem(source, (key,), f"must be {text}", float(value[~allowed][0]))


def check_sine(source: str, sin0: ArrayLike) -> FloatArray:
    """sin0 [...] as an array. Raises SceneError unless all are 0 to 1."""
    sin0 = np.asarray(sin0, float)
    check_all(source, "sin0", sin0, (sin0 >= 0) & (sin0 <= 1), "0 to 1")
    return sin0
