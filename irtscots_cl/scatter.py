"""Scatter of optical surfaces: how much light leaves the specular direction, and where to. float64 on the host.

A direction is told by beta [..., 2], the projection of its unit vector onto the surface's tangent plane (its direction
cosines); beta0 is that of the specular direction. All lobes here are shift-invariant: their BSDF [1/sr] depends on
d = |beta - beta0| alone. As cos(theta) dOmega = d^2 beta, the scattered fraction of the light is the integral of the
BSDF over the unit disk of beta, the hemisphere; what a lobe has outside it is cut.

J. C. Stover, Optical Scattering: Measurement and Analysis, 3rd ed., SPIE 2012, has the definitions and the models.
"""

from __future__ import annotations

import abc
import functools
import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field, Strict, TypeAdapter, ValidationError, model_validator
from scipy.special import exprel, hyp2f1

from irtscots_cl.checked import Fraction, _range, checked, nearest, problem, refuse, shown_word, translate

__all__ = ["ABg", "Harvey", "Lambertian", "ScatterModel", "scatter_from_table", "tis_of_roughness"]

OBLIQUE_NODES = 1024  # rounding remains, even of the steepest lobe at grazing incidence
LEAST_COSINE = 1e-12  # of the angle of incidence; closer to grazing no lobe of the widths allowed changes
TABLE_NODES = 4096
LEAST_SHARE = 1e-22  # of a lobe that the table begins at; no generator's uniform numbers go so low
NEWTON_STEPS = 3  # from the middle of a cell, 1 % of d: 1e-13
_GAUSS = (np.array([0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5]), np.array([5, 8, 5]) / 18)  # of three points in (0, 1)

_WIDTH = _range(ge=1e-9, le=1e9)
_SLOPE = _range(ge=-10, le=0)
_SCALE = _range(gt=0, le=1e12)
_KNEE = _range(ge=1e-30, le=1e12)
_POWER = _range(ge=0, le=10)
_OptionalScale = Annotated[Annotated[float, Strict(), _SCALE] | None, Field(description=_SCALE.description)]
_LENGTH = _range(gt=0, le=1e6)
_OptionalLength = Annotated[Annotated[float, Strict(), _LENGTH] | None, Field(description=_LENGTH.description)]
SIZES = ("b0", "tis", "roughness_nm")  # of a Harvey lobe
_OptionalFraction = Annotated[Fraction | None, Field(description="a finite number above 0 and at most 1")]


class ScatterModel(abc.ABC):
    """A lobe, BSDF = _scale * _profile(d), and what follows from it for every model alike."""

    _scale: float

    @abc.abstractmethod
    def _profile(self, d: np.ndarray) -> np.ndarray:
        """The BSDF's shape, without its scale, at distances d of any shape."""

    @abc.abstractmethod
    def _area(self, x: np.ndarray) -> np.ndarray:
        """2 pi times the integral of _profile(d) d from 0 to x."""

    @abc.abstractmethod
    def _distance(self, area: np.ndarray) -> np.ndarray:
        """The x whose _area is `area`, of any value from 0 to _area(2); rounding may make it a little larger."""

    def bsdf(self, d) -> np.ndarray:
        """BSDF [1/sr] at distances d [...] from the specular direction."""
        return self._scale * self._profile(np.asarray(d, float))

    def lobe(self, x) -> np.ndarray:
        """Integral of the BSDF over d < x [...], whether or not that lies above the horizon."""
        return self._scale * self._area(np.asarray(x, float))

    def tis_at(self, sin0=0.0) -> np.ndarray:
        """Total integrated scatter [...]: the fraction into the hemisphere when |beta0| = sin0 [...], 0 to 1.

        In polar coordinates about beta0 it is the mean over the azimuth of lobe(D), where D = -sin0 cos(azimuth) +
        (1 - sin0^2 sin^2(azimuth))^(1/2) is the distance to the horizon. With sin0 cos(azimuth) = cos0 sinh(w) that is
        D = cos0 exp(-w), |w| <= W = arsinh(tan0): even near grazing incidence, where D spans decades, a smooth function
        of w. With w = W sin(t) the midpoint rule in t converges exponentially.
        """
        sin0 = np.asarray(sin0, float)
        _check_all("tis_at", "sin0", sin0, (sin0 >= 0) & (sin0 <= 1), "0 to 1")
        t = (np.arange(OBLIQUE_NODES) + 0.5) * (np.pi / OBLIQUE_NODES) - np.pi / 2
        cos0 = np.maximum(np.sqrt((1 - sin0) * (1 + sin0)), LEAST_COSINE)[..., None]
        top = np.maximum(np.arcsinh(sin0[..., None] / cos0), 1e-9)  # W; at 0 its square no longer counts
        w = top * np.sin(t)
        to_top, to_bottom = (2 * top * np.sin(np.pi / 4 + sign * t / 2) ** 2 for sign in (-1, 1))  # W - w, W + w
        weight = top * np.cos(t) * np.cosh(w) / np.sqrt(np.sinh(to_top) * np.sinh(to_bottom))
        oblique = np.mean(weight * self.lobe(cos0 * np.exp(-w)), -1)
        return np.where(sin0 == 0, self.lobe(1.0), oblique)[()]

    def sample(self, u, beta0) -> tuple[np.ndarray, np.ndarray]:
        """Directions beta [..., 2] drawn from the lobe about beta0 [..., 2] by u [..., 2], uniform in (0, 1).

        Also whether each lies above the horizon [...]. u[..., 0] is the share of lobe(1 + |beta0|) that lies nearer to
        beta0, u[..., 1] the azimuth in turns.
        """
        u, beta0 = np.asarray(u, float), np.asarray(beta0, float)
        farthest = 1 + np.hypot(beta0[..., 0], beta0[..., 1])
        d = np.minimum(self._distance(u[..., 0] * self._area(farthest)), farthest)
        azimuth = 2 * np.pi * u[..., 1]
        beta = beta0 + np.stack([d * np.cos(azimuth), d * np.sin(azimuth)], -1)
        return beta, np.hypot(beta[..., 0], beta[..., 1]) <= 1

    def pdf(self, beta, beta0) -> np.ndarray:
        """Density [...] per d^2 beta of sample's outcomes, at beta [..., 2] of at most 1 + |beta0| from beta0."""
        beta, beta0 = np.asarray(beta, float), np.asarray(beta0, float)
        away = beta - beta0
        farthest = 1 + np.hypot(beta0[..., 0], beta0[..., 1])
        return self._profile(np.hypot(away[..., 0], away[..., 1])) / self._area(farthest)


