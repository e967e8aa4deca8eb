"""From what a test may cost back to what its parts may be off: tolerances, and which calibrations to buy first.

All to first order: the mean square error of a trial is a quadratic form of the sources' values. Its quantile is taken
over the points of one Sobol sequence, the same for every question, so that answers differ only by what was changed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import brentq

from irtscots_cl.budget.distributions import drawn, even_shares
from irtscots_cl.budget.joint import NONE, Joint
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.sensitivity import NM, Sensitivity
from irtscots_cl.budget.source import Kind
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.error_sources import Distribution

POINTS = 2**13  # of the sequence: the 95 % quantile is known to about 1 %
COVERAGE = 0.95
SMALLEST_CAP = 1e-6  # of what is allowed: fewer sources than a million cost less together
WIDEST = 1e6  # times its size: a source that may be off by more does nothing


@dataclass(frozen=True)
class QuadraticError:
    """Quantiles of the rms height error in nm for any sizes of the sources.

    given: the sources' distributions. remove: terms taken out of the height, one of LEFT_AFTER. joint: those that vary
    together.
    """

    design: MeasuredDesign = field(repr=False)
    found: Mapping[str, Sensitivity] = field(repr=False)
    given: Mapping[str, Distribution]
    remove: str = LEFT_AFTER[0]
    joint: Joint = NONE

    @cached_property
    def _parameters(self) -> tuple[str, ...]:
        """Those with one value in a test; constants come last."""
        kinds = {name: self.found[name].source.kind for name in sorted(self.given)}
        random = [name for name, kind in kinds.items() if kind is Kind.PARAMETER]
        return *random, *(name for name, kind in kinds.items() if kind is Kind.CONSTANT)

    @cached_property
    def _maps(self) -> FloatArray:
        """Maps [p, n] in nm of the parameters' sizes, without the terms."""
        maps = [self.found[name].height_mm * self.given[name].size for name in self._parameters]
        return self.design.response.without(np.reshape(maps, (-1, self.design.count)), self.remove) * NM

    @cached_property
    def _gram(self) -> FloatArray:
        """Mean products [p, p] of the parameters' maps, nm^2."""
        gram: FloatArray = self._maps @ self._maps.T / self.design.count
        return gram

    @cached_property
    def _points(self) -> FloatArray:
        """Values [points, p] of the parameters over their sizes."""
        found = np.ones((POINTS, len(self._parameters)))
        names = [name for name in self._parameters if self.found[name].source.kind is Kind.PARAMETER]
        if names:
            values = drawn(self.given, self.joint, names, even_shares(len(names), POINTS, 0))
            found[:, : len(names)] = np.stack([values[name] / self.given[name].size for name in names], -1)
        return found

    @cached_property
    def _processes(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Of each process, for one of its draws at each point: mean square [points], and twice the mean products with
        the parameters' maps [points, p], nm^2."""
        random, found = np.random.default_rng(0), {}
        for name, given in sorted(self.given.items()):
            if self.found[name].source.kind.is_random:
                draws = self.design.response.without(self.found[name].height_mm * given.size, self.remove) * NM
                chosen = random.permutation(np.arange(POINTS) % len(draws))
                square, product = np.mean(draws**2, axis=1), 2 * draws @ self._maps.T / self.design.count
                found[name] = square[chosen], product[chosen]
        return found

    @cached_property
    def alone_nm(self) -> dict[str, float]:
        """Rms height error in nm that each source's standard deviation makes alone, without the terms."""
        level = LEFT_AFTER.index(self.remove)
        return {name: float(self.found[name].left_nm[level]) * given.sigma for name, given in self.given.items()}

    def capped(self, cap_nm: float) -> dict[str, float]:
        """Factors on the sources' sizes with which none costs more than a cap alone; those that cost less stay."""
        return {name: min(1.0, cap_nm / nm) if nm > 0 else 1.0 for name, nm in self.alone_nm.items()}

    def nm(self, factors: Mapping[str, float] | None = None, coverage: float = COVERAGE) -> float:
        """The quantile with each source's size multiplied by a factor, 1 where none is given."""
        by = factors or {}
        scale = np.array([by.get(name, 1.0) for name in self._parameters])
        points = self._points * scale
        squares = np.einsum("si,ij,sj->s", points, self._gram, points, optimize=True)
        for name, (square, product) in self._processes.items():
            factor = by.get(name, 1.0)
            squares = squares + factor**2 * square + factor * np.sum(product * points, axis=-1)
        return float(np.sqrt(np.quantile(np.maximum(squares, 0.0), coverage)))


@dataclass(frozen=True)
class Tolerance:
    """largest: size that one source may have, all others as given; 0 where these alone cost too much; inf for a source
    that does nothing. together: size of each with which all of them meet it: none costs more than the cap."""

    name: str
    given: float
    largest: float
    together: float


@dataclass(frozen=True)
class Calibration:
    """One step of a plan: the source that is calibrated away, its cost or None, and the quantile in nm after it."""

    name: str
    cost: float | None
    after_nm: float


@dataclass(frozen=True)
class Tolerances:
    """allow_nm: what the test may cost, at a coverage. now_nm: what it costs. common_factor: by which all sizes would
    have to be multiplied together. cap_nm: the most that one source may cost, so that all together meet it; inf where
    they do as given. each: source. plan: calibrations that reach it, the best value first, or all if even
    they do not."""

    allow_nm: float
    coverage: float
    now_nm: float
    common_factor: float
    cap_nm: float
    each: tuple[Tolerance, ...]
    plan: tuple[Calibration, ...]


def tolerances(error: QuadraticError, allow_nm: float, coverage: float = COVERAGE) -> Tolerances:
    """What the sources may be so that the rms height error stays within allow_nm with that coverage."""
    now = error.nm(coverage=coverage)
    cap = _cap(error, allow_nm, coverage) if now > allow_nm else math.inf
    capped = error.capped(cap)
    each = tuple(
        Tolerance(name, given.size, given.size * _largest(error, name, allow_nm, coverage), given.size * capped[name])
        for name, given in sorted(error.given.items())
    )
    common = allow_nm / now if now > 0 else math.inf  # the error is in proportion to all sizes together
    return Tolerances(allow_nm, coverage, now, common, cap, each, _plan(error, allow_nm, coverage))


def _cap(error: QuadraticError, allow_nm: float, coverage: float) -> float:
    """The most that one source may cost so that the quantile is what is allowed, where it is more as given."""

    def excess(log_cap: float) -> float:
        return error.nm(error.capped(math.exp(log_cap)), coverage) - allow_nm

    most = max(error.alone_nm.values())
    return math.exp(brentq(excess, math.log(SMALLEST_CAP * allow_nm), math.log(most), xtol=1e-9))


def _largest(error: QuadraticError, name: str, allow_nm: float, coverage: float) -> float:
    """The factor on a source's size at which the quantile is what is allowed."""

    def excess(factor: float) -> float:
        return error.nm({name: factor}, coverage) - allow_nm

    if excess(0.0) > 0:
        return 0.0
    if excess(WIDEST) < 0:
        return math.inf
    return float(brentq(excess, 0.0, WIDEST, xtol=1e-9, rtol=1e-6))


def _plan(error: QuadraticError, allow_nm: float, coverage: float) -> tuple[Calibration, ...]:
    """Sources calibrated away one after the other: by the fall of the mean square for each unit of cost.

    Where no source has a cost all cost the same; where some have, the others cannot be calibrated.
    """
    with_cost = any(given.cost is not None for given in error.given.values())
    open_names = [name for name, given in error.given.items() if given.cost is not None or not with_cost]
    done: dict[str, float] = {}
    found: list[Calibration] = []
    now = error.nm(coverage=coverage)
    while now > allow_nm and open_names:
        after = {name: error.nm(done | {name: 0.0}, coverage) for name in open_names}

        def worth(name: str, before: float = now, left: Mapping[str, float] = after) -> float:
            return (before**2 - left[name] ** 2) / max(
                error.given[name].cost or (1.0 if not with_cost else 0.0), 1e-300
            )

        best = max(open_names, key=worth)
        if after[best] >= now:
            break
        now = after[best]
        found.append(Calibration(best, error.given[best].cost, now))
        done[best] = 0.0
        open_names.remove(best)
    return tuple(found)
