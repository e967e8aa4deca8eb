"""Models of scattered light: Lambertian, Harvey, ABg. Also the total scatter of a rough mirror or interface.

J. C. Stover, Optical Scattering: Measurement and Analysis, 3rd ed., SPIE 2012, has the definitions and the models.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, Strict, model_validator
from scipy.special import exprel

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.scatter.lobe import (
    GAUSS_NODES,
    MIN_SHARE,
    NEWTON_STEPS,
    TABLE_NODES,
    ScatterModel,
    check_all,
    check_sine,
    mean_profile,
)
from irtscots_cl.scene.validation import Fraction, bounded, checked, refuse

_WIDTH = bounded(ge=1e-9, le=1e9)
_SLOPE = bounded(ge=-10, le=0)
_SCALE = bounded(gt=0, le=1e12)
_KNEE = bounded(ge=1e-30, le=1e12)
_POWER = bounded(ge=0, le=10)
_OptionalScale = Annotated[Annotated[float, Strict(), _SCALE] | None, Field(description=_SCALE.description)]
_LENGTH = bounded(gt=0, le=1e6)
_OptionalLength = Annotated[Annotated[float, Strict(), _LENGTH] | None, Field(description=_LENGTH.description)]
SIZES = ("b0", "tis", "roughness_nm")  # of a Harvey lobe: give one of them
_OptionalFraction = Annotated[Fraction | None, Field(description="a finite number above 0 and at most 1")]


@checked("lambertian")
class Lambertian(ScatterModel):
    """BSDF = tis / pi in all directions. tis: total integrated scatter, 0 to 1."""

    tis: Fraction

    @property
    def _scale(self) -> float:
        return self.tis / math.pi

    def _profile(self, d: FloatArray) -> FloatArray:
        return np.ones_like(d)

    def _area(self, x: FloatArray) -> FloatArray:
        return np.pi * x * x

    def _distance(self, area: FloatArray) -> FloatArray:
        return np.sqrt(area / np.pi)


@checked("harvey")
class Harvey(ScatterModel):
    """Harvey-Shack: BSDF = b0 (1 + (d / l)^2)^(s / 2), with shoulder l and slope s.

    Give exactly one of b0 [1/sr], tis (total integrated scatter at normal incidence), or roughness_nm (rms) with
    wavelength_nm (in vacuum). Raises SceneError otherwise. With roughness_nm the total is that of tis_of_roughness, by
    the incidence and by the media of the surface, and the lobe, cut at the horizon, is scaled to that total: b0 then
    depends on both. bsdf, lobe and above_horizon give it for a mirror at normal incidence, tis_at for a mirror.
    J. E. Harvey, Light-Scattering Characteristics of Optical Surfaces, thesis, University of Arizona, 1976.
    """

    l: Annotated[float, Strict(), _WIDTH]
    s: Annotated[float, Strict(), _SLOPE]
    b0: _OptionalScale = None
    tis: _OptionalFraction = None
    roughness_nm: _OptionalLength = None
    wavelength_nm: _OptionalLength = None

    @model_validator(mode="after")
    def _check(self) -> Harvey:
        given = [key for key in SIZES if getattr(self, key) is not None]
        if not given:
            refuse(("b0",), None, f"be {_SCALE.description}, unless tis or roughness_nm is given in its place")
        if len(given) > 1:
            first, other = given[:2]
            must = f"be left out where {first} ({getattr(self, first)!r}) is given: exactly one of {', '.join(SIZES)}"
            refuse((other,), getattr(self, other), must)
        if (self.roughness_nm is None) != (self.wavelength_nm is None):
            refuse(("wavelength_nm",), self.wavelength_nm, "be given with roughness_nm, and only then")
        if self.b0 is not None:
            _check_total(self, "b0", self.b0)
        return self

    @functools.cached_property
    def _scale(self) -> float:
        if self.b0 is not None:
            return self.b0
        if self.tis is not None:
            total = self.tis
        else:
            assert self.roughness_nm is not None and self.wavelength_nm is not None  # _check has seen to it
            total = float(tis_of_roughness(self.roughness_nm, self.wavelength_nm, exact=True))
        area = self._area(np.float64(1.0))  # type: ignore[arg-type]  # a scalar stands for an array
        return float(total / area)

    @property
    def roughness_phase(self) -> float | None:
        """2 pi roughness / wavelength: phase that the rms height gives light per unit of n cos(theta); else None."""
        if self.roughness_nm is None or self.wavelength_nm is None:
            return None
        return 2 * math.pi * self.roughness_nm / self.wavelength_nm

    def tis_at(self, sin0: ArrayLike = 0.0) -> FloatArray:
        """As of ScatterModel. With roughness_nm: of a mirror, 1 - exp(-(4 pi roughness cos0 / wavelength)^2)."""
        if self.roughness_nm is None or self.wavelength_nm is None:
            return super().tis_at(sin0)
        sin0 = check_sine("tis_at", sin0)
        return tis_of_roughness(self.roughness_nm, self.wavelength_nm, np.sqrt((1 - sin0) * (1 + sin0)), exact=True)

    def _profile(self, d: FloatArray) -> FloatArray:
        return np.exp(self.s / 2 * np.log1p((d / self.l) ** 2))

    # With v = log(1 + (x / l)^2) and p = s / 2 + 1 the integral is pi l^2 (exp(p v) - 1) / p, at p = 0 pi l^2 v.

    def _area(self, x: FloatArray) -> FloatArray:
        v = np.log1p((x / self.l) ** 2)
        area: FloatArray = np.pi * self.l**2 * v * exprel((self.s / 2 + 1) * v)
        return area

    def _distance(self, area: FloatArray) -> FloatArray:
        q = area / (np.pi * self.l**2)
        z = np.maximum((self.s / 2 + 1) * q, -1.0)  # -1 is the limit of a steep lobe
        with np.errstate(divide="ignore"):
            v = q * np.where(z == 0, 1.0, np.log1p(z) / np.where(z == 0, 1.0, z))
        return self.l * np.sqrt(np.expm1(v))


@checked("abg")
class ABg(ScatterModel):
    """BSDF = a / (b + d^g). It falls off as d^-g beyond the knee at d = b^(1/g)."""

    a: Annotated[float, Strict(), _SCALE]
    b: Annotated[float, Strict(), _KNEE]
    g: Annotated[float, Strict(), _POWER]

    @model_validator(mode="after")
    def _check(self) -> ABg:
        _check_total(self, "a", self.a)
        return self

    @property
    def _scale(self) -> float:
        return self.a / self.b

    def _profile(self, d: FloatArray) -> FloatArray:
        return 1 / (1 + d**self.g / self.b)

    def _area(self, x: FloatArray) -> FloatArray:
        return np.pi * x * x * mean_profile(2 / max(self.g, 1e-100), x**self.g / self.b)

    def _ring(self, log_d: FloatArray) -> FloatArray:
        """Derivative of _area by log(d)."""
        return 2 * np.pi * np.exp(2 * log_d) / (1 + np.exp(self.g * log_d) / self.b)

    @functools.cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Logarithms of d, equally spaced up to 2, and _area there."""
        least = MIN_SHARE * self._area(np.float64(2.0))  # type: ignore[arg-type]  # a scalar; _area is at most pi d^2
        log_d = np.linspace(0.5 * np.log(least / np.pi), np.log(2.0), TABLE_NODES)
        return log_d, np.maximum.accumulate(self._area(np.exp(log_d)))  # removes rounding errors where it hardly rises

    def _distance(self, area: FloatArray) -> FloatArray:
        """By Newton steps within a cell of the table, in log(d): _ring hardly changes there.

        Where the lobe is complete within rounding, d is accurate to one cell only.
        """
        log_d, areas = self._table
        wanted, size = np.maximum(area, areas[0]), log_d[1] - log_d[0]
        k = np.minimum(np.searchsorted(areas, wanted, "right") - 1, TABLE_NODES - 2)
        start, rest, step = log_d[k], wanted - areas[k], np.full_like(wanted, size / 2)
        for _ in range(NEWTON_STEPS):
            found = step * sum(w * self._ring(start + x * step) for x, w in zip(*GAUSS_NODES, strict=True))
            step = np.clip(step + (rest - found) / self._ring(start + step), 0.0, size)
        distance: FloatArray = np.exp(start + step)
        return distance