@checked("lambertian")
class Lambertian(ScatterModel):
    """BSDF = tis / pi everywhere."""

    tis: Fraction

    @property
    def _scale(self) -> float:
        return self.tis / math.pi

    def _profile(self, d: np.ndarray) -> np.ndarray:
        return np.ones_like(d)

    def _area(self, x: np.ndarray) -> np.ndarray:
        return np.pi * x * x

    def _distance(self, area: np.ndarray) -> np.ndarray:
        return np.sqrt(area / np.pi)


@checked("harvey")
class Harvey(ScatterModel):
    """Harvey-Shack: BSDF = b0 (1 + (d / l)^2)^(s / 2), of shoulder l and slope s.

    Its size is told by exactly one of b0 [1/sr], of tis, the total integrated scatter at normal incidence, and of
    roughness_nm (rms) with wavelength_nm, from which tis_of_roughness makes that of a mirror.
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
        rough = self.tis is None
        total = tis_of_roughness(self.roughness_nm, self.wavelength_nm, exact=True) if rough else self.tis
        return float(total / self._area(np.float64(1.0)))

    def _profile(self, d: np.ndarray) -> np.ndarray:
        return np.exp(self.s / 2 * np.log1p((d / self.l) ** 2))

    # With v = log(1 + (x / l)^2) and p = s / 2 + 1 the integral is pi l^2 (exp(p v) - 1) / p, at p = 0 pi l^2 v.

    def _area(self, x: np.ndarray) -> np.ndarray:
        v = np.log1p((x / self.l) ** 2)
        return np.pi * self.l**2 * v * exprel((self.s / 2 + 1) * v)

    def _distance(self, area: np.ndarray) -> np.ndarray:
        q = area / (np.pi * self.l**2)
        z = np.maximum((self.s / 2 + 1) * q, -1.0)  # -1 is as far as a steep lobe goes
        with np.errstate(divide="ignore"):
            v = q * np.where(z == 0, 1.0, np.log1p(z) / np.where(z == 0, 1.0, z))
        return self.l * np.sqrt(np.expm1(v))


@checked("abg")
class ABg(ScatterModel):
    """BSDF = a / (b + d^g): it falls off as d^-g beyond the knee at d = b^(1/g)."""

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

    def _profile(self, d: np.ndarray) -> np.ndarray:
        return 1 / (1 + d**self.g / self.b)

    def _area(self, x: np.ndarray) -> np.ndarray:
        return np.pi * x * x * _mean_profile(2 / max(self.g, 1e-100), x**self.g / self.b)

    def _ring(self, log_d: np.ndarray) -> np.ndarray:
        """Growth of _area per unit of the logarithm of d."""
        return 2 * np.pi * np.exp(2 * log_d) / (1 + np.exp(self.g * log_d) / self.b)

    @functools.cached_property
    def _table(self) -> tuple[np.ndarray, np.ndarray]:
        """Logarithms of d, equally spaced up to 2, and _area there."""
        least = LEAST_SHARE * self._area(np.float64(2.0))  # _area is at most pi d^2
        log_d = np.linspace(0.5 * np.log(least / np.pi), np.log(2.0), TABLE_NODES)
        return log_d, np.maximum.accumulate(self._area(np.exp(log_d)))  # rounding where it hardly rises

    def _distance(self, area: np.ndarray) -> np.ndarray:
        """By Newton steps within a cell of the table, in log(d): _ring hardly changes there.

        Where the lobe is complete but for rounding, d is known to a cell.
        """
        log_d, areas = self._table
        wanted, size = np.maximum(area, areas[0]), log_d[1] - log_d[0]
        k = np.minimum(np.searchsorted(areas, wanted, "right") - 1, TABLE_NODES - 2)
        start, rest, step = log_d[k], wanted - areas[k], np.full_like(wanted, size / 2)
        for _ in range(NEWTON_STEPS):
            found = step * sum(w * self._ring(start + x * step) for x, w in zip(*_GAUSS, strict=True))
            step = np.clip(step + (rest - found) / self._ring(start + step), 0.0, size)
        return np.exp(start + step)


def _mean_profile(c: float, z: np.ndarray) -> np.ndarray:
    """2F1(1, c; 1 + c; -z) of c > 0, z >= 0: the mean of 1 / (1 + z s) over s in (0, 1) with the density c s^(c - 1).

    Up to z = 4 by Pfaff's transformation (DLMF 15.8.1), a series of positive terms. From there on the integral over
    y = z s goes on from 4 to z with 1 / (1 + y) = 1/y - 1/y^2 + ..., integrated term by term. The usual transformation
    to 1 / z, SciPy's, has poles that cancel at integer c and loses nine digits near g = 2.
    """
    near, far = np.minimum(z, 4.0), np.maximum(z, 4.0)
    inner = hyp2f1(1.0, 1.0, 1 + c, near / (1 + near)) / (1 + near)
    rise = np.log(far / 4.0)  # 0 where there is no outer part
    outer = np.zeros_like(rise)
    for n in range(28):  # 4^-28 is 1e-17
        q = c - 1 - n  # the integral of y^(q - 1) from 4 to z, over z^c; written so that nothing overflows
        term = far ** (-1.0 - n) * exprel(-q * rise) if q > 0 else far**-c * 4.0**q * exprel(q * rise)
        outer += term if n % 2 == 0 else -term
    return np.exp(-c * rise) * inner + c * rise * outer


def _check_total(model: ScatterModel, key: str, value: float) -> None:
    """Refuse a scale `key` that scatters more light than arrives; a limit rounded to ten digits is accepted."""
    total = float(model.lobe(1.0))
    if total > 1 + 1e-9:
        refuse((key,), value, f"be at most {value / total:.10g}, where the total integrated scatter reaches 1")


def _check_all(source: str, key: str, value: np.ndarray, allowed: np.ndarray, text: str) -> None:
    """Refuse the first value for which `allowed`, of its shape, does not hold."""
    if not np.all(allowed):
        raise problem(source, (key,), f"must be {text}", float(value[~allowed][0]))


def tis_of_roughness(sigma_nm, wavelength_nm, cosine=1.0, exact: bool = False) -> np.ndarray:
    """Total integrated scatter [...] of a mirror of rms roughness Rq = sigma_nm at an angle of incidence's cosine.

    (4 pi sigma cosine / wavelength)^2 for roughness far below the wavelength: H. Davies, Proc. IEE 101 (1954) 209. With
    exact, 1 - exp(-that) for heights of a normal distribution: H. E. Bennett, J. O. Porteus, J. Opt. Soc. Am. 51 (1961)
    123. sigma counts the roughness of the spatial frequencies that scatter into the hemisphere.
    """
    sigma, wavelength, cosine = (np.asarray(v, float) for v in (sigma_nm, wavelength_nm, cosine))
    _check_all("tis_of_roughness", "sigma_nm", sigma, (sigma >= 0) & (sigma < np.inf), "a finite number at least 0")
    _check_all("tis_of_roughness", "wavelength_nm", wavelength, wavelength > 0, "above 0")
    _check_all("tis_of_roughness", "cosine", cosine, (cosine >= 0) & (cosine <= 1), "0 to 1")
    square = (4 * np.pi * sigma * cosine / wavelength) ** 2
    return -np.expm1(-square) if exact else square


# --- the TOML form ------------------------------------------------------------------------------------------


MODELS: dict[str, Any] = {"lambertian": Lambertian, "harvey": Harvey, "abg": ABg}
_adapter = functools.cache(TypeAdapter)


def scatter_from_table(table: dict[str, Any], source: str, steps: tuple[Any, ...] = ()) -> ScatterModel:
    """The model of `{ model = "harvey", l = 0.01, s = -1.5, tis = 0.0025 }`; raises SceneError.

    In its text `source` stands for the file, and `steps` lead from the file's top to the table.
    """
    names = ", ".join(MODELS)
    if not isinstance(table, dict):
        raise problem(source, steps, f"must be a table with the key model, one of {names}", table)
    if "model" not in table:
        known = ["model", *(key for kind in MODELS.values() for key in kind.__pydantic_fields__)]
        for key in table:
            if key not in known:  # model, misspelt
                raise problem(source, (*steps, key), f"unknown key; {nearest(shown_word(key), known[:1])}")
        raise problem(source, (*steps, "model"), f"missing; needs one of {names}")
    name = table["model"]
    if not isinstance(name, str) or name not in MODELS:
        raise problem(source, (*steps, "model"), f"unknown model; {nearest(shown_word(name), MODELS)}", name)
    kind = MODELS[name]
    try:
        return _adapter(kind).validate_python({key: value for key, value in table.items() if key != "model"})
    except ValidationError as error:
        raise translate(error, kind, source, steps) from None
