"""The budget to first order: covariances of the height map and of its Zernike terms, and who makes them vary.

With independent values x of variance s^2 and height maps H per unit, the error is b + sum x H + processes, b of the
constants. Its mean square Q = b^2 + 2 sum_i x_i b H_i + sum_ij x_i x_j G_ij, G the maps' products, has an exact
variance, whose parts are the Sobol indices of Q (Sobol, Math. Comput. Simul. 55 (2001) 271) for the linear test. Joint
sources are first made independent (budget/joint.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.budget.distributions import excess
from irtscots_cl.budget.joint import NONE, Joint
from irtscots_cl.budget.measured_design import NOLLS, MeasuredDesign
from irtscots_cl.budget.sensitivity import NM, Sensitivity, zernike_coefficients
from irtscots_cl.budget.source import Kind
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.error_sources import Distribution


@dataclass(frozen=True)
class LinearBudget:
    """nm: {name: rms [4] that a source's standard deviation makes}, with LEFT_AFTER removed. total_nm: [4].

    zernike_covariance_nm2: [terms, terms] of all sources together. deviation_mm, constant_mm: [n] standard deviation of
    the height at each pixel, and its mean, which the constants make. first, total: {name: Sobol index of the mean
    square}; all with piston and tilt removed.
    """

    nm: dict[str, FloatArray]
    total_nm: FloatArray
    zernike_covariance_nm2: FloatArray = field(repr=False)
    deviation_mm: FloatArray = field(repr=False)
    constant_mm: FloatArray = field(repr=False)
    first: dict[str, float]
    total: dict[str, float]


@dataclass(frozen=True)
class ErrorPart:
    """Sources that vary by themselves: one, or all joint ones. maps: [rows, n] height of one standard deviation each;
    of draws of a process, or of independent numbers that act together. excess: of these numbers."""

    names: tuple[str, ...]
    maps: FloatArray
    excess: float
    is_process: bool

    @property
    def share(self) -> float:
        """Of each row in the variance."""
        return 1 / len(self.maps) if self.is_process else 1.0


def linear_budget(
    design: MeasuredDesign, found: Mapping[str, Sensitivity], given: Mapping[str, Distribution], joint: Joint = NONE
) -> LinearBudget:
    """found, given: of the same names. joint: those of them that vary together."""
    nm = {name: found[name].left_nm * distribution.sigma for name, distribution in given.items()}
    constant = sum_of_constants(found, given, design.count)
    total, variance = (design.response.left(constant[None])[0] * NM) ** 2, np.zeros(design.count)
    covariance = np.zeros((len(NOLLS), len(NOLLS)))
    parts = error_parts(found, given, joint)
    for part in parts:
        total = total + part.share * np.sum((design.response.left(part.maps) * NM) ** 2, axis=0)
        variance = variance + part.share * np.sum(design.response.without(part.maps, LEFT_AFTER[0]) ** 2, axis=0)
        terms = zernike_coefficients(design, part.maps) * NM
        covariance = covariance + part.share * terms.T @ terms
    constant = design.response.without(constant[None], LEFT_AFTER[0])[0]
    first, of_all = _sobol(design, parts, constant)
    still = {name: 0.0 for name in given if name not in first}
    return LinearBudget(nm, np.sqrt(total), covariance, np.sqrt(variance), constant, first | still, of_all | still)


def sum_of_constants(found: Mapping[str, Sensitivity], given: Mapping[str, Distribution], count: int) -> FloatArray:
    """Height [count] in mm that the constants of a budget make together, in every test."""
    maps = [found[name].height_mm * one.size for name, one in given.items() if _is_constant(found[name])]
    return np.sum(maps, axis=0) if maps else np.zeros(count)


def _is_constant(one: Sensitivity) -> bool:
    return one.source.kind is Kind.CONSTANT


def error_parts(found: Mapping[str, Sensitivity], given: Mapping[str, Distribution], joint: Joint) -> list[ErrorPart]:
    """What varies from test to test, of the same sources; joint ones together."""
    parts = [
        ErrorPart(
            (name,), np.atleast_2d(found[name].height_mm) * one.sigma, excess(one), found[name].source.kind.is_random
        )
        for name, one in given.items()
        if name not in joint.names and not _is_constant(found[name])
    ]
    if joint.names:
        together = np.stack([found[name].height_mm for name in joint.names])
        parts.append(ErrorPart(joint.names, joint.independent(together), excess(Distribution(normal=1.0)), False))
    return parts


def _sobol(
    design: MeasuredDesign, parts: list[ErrorPart], constant_mm: FloatArray
) -> tuple[dict[str, float], dict[str, float]]:
    """First and total indices of the mean square, by name; joint sources have those of all of them.

    constant_mm: [n] of the constants, without the terms that are removed. A process's mean square hardly varies: it
    counts with the variance over its draws.
    """
    names = [name for part in parts for name in part.names]
    maps = [design.response.without(part.maps, LEFT_AFTER[0]) for part in parts]
    variance = np.zeros((len(parts), len(parts)))
    for k, (part, own) in enumerate(zip(parts, maps, strict=True)):
        variance[k, k] = _alone(part, own) + 4 * part.share * float(np.sum((own @ constant_mm / own.shape[1]) ** 2))
        for j in range(k):
            if not (part.is_process and parts[j].is_process):
                squares = np.sum((own @ maps[j].T / own.shape[1]) ** 2)
                variance[k, j] = variance[j, k] = 4 * part.share * parts[j].share * squares
    whole = float(np.triu(variance).sum())
    if not whole > 0:
        return dict.fromkeys(names, 0.0), dict.fromkeys(names, 0.0)
    first, total = np.diag(variance) / whole, variance.sum(1) / whole
    return (
        {name: float(first[k]) for k, part in enumerate(parts) for name in part.names},
        {name: float(total[k]) for k, part in enumerate(parts) for name in part.names},
    )


def _alone(part: ErrorPart, maps: FloatArray) -> float:
    """Variance of the mean square by one part alone."""
    if part.is_process:
        return float(np.var(np.mean(maps**2, axis=1), ddof=1))
    gram = maps @ maps.T / maps.shape[1]
    own = np.diag(gram) ** 2
    return float(part.excess * own.sum() + 2 * (np.sum(gram**2) - own.sum()))
