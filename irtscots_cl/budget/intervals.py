"""Intervals that hold the truth: what a measured height map says of the mirror, with the budget's errors.

The errors are sums of the sources' maps times values drawn from their distributions, to first order; a process is the
sum of its draws' maps times independent normal numbers. What constants do is known, and is taken out of a measured map
first. What is left is m = t + e, of the true heights t and an error e of that kind. Of a linear figure, such as a
Zernike term, the interval is the figure less the error's quantiles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import ndtri

from irtscots_cl.budget.distributions import even_shares, quantile
from irtscots_cl.budget.joint import NONE, Joint
from irtscots_cl.budget.linear import sum_of_constants
from irtscots_cl.budget.measured_design import NOLLS, MeasuredDesign
from irtscots_cl.budget.sensitivity import NM, Sensitivity
from irtscots_cl.budget.source import Kind
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.scene.error_sources import Distribution

SAMPLES = 2**13
COVERAGE = 0.95
SMALLEST = 1e-9  # of the largest mode of the error
DISK = 65  # points across, on which peak to valley is taken: to 1e-3
PV_SAMPLES = 2**10


@dataclass(frozen=True)
class Interval:
    """In nm. It holds the true value with the stated coverage. estimate: of it, without what constants do."""

    estimate: float
    low: float
    high: float


@dataclass(frozen=True)
class ErrorSamples:
    """The errors of a budget on some of a design's pixels. used: [n] of them. joint: sources that vary together."""

    design: MeasuredDesign = field(repr=False)
    found: Mapping[str, Sensitivity] = field(repr=False)
    given: Mapping[str, Distribution]
    used: BoolArray = field(repr=False)
    joint: Joint = NONE
    _made: dict[tuple[int, ...], tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=dict, repr=False)

    @cached_property
    def _parts(self) -> tuple[FloatArray, FloatArray]:
        """Maps [parts, used] in mm and their values [samples, parts]."""
        maps: list[FloatArray] = []
        columns: list[tuple[Distribution | None, bool, range]] = []
        dimensions = 0
        for name, given in sorted(self.given.items()):
            if name in self.joint.names or self.found[name].source.kind is Kind.CONSTANT:
                continue
            height = np.atleast_2d(self.found[name].height_mm)[:, self.used] * given.size
            process = self.found[name].source.kind.is_random
            maps.append(height / math.sqrt(len(height)) if process else height)
            columns.append((given, process, range(dimensions, dimensions + len(height))))
            dimensions += len(height)
        if self.joint.names:
            together = np.stack([self.found[name].height_mm[self.used] for name in self.joint.names])
            maps.append(self.joint.independent(together))
            columns.append((None, True, range(dimensions, dimensions + len(together))))
            dimensions += len(together)
        if not dimensions:
            return np.zeros((0, int(self.used.sum()))), np.zeros((1, 0))
        shares = even_shares(dimensions, SAMPLES, 0)
        values = np.empty_like(shares)
        for given, process, where in columns:
            part = shares[:, where]
            values[:, where] = ndtri(part) if process or given is None else quantile(given, part) / given.size
        return np.concatenate(maps), values

    @cached_property
    def _inverse(self) -> FloatArray:
        """[terms, used] from heights to NOLLS."""
        found: FloatArray = np.linalg.pinv(self.design.zernike_basis[self.used])
        return found

    @cached_property
    def _constant_mm(self) -> FloatArray:
        """Height [used] that the constants make, which is taken out of measured heights."""
        return sum_of_constants(self.found, self.given, self.design.count)[self.used]

    def zernikes(self, height_mm: FloatArray, coverage: float = COVERAGE) -> dict[int, Interval]:
        """Of each of NOLLS, fitted together, of heights [used]."""
        maps, values = self._parts
        inverse = self._inverse
        own = inverse @ (height_mm - self._constant_mm) * NM
        errors = values @ (maps @ inverse.T) * NM
        low, high = np.quantile(errors, ((1 - coverage) / 2, (1 + coverage) / 2), axis=0)
        return {
            noll: Interval(float(own[k]), float(own[k] - high[k]), float(own[k] - low[k]))
            for k, noll in enumerate(NOLLS)
        }

    def rms(self, height_mm: FloatArray, nolls: tuple[int, ...], coverage: float = COVERAGE) -> Interval:
        """Rms of heights [used] without some of NOLLS, which are fitted together.

        Of a drawn error e, the true heights t = m - e are taken for g m, with the g for which g m + e is as large as m
        in the modes of the error, each weighed by its variance: right for one mode, for many alike, and for noise.
        """
        modes, weight, errors = self._modes(nolls)
        own = height_mm - self._constant_mm
        own = own - self._fitted(own, nolls)
        inside = modes @ own
        size = float(weight @ inside**2)
        across, square = errors @ (weight * inside), (errors**2) @ weight
        shrink = np.ones(len(errors))
        if size > 0:
            root = np.sqrt(np.maximum(across**2 + size * (size - square), 0.0))
            shrink = np.maximum((root - across) / size, 0.0)
        left = own @ own - 2 * shrink * (errors @ inside) - np.sum(errors**2, -1)
        if not size > 0:  # heights that have nothing of the error: the true ones have all of it
            left = own @ own + np.sum(errors**2, -1)
        found = np.sqrt(np.maximum(left, 0.0) / len(own)) * NM
        low, middle, high = np.quantile(found, ((1 - coverage) / 2, 0.5, (1 + coverage) / 2))
        return Interval(float(middle), float(low), float(high))

    def _fitted(self, heights: FloatArray, nolls: tuple[int, ...]) -> FloatArray:
        """The part of heights [..., used] that some of NOLLS explain."""
        columns = [NOLLS.index(noll) for noll in nolls]
        basis = np.linalg.qr(self.design.zernike_basis[self.used][:, columns])[0]
        found: FloatArray = (heights @ basis) @ basis.T
        return found

    def _modes(self, nolls: tuple[int, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Orthonormal modes [modes, used] of the error without some terms, their variances over the largest, and the
        error's samples [samples, modes] in them, mm."""
        if nolls not in self._made:
            maps, values = self._parts
            left = maps - self._fitted(maps, nolls)
            if not len(left):
                self._made[nolls] = np.zeros((0, left.shape[1])), np.zeros(0), np.zeros((1, 0))
                return self._made[nolls]
            _, size, modes = np.linalg.svd(left * values.std(0)[:, None], full_matrices=False)
            use = size > SMALLEST * size[0]
            modes, size = modes[use], size[use]
            self._made[nolls] = modes, (size / size[0]) ** 2, values @ (left @ modes.T)
        return self._made[nolls]

    def peak_to_valley(self, height_mm: FloatArray, nolls: Sequence[int], coverage: float = COVERAGE) -> Interval:
        """Peak to valley over the whole disk of some of NOLLS, fitted with all of them to heights [used].

        A peak to valley only grows by errors. So the upper end, by the terms less drawn errors, is a safe one, and the
        lower is the figure less the peak to valley of the error: no sum has less than the difference of its parts'.
        """
        maps, values = self._parts
        inverse = self._inverse
        columns = [NOLLS.index(noll) for noll in nolls]
        own = (inverse @ (height_mm - self._constant_mm))[columns] * NM
        errors = (values[:PV_SAMPLES] @ (maps @ inverse.T))[:, columns] * NM
        disk = _disk(nolls)
        estimate, alone = float(np.ptp(disk @ own)), np.ptp(errors @ disk.T, axis=1)
        share = (1 + coverage) / 2
        low = max(estimate - float(np.quantile(alone, share)), 0.0)
        high = float(np.quantile(np.ptp((own - errors) @ disk.T, axis=1), share))
        return Interval(estimate, low, high)


def _disk(nolls: Sequence[int]) -> FloatArray:
    """Zernike terms [points, terms] on a disk."""
    x, y = np.meshgrid(*[np.linspace(-1, 1, DISK)] * 2)
    inside = x * x + y * y <= 1
    return np.stack([zernike(noll, x[inside], y[inside]) for noll in nolls], -1)
