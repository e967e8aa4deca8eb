"""Bundle adjustment: the unknowns of a set-up that explain the places which its pixels see, with their covariance.

Gauss-Newton on places (u, v) over their errors, with priors and measured distances as further rows. Until it has
converged, pixels count less the farther they lie from the model (Huber's weights); then those beyond REJECTED are left
out and the rest count in full, so that the covariance is that of plain least squares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl.calibration.known import KnownDistance, Prior
from irtscots_cl.calibration.measured import Measurement, Shares, all_names, base_name, shares_of
from irtscots_cl.calibration.parameters import moved, parameter
from irtscots_cl.calibration.triangular import Triangle
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system import interruption

ROUNDS = 40
NEAR = 1.0  # standard errors: a smaller step of all unknowns ends the rounds with robust weights,
CONVERGED = 1e-3  # and those without
SAME_NOISE = 1e-2
HALVINGS = 8  # of a step that makes the fit worse
HUBER = 0.3  # noise levels: beyond them a pixel counts less. So few that a minority, however far off, moves little
REJECTED = math.sqrt(-2 * math.log(1e-6))  # noise levels: farther away is one good pixel of a million
MEDIAN = math.sqrt(2 * math.log(2))  # of the distance of two independent normal numbers from zero
REJECT_ROUNDS = 15
MOST_REJECTED = 0.5  # of the pixels: data and model have nothing to do with each other
NO_NEWS = 1e-3  # of an unknown's usual size: a singular value below it says nothing
CLEAR = 5.0  # standard deviations of a chi-square from noise alone: then errors are scaled up to the residuals
STEP = 1e-3  # of an unknown's usual size, for derivatives of distances


@dataclass(frozen=True)
class Problem:
    """names: the unknowns, shared and a measurement's own. sigmas: of their priors, NaN without one. scales: usual
    sizes. distances: measured ones; shares: of each measurement."""

    measurements: tuple[Measurement, ...]
    names: tuple[str, ...]
    sigmas: FloatArray
    scales: FloatArray
    distances: tuple[KnownDistance, ...] = ()
    shares: tuple[Shares, ...] = ()

    @classmethod
    def of(
        cls,
        measurements: Sequence[Measurement],
        unknowns: Sequence[str],
        priors: Mapping[str, Prior],
        distances: Sequence[KnownDistance] = (),
    ) -> Problem:
        """unknowns: the shared ones. priors: of their names, also for a measurement's own of that name.

        Raises ValueError for unknown names, or where fewer places than unknowns are left.
        """
        names, scene = all_names(unknowns, measurements), measurements[0].scene
        count = 2 * sum(len(m.pixels) for m in measurements)
        if count < 2 * len(names):
            raise ValueError(
                f"{', '.join(m.name for m in measurements)}: {count // 2} pixels for {len(names)} unknowns; must be at "
                f"least {len(names)}: fit fewer unknowns"
            )
        scales = np.array([parameter(base_name(name), scene).scale for name in names])
        sigmas = np.array([priors[base_name(name)].sigma for name in names])
        shares = tuple(shares_of(m, names) for m in measurements)
        return cls(tuple(measurements), names, sigmas, scales, tuple(distances), shares)

    def with_unknowns(self, further: Sequence[str]) -> Problem:
        """With further unknowns, of which nothing is known."""
        names, scene = (*self.names, *further), self.measurements[0].scene
        scales = [parameter(base_name(name), scene).scale for name in further]
        return replace(
            self,
            names=names,
            sigmas=np.append(self.sigmas, np.full(len(further), np.nan)),
            scales=np.append(self.scales, scales),
            shares=tuple(shares_of(m, names) for m in self.measurements),
        )

    def prior_rows(self, values: FloatArray) -> FloatArray:
        """Rows [known, unknowns + 1] of the priors and distances, for steps in units of the scales."""
        known = np.flatnonzero(np.isfinite(self.sigmas))
        rows = np.zeros((len(known) + len(self.distances), len(self.names) + 1))
        rows[np.arange(len(known)), known] = (self.scales / self.sigmas)[known]
        rows[: len(known), -1] = -(values / self.sigmas)[known]
        for row, distance in zip(rows[len(known) :], self.distances, strict=True):
            here = distance.of(self.moved_first(values))
            for k, scale in enumerate(self.scales):
                step = np.zeros(len(values))
                step[k] = STEP * scale
                ahead, behind = (distance.of(self.moved_first(values + sign * step)) for sign in (1, -1))
                row[k] = (ahead - behind) / (2 * STEP) / distance.sigma
            row[-1] = (distance.mm - here) / distance.sigma
        return rows

    def moved_first(self, values: FloatArray) -> Scene:
        """The scene of the first measurement with changed unknowns."""
        return moved(self.measurements[0].scene, self.shares[0].changes(values))

    def left(self, values: FloatArray) -> list[FloatArray]:
        """Measured less predicted places over their errors, [2, n] of each measurement; NaN without a prediction."""
        return [
            (m.places_mm - m.predicted(share.changes(values))) / m.errors_mm
            for m, share in zip(self.measurements, self.shares, strict=True)
        ]

    def triangle(self, values: FloatArray, left: list[FloatArray], weights: list[FloatArray]) -> Triangle:
        """All pixels' rows at some values, of steps in units of the scales. weights: [n] of the squares."""
        found = Triangle.empty(len(self.names))
        for m, share, residual, weight in zip(self.measurements, self.shares, left, weights, strict=True):
            for part in m.parts():
                interruption.check()
                rows = m.jacobian(share.changes(values), share.names, part) @ (share.matrix * self.scales)
                rows = np.concatenate([rows / m.errors_mm[:, part, None], residual[:, part, None]], axis=-1)
                rows = rows * np.sqrt(weight[part])[:, None]
                found = found.with_rows(rows[:, weight[part] > 0].reshape(-1, len(self.names) + 1))
        return found


