"""The budget to first order: covariances of the height map and of its Zernike terms, and who makes them vary.

With independent values x of variance s^2 and height maps H per unit, the error is sum x H + processes. Its mean square
Q = sum_ij x_i x_j G_ij, G the maps' products, has an exact variance, whose parts are the Sobol indices of Q (Sobol,
Math. Comput. Simul. 55 (2001) 271) for the linear test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.sensitivity import NM, Sensitivity, zernike_coefficients
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.error_sources import Distribution

EXCESS = {"normal": 2.0, "uniform": 0.8, "triangular": 1.4}  # variance of x^2 over that of x, squared


@dataclass(frozen=True)
class LinearBudget:
    """nm: {name: rms [4] that a source's standard deviation makes}, with LEFT_AFTER removed. total_nm: [4].

    zernike_covariance_nm2: [terms, terms] of all sources together. deviation_mm: [n] standard deviation of the height
    at each pixel. first, total: {name: Sobol index of the mean square}; both with piston and tilt removed.
    """

    nm: dict[str, FloatArray]
    total_nm: FloatArray
    zernike_covariance_nm2: FloatArray = field(repr=False)
    deviation_mm: FloatArray = field(repr=False)
    first: dict[str, float]
    total: dict[str, float]


def linear_budget(
    design: MeasuredDesign, found: Mapping[str, Sensitivity], given: Mapping[str, Distribution]
) -> LinearBudget:
    """found, given: of the same names."""
    nm = {name: found[name].left_nm * distribution.sigma for name, distribution in given.items()}
    total = np.sqrt(sum((values**2 for values in nm.values()), start=np.zeros(len(LEFT_AFTER))))
    variance, covariance = np.zeros(design.count), np.zeros((0, 0))

    def without(name: str) -> FloatArray:
        """Maps [1 or draws, n] of a source's standard deviation."""
        height = np.atleast_2d(found[name].height_mm) * given[name].sigma
        return design.response.without(height, LEFT_AFTER[0])

    for name, distribution in given.items():
        variance = variance + np.mean(without(name) ** 2, axis=0)
        terms = _terms(design, found[name], distribution)
        covariance = terms if not covariance.size else covariance + terms
    first, of_all = _sobol(without, given, found)
    return LinearBudget(nm, total, covariance, np.sqrt(variance), first, of_all)


def _terms(design: MeasuredDesign, one: Sensitivity, distribution: Distribution) -> FloatArray:
    """Covariance [terms, terms] in nm^2 of the Zernike terms by a source."""
    terms = np.atleast_2d(zernike_coefficients(design, one.height_mm)) * NM * distribution.sigma
    covariance: FloatArray = terms.T @ terms / len(terms)
    return covariance


def _sobol(
    maps: Callable[[str], FloatArray], given: Mapping[str, Distribution], found: Mapping[str, Sensitivity]
) -> tuple[dict[str, float], dict[str, float]]:
    """First and total indices of the mean square. maps: name -> [1 or draws, n], of one standard deviation.

    A process's mean square hardly varies: it counts with the variance over its draws.
    """
    parameters = [name for name in given if not found[name].source.is_process]
    processes = [name for name in given if found[name].source.is_process]
    own = np.concatenate([maps(name) for name in parameters]) if parameters else np.zeros((0, 1))
    gram = own @ own.T / own.shape[1]
    alone = {name: float(gram[k, k] ** 2 * EXCESS[given[name].kind]) for k, name in enumerate(parameters)}
    mixed = dict.fromkeys(given, 0.0)
    pairs = 0.0
    for k, name in enumerate(parameters):
        others = 4 * gram[k] ** 2
        mixed[name] += float(others.sum() - others[k])
        pairs += float(others[k + 1 :].sum())
    for process in processes:
        draws = maps(process)  # one process at a time: these are many
        alone[process] = float(np.var(np.mean(draws**2, axis=1), ddof=1))
        cross = 4 * np.mean((draws @ own.T / draws.shape[1]) ** 2, axis=0) if parameters else np.zeros(0)
        for name, value in zip(parameters, cross.tolist(), strict=True):
            mixed[name] += value
            mixed[process] += value
            pairs += value
    whole = sum(alone.values()) + pairs
    if not whole > 0:
        return dict.fromkeys(given, 0.0), dict.fromkeys(given, 0.0)
    return {name: alone[name] / whole for name in given}, {name: (alone[name] + mixed[name]) / whole for name in given}