def _check_total(model: ScatterModel, key: str, value: float) -> None:
    """Raise SceneError if the scale `key` scatters more light than arrives. A limit of ten digits is allowed."""
    total = float(model.lobe(1.0))
    if total > 1 + 1e-9:
        refuse((key,), value, f"be at most {value / total:.10g}, where the total integrated scatter reaches 1")


def tis_of_roughness(
    sigma_nm: ArrayLike,
    wavelength_nm: ArrayLike,
    cosine: ArrayLike = 1.0,
    exact: bool = False,
    index: ArrayLike = 1.0,
    index_beyond: ArrayLike | None = None,
) -> FloatArray:
    """Total integrated scatter [...] of a surface with rms roughness Rq = sigma_nm; cosine: of the angle of incidence.

    It is g = (2 pi sigma step / wavelength)^2 for roughness far below the wavelength (in vacuum). step is the change of
    n cos(theta), with theta to the normal: for reflected light 2 n1 cosine in a medium of index n1 (H. Davies, Proc.
    IEE 101 (1954) 209), for light that goes on into index_beyond n2 cos(theta2) - n1 cosine by Snell's law (J. E.
    Harvey, S. Schroeder, N. Choi, A. Duparre, Opt. Eng. 51 (2012) 013402). With exact, it is 1 - exp(-g), for normally
    distributed heights: H. E. Bennett, J. O. Porteus, J. Opt. Soc. Am. 51 (1961) 123. sigma_nm includes only the
    spatial frequencies that scatter into the hemisphere. index_beyond None: reflected light.

    Raises SceneError for a value out of range, and where all light is reflected while index_beyond is given.
    """
    sigma, wavelength, cosine, index = (np.asarray(v, float) for v in (sigma_nm, wavelength_nm, cosine, index))
    check_all("tis_of_roughness", "sigma_nm", sigma, (sigma >= 0) & (sigma < np.inf), "a finite number at least 0")
    check_all("tis_of_roughness", "wavelength_nm", wavelength, wavelength > 0, "above 0")
    check_all("tis_of_roughness", "cosine", cosine, (cosine >= 0) & (cosine <= 1), "0 to 1")
    check_all("tis_of_roughness", "index", index, (index >= 1) & (index < np.inf), "a finite number at least 1")
    step = 2 * index * cosine
    if index_beyond is not None:
        beyond = np.asarray(index_beyond, float)
        check_all("tis_of_roughness", "index_beyond", beyond, (beyond >= 1) & (beyond < np.inf),
                  "a finite number at least 1")  # fmt: skip
        left = np.asarray(beyond**2 - index**2 * (1 - cosine**2))
        check_all("tis_of_roughness", "cosine", np.broadcast_to(cosine, left.shape), left >= 0,
                  "above that of total reflection")  # fmt: skip
        step = np.sqrt(left) - index * cosine
    square: FloatArray = (2 * np.pi * sigma * step / wavelength) ** 2
    return -np.expm1(-square) if exact else square