@dataclass(frozen=True)
class Adjustment:
    """The fitted unknowns, as changes from the scene.

    values, covariance: of problem.names, in their units; the covariance holds errors scaled up by `noise`. used: [n] of
    each measurement, the pixels that count; left: [2, n], their residuals over the stated errors. noise: factor on the
    stated errors that the residuals ask for, 1 if they are as expected. data: triangle of the pixels' rows over
    noise-scaled errors; rounds: that it took.
    """

    problem: Problem
    values: FloatArray
    covariance: FloatArray = field(repr=False)
    used: tuple[BoolArray, ...] = field(repr=False)
    left: tuple[FloatArray, ...] = field(repr=False)
    noise: float
    data: Triangle = field(repr=False)
    rounds: int
    converged: bool

    @property
    def names(self) -> tuple[str, ...]:
        return self.problem.names

    @property
    def errors(self) -> FloatArray:
        """Standard deviations of the values."""
        found: FloatArray = np.sqrt(np.diag(self.covariance))
        return found

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals of the pixels that count, over the stated errors."""
        return sum(float(np.sum(left[:, used] ** 2)) for left, used in zip(self.left, self.used, strict=True))

    @property
    def residuals(self) -> int:
        """Number of residuals that count."""
        return 2 * sum(int(used.sum()) for used in self.used)

    @property
    def from_data(self) -> float:
        """Number of unknowns that the pixels determine: the trace of their share in all that is known."""
        inside = self.data.matrix / self.problem.scales
        return float(np.sum(inside * (inside @ self.covariance)))

    @property
    def degrees(self) -> float:
        """Degrees of freedom of chi_square."""
        return max(self.residuals - self.from_data, 1.0)

    @property
    def rejected(self) -> int:
        """Number of pixels that do not count because they lie too far from the model."""
        return sum(int(np.sum(~used)) for used in self.used)

    def changes(self, index: int = 0) -> dict[str, float]:
        """{name: fitted value} of a measurement's scene."""
        return self.problem.shares[index].changes(self.values)


def adjust(problem: Problem) -> Adjustment:
    """Fit the unknowns of a problem. Raises ValueError where nothing determines an unknown, or the data contradict."""
    values = np.zeros(len(problem.names))
    left = problem.left(values)
    _check_seen(problem, left)
    rounds, step = 0, math.inf
    while rounds < ROUNDS and step > NEAR:
        weights = _Weights(left)
        data = problem.triangle(values, left, weights.huber(left))
        values, left, step = _stepped(problem, data, values, left, weights.noise, rounds == 0)
        rounds += 1
    near = step <= NEAR
    noise, used = 1.0, _Weights(left).used(left)
    for _ in range(REJECT_ROUNDS):
        _check_kept(problem, used)
        data = problem.triangle(values, left, [kept / noise**2 for kept in used])
        values, left, step = _stepped(problem, data, values, left)
        rounds += 1
        inside = data.without_right_side().with_rows(problem.prior_rows(values)).covariance()
        covariance = inside * np.outer(problem.scales, problem.scales)
        found = Adjustment(problem, values, covariance, tuple(used), tuple(left), noise, data, rounds, near)
        noise, last_noise = _noise_of(found), noise
        used, last_used = _Weights(left).used(left), used
        same = all(np.array_equal(a, b) for a, b in zip(used, last_used, strict=True))
        if step < CONVERGED and same and abs(noise / last_noise - 1) < SAME_NOISE:
            return found
    return replace(found, converged=False)


def _noise_of(found: Adjustment) -> float:
    """Factor on the stated errors that the residuals ask for."""
    ratio = found.chi_square / found.degrees
    return math.sqrt(ratio) if ratio > 1 + CLEAR * math.sqrt(2 / found.degrees) else 1.0


def _stepped(
    problem: Problem,
    data: Triangle,
    values: FloatArray,
    left: list[FloatArray],
    huber_noise: float | None = None,
    first: bool = False,
) -> tuple[FloatArray, list[FloatArray], float]:
    """The values after one step, their residuals, and the step in standard errors, its largest.

    huber_noise: noise level of robust weights, or None with plain ones. The step is halved while it makes things worse.
    """
    known = data.with_rows(problem.prior_rows(values))
    if first:
        _check_determined(problem, known)
    step = known.solution()
    size = float(np.max(np.abs(step) / np.sqrt(np.diag(known.covariance()))))
    if huber_noise is None:
        new = values + problem.scales * step
        try:
            return new, problem.left(new), size
        except SceneError as error:
            names = ", ".join(m.name for m in problem.measurements)
            raise ValueError(
                f"{names}: the places contradict the scene: they lead to one that cannot be ({error})"
            ) from None
    worst = _cost(problem, values, left, huber_noise)
    for _ in range(HALVINGS):
        new = values + problem.scales * step
        try:
            after = problem.left(new)
        except SceneError:  # a scene that cannot be: the step was too long
            step = step / 4
            continue
        if _cost(problem, new, after, huber_noise) <= worst:
            return new, after, size
        step = step / 2
    return values, left, 0.0  # no shorter step helps: this is as good as it gets


def _cost(problem: Problem, values: FloatArray, left: list[FloatArray], noise: float) -> float:
    """Huber's sum over the pixels, in squares, and that of what is known; rays that are lost count as far away."""
    total = float(np.sum(problem.prior_rows(values)[:, -1] ** 2))
    for residual in left:
        d = np.nan_to_num(np.hypot(*residual), nan=1e6 * noise)
        limit = HUBER * noise
        total += float(np.sum(np.where(d <= limit, d**2, 2 * limit * d - limit**2)))
    return total


class _Weights:
    """Weights of pixels by their residuals; noise: level of the residuals, 1 if they are as stated or smaller."""

    def __init__(self, left: list[FloatArray]):
        distances = np.concatenate([np.hypot(*residual) for residual in left])
        self.noise = max(float(np.nanmedian(distances)) / MEDIAN, 1.0)

    def huber(self, left: list[FloatArray]) -> list[FloatArray]:
        with np.errstate(divide="ignore", invalid="ignore"):
            return [np.nan_to_num(np.minimum(1.0, HUBER * self.noise / np.hypot(*r)), nan=0.0) for r in left]

    def used(self, left: list[FloatArray]) -> list[BoolArray]:
        return [np.nan_to_num(np.hypot(*r), nan=np.inf) < REJECTED * self.noise for r in left]


def _check_seen(problem: Problem, left: list[FloatArray]) -> None:
    for m, residual in zip(problem.measurements, left, strict=True):
        lost = float(np.mean(np.isnan(residual).any(0))) if residual.size else 1.0
        if lost > MOST_REJECTED:
            raise ValueError(f"{m.name}: {lost:.0%} of the pixels' chief rays miss the mirror or screen of the scene")


def _check_kept(problem: Problem, used: list[BoolArray]) -> None:
    for m, kept in zip(problem.measurements, used, strict=True):
        if np.mean(~kept) > MOST_REJECTED:
            raise ValueError(
                f"{m.name}: {np.mean(~kept):.0%} of the pixels contradict what the others and the scene say; are its "
                "images, its turn and its moves those of this measurement?"
            )


def _check_determined(problem: Problem, known: Triangle) -> None:
    """Raise ValueError if neither the pixels nor a prior determine some combination of the unknowns."""
    values, vectors = known.directions()
    if values[0] > NO_NEWS:
        return
    parts = np.abs(vectors[0])
    names = [problem.names[k] for k in np.argsort(-parts) if parts[k] > 0.3 * parts.max()]
    which = names[0] if len(names) == 1 else f"{', '.join(names[:4])} together"
    free = next((name for name in names if np.isnan(problem.sigmas[problem.names.index(name)])), names[0])
    usual = problem.scales[problem.names.index(free)]
    raise ValueError(
        f'unknown {free}: no image and no prior determines {which}; give [calibration.known] "{base_name(free)}" = '
        f"{usual:.3g} or what is known of it, or hold it"
    )
