"""Harmonics of fringes: what a screen's gamma makes of a sinusoid, how images show it, and what it does to phases.

A screen that emits value^gamma turns 1/2 + 1/2 cos t into a series of cosines. With N equal steps the harmonics kN + 1
and kN - 1 cannot be told from the first and move the phase, by sin(N phase) to first order; the harmonics kN are taken
for the offset. All others stay in the residual, where they can be seen: with four steps the second alone, which tells
gamma; the third and fifth, which move the phase, follow from gamma and not from the samples. With three steps nothing
can be seen, and the second harmonic moves the phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.periodic_table import PeriodicTable
from irtscots_cl.measurement.phase import SinusoidFit, fit_sinusoid, solved, used_samples

HIGHEST = 9  # harmonic that is counted: the next is below 1e-4 of the first for any screen's gamma
ROUNDS = 10  # of finding gamma at most
TABLE = 8192  # phases that the correction is tabulated at
GAMMAS = (0.05, 20.0)
RATIOS = (-0.3, 0.7)  # of the second harmonic over the first, that are looked for
MIN_COMPLETE = 200  # pixels
SAMPLE = 200  # of the pixels that lack samples, where the others are fewer
MAX_SHARE = 3.0  # of the last round's way in the next: beyond, the two have told nothing
REFITS = 60  # at most, of pixels that lack samples
SETTLED_RAD = 1e-8  # of a pixel's phase by a round, where its rounds end


@dataclass(frozen=True)
class SecondHarmonic:
    """Amplitude of the second harmonic over the first, with its standard error; NaN where the steps cannot show it.
    gamma: of the screen that makes this ratio, with its standard error."""

    ratio: float
    standard_error: float

    @property
    def gamma(self) -> float:
        return np.nan if np.isnan(self.ratio) else gamma_of(self.ratio)

    @property
    def is_seen(self) -> bool:
        """Whether it differs from zero by more than chance: five standard errors."""
        return abs(self.ratio) > 5 * self.standard_error


def gamma_harmonics(gamma: float) -> FloatArray:
    """Amplitudes [HIGHEST + 1] of the harmonics over the first, of (1/2 + 1/2 cos t)^gamma: entry k of harmonic k.

    ((1 + cos t) / 2)^g = cos(t / 2)^(2 g) has the harmonics k in the ratios of 1 / (G(g + 1 + k) G(g + 1 - k)), G the
    gamma function, so that each follows from the one before it by the factor (g - k + 1) / (g + k).
    """
    ratio = np.zeros(HIGHEST + 1)
    ratio[1] = 1.0
    for k in range(2, HIGHEST + 1):
        ratio[k] = ratio[k - 1] * (gamma - k + 1) / (gamma + k)
    ratio[0] = (gamma + 1) / (2 * gamma)  # the mean: the cosine's coefficient halved
    return ratio


def response_harmonics(shown: FloatArray, light: FloatArray) -> FloatArray:
    """As gamma_harmonics, for a screen that emits light [n] at the shown values [n], growing, over their full range."""
    t = (np.arange(4096) + 0.5) * np.pi / 4096
    values = np.interp((1 + np.cos(t)) / 2, (shown - shown[0]) / (shown[-1] - shown[0]), light)
    terms = np.array([2 * np.mean(values * np.cos(k * t)) for k in range(HIGHEST + 1)])
    terms[0] /= 2
    ratios: FloatArray = terms / terms[1]
    return ratios


def second_harmonic(samples: NDArray[Any], fit: SinusoidFit) -> SecondHarmonic:
    """The second harmonic in the residuals of complete fits, from samples [N, n], n of many different phases.

    The higher harmonics are taken from the same gamma: with four steps they move the phases and amplitudes that the
    second is compared with.
    """
    steps = fit.steps_rad
    whole = np.isfinite(fit.square) & (fit.samples == len(steps))
    if np.count_nonzero(whole) < MIN_COMPLETE:
        return _of_incomplete(samples, fit)
    basis = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)
    rest = np.eye(len(steps)) - basis @ np.linalg.pinv(basis)  # what a fit leaves of samples
    left = rest @ np.asarray(samples[:, whole], float)
    found = SecondHarmonic(0.0, np.nan)
    for _ in range(ROUNDS):
        ratios = gamma_harmonics(gamma_of(found.ratio))
        phase = correct_phase(fit.phase_rad[whole], steps, ratios)
        amplitude = fit.amplitude[whole] / first_harmonic_gain(phase, steps, ratios)
        seen = rest @ np.cos(2 * (phase - steps[:, None])) * amplitude
        total = float(np.square(seen).sum())
        if not total > 1e-6 * float(np.square(amplitude).sum()) * len(steps):
            return SecondHarmonic(np.nan, np.nan)
        others = left - rest @ (amplitude * _higher(phase, steps, ratios))
        ratio = float((seen * others).sum() / total)
        # scatter of the pixels' own contributions
        error = float(np.sqrt(np.square((seen * (others - ratio * seen)).sum(0)).sum()) / total)
        moved, found = abs(ratio - found.ratio), SecondHarmonic(ratio, error)
        if moved < 0.01 * error:
            break
    return found


def _of_incomplete(samples: NDArray[Any], fit: SinusoidFit) -> SecondHarmonic:
    """The second harmonic where samples are missing in nearly all pixels: the one that leaves the least residuals."""
    useful = fit.incomplete[(fit.freedom[fit.incomplete] >= 2) & np.isfinite(fit.square[fit.incomplete])]
    some = useful[:: max(1, len(useful) // SAMPLE)]
    if len(some) < SAMPLE // 2:
        return SecondHarmonic(np.nan, np.nan)
    values = np.array(samples[:, some], float)
    own = fit_sinusoid(values, fit.steps_rad, fit.saturation)

    def left(ratio: float) -> float:
        return float(np.nansum(without_harmonics(values, own, gamma_harmonics(gamma_of(ratio))).square))

    best = minimize_scalar(left, bounds=RATIOS, method="bounded", options={"xatol": 1e-4})
    step = 0.01
    curvature = (left(best.x + step) - 2 * best.fun + left(best.x - step)) / step**2
    variance = best.fun / max(int(own.freedom.sum()) - 1, 1)
    return SecondHarmonic(float(best.x), float(np.sqrt(2 * variance / curvature)) if curvature > 0 else np.nan)


def without_harmonics(samples: NDArray[Any], fit: SinusoidFit, ratios: FloatArray) -> SinusoidFit:
    """The fits with these harmonics taken out of the samples [N, n] of pixels that lack some.

    With some samples gone all harmonics move the phase, each pixel's in its own way: fits and harmonics in turn.
    Complete pixels stay as they are: correct_phase does the same for them at once.
    """
    if not fit.incomplete.size:
        return fit
    where, steps = fit.incomplete, fit.steps_rad
    basis = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)
    used = used_samples(samples[:, where], fit)
    values = np.where(used, samples[:, where], 0.0)
    found = np.stack([fit.offset[where], fit.cosine[where], fit.sine[where]])
    # Pixels leave the rounds as they settle, so that no pixel's result depends on the others. Each round goes on in the
    # direction of the last two (Anderson, J. ACM 12, 547 (1965)).
    going, inverse, some, their = np.arange(len(where)), fit.inverse, values, used
    start, last, gap = found.copy(), found, np.zeros_like(found)
    for k in range(REFITS):
        clean = np.where(their, some - _higher_of(start, steps, ratios), 0.0)
        after = solved(inverse, basis.T @ clean)
        found[:, going] = after
        moved = after - start
        turned = np.abs(np.angle((after[1] + 1j * after[2]) * (start[1] - 1j * start[2])))
        still = turned > SETTLED_RAD
        if not still.any():
            break
        change = (moved - gap)[1:]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (change * moved[1:]).sum(0) / np.square(change).sum(0)
        share = np.where(np.abs(share) < MAX_SHARE, share, 0.0) if k else np.zeros(len(going))
        start, last, gap = (after - share * (after - last))[:, still], after[:, still], moved[:, still]
        going, inverse, some, their = going[still], inverse[still], some[:, still], their[:, still]
    left = values - _higher_of(found, steps, ratios) - basis @ found
    square = np.square(np.where(used, left, 0.0)).sum(0)
    parts = {}
    for name, own in zip(("offset", "cosine", "sine", "square"), (*found, square), strict=True):
        parts[name] = getattr(fit, name).copy()
        parts[name][where] = own
    return replace(fit, **parts)


def residual_square(samples: NDArray[Any], fit: SinusoidFit, ratios: FloatArray) -> FloatArray:
    """Sums [n] of squared residuals without what these harmonics put there; of complete fits, NaN of the others.

    The harmonics stand where the noisy phase and amplitude say: what that adds is divided out, so that the mean over
    fit.freedom is the samples' variance.
    """
    steps = fit.steps_rad
    basis = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)
    rest = np.eye(len(steps)) - basis @ np.linalg.pinv(basis)
    phase = correct_phase(fit.phase_rad, steps, ratios)
    amplitude = fit.amplitude / first_harmonic_gain(phase, steps, ratios)
    model = rest @ _higher(phase, steps, ratios, 2)
    turned = rest @ (
        2 * ratios[2] * np.sin(2 * (phase - steps[:, None]))
    )  # its change with the phase; that of the others is small
    square = np.square(rest @ np.asarray(samples, float) - amplitude * model).sum(0)
    added = 2 / len(steps) * (np.square(model) + np.square(turned)).sum(0)
    return np.where(fit.samples == len(steps), square * fit.freedom / (fit.freedom + added), np.nan)


def harmonics_of(fit: SinusoidFit, ratios: FloatArray) -> FloatArray:
    """What the harmonics from the second on add to the samples [N, n] of fits, of those of without_harmonics."""
    steps = fit.steps_rad
    whole = fit.samples == len(steps)
    phase = np.where(whole, correct_phase(fit.phase_rad, steps, ratios), fit.phase_rad)
    amplitude = fit.amplitude / np.where(whole, first_harmonic_gain(phase, steps, ratios), 1.0)
    total: FloatArray = amplitude * _higher(phase, steps, ratios, 2)
    return total


def _higher_of(found: FloatArray, steps_rad: FloatArray, ratios: FloatArray) -> FloatArray:
    """The harmonics from the second on [N, k] of fits [3, k]: offset, cosine, sine."""
    amplitude: FloatArray = np.hypot(found[1], found[2])
    return amplitude * _higher(np.arctan2(found[2], found[1]), steps_rad, ratios, 2)


def _higher(phase_rad: FloatArray, steps_rad: FloatArray, ratios: FloatArray, lowest: int = 3) -> FloatArray:
    """The harmonics from the lowest on, over the first: samples [N, n]. By Clenshaw's recurrence in the first."""
    terms = np.where(np.abs(ratios) > 1e-5, ratios, 0.0)
    terms[:lowest] = 0.0
    steps = np.asarray(steps_rad)[:, None]
    first: FloatArray = np.cos(steps) * np.cos(phase_rad) + np.sin(steps) * np.sin(phase_rad)
    total, before, spare = (np.zeros_like(first) for _ in range(3))
    for term in terms[int(np.max(np.flatnonzero(terms), initial=0)) : 0 : -1]:  # from the highest to the first
        np.multiply(first, total, out=spare)
        spare *= 2
        spare += term
        spare -= before
        total, before, spare = spare, total, before
    first *= total
    first -= before
    return first


def gamma_of(ratio: float) -> float:
    """Gamma of a screen whose second harmonic over the first has this ratio."""
    low, high = ((g - 1) / (g + 2) for g in GAMMAS)
    target = float(np.clip(ratio, low, high))
    return float(brentq(lambda g: (g - 1) / (g + 2) - target, *GAMMAS))


def blurred(ratios: FloatArray, fall: float, periods: float) -> FloatArray:
    """Harmonics [k] after a blur that leaves exp(-fall p^2) of a sinusoid of p periods."""
    k = np.arange(len(ratios))
    left: FloatArray = ratios * np.exp(-fall * periods**2 * np.maximum(k**2 - 1.0, 0.0))
    return left


def phase_bias(phase_rad: FloatArray, steps_rad: FloatArray, ratios: FloatArray) -> FloatArray:
    """What harmonics add to the phase [n] that a fit of one sinusoid finds, for the true phase [n]; exact."""
    turned: FloatArray = np.angle(_found(phase_rad, steps_rad, ratios) * _unit(phase_rad).conj())
    return turned


def bias_size(steps_rad: FloatArray, ratios: FloatArray) -> float:
    """Largest of what harmonics add to a phase: 0.0106 rad for gamma 2.2 and four equal steps."""
    return float(np.abs(phase_bias(np.linspace(-np.pi, np.pi, TABLE), steps_rad, ratios)).max())


def first_harmonic_gain(phase_rad: FloatArray, steps_rad: FloatArray, ratios: FloatArray) -> FloatArray:
    """Factor by which harmonics change the amplitude [n] that a fit of one sinusoid finds, for the true phase [n]."""
    return np.abs(_found(phase_rad, steps_rad, ratios))


def _found(phase_rad: FloatArray, steps_rad: FloatArray, ratios: FloatArray) -> NDArray[np.complex128]:
    """cosine + i sine [n] of the fit to the first harmonic, of amplitude 1, and the others."""
    steps = np.asarray(steps_rad, float)
    basis = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)
    inverse = np.linalg.pinv(basis)
    estimator = inverse[1] + 1j * inverse[2]
    turn = _unit(phase_rad)
    found, power = turn.copy(), turn  # power: of the harmonic k, cos(k phase) + i sin(k phase)
    for k in range(2, len(ratios)):
        power = power * turn
        # cos k(phase - step), split into the steps' own part and the phase's
        of_cosine, of_sine = estimator @ np.cos(k * steps), estimator @ np.sin(k * steps)
        if ratios[k] and max(abs(of_cosine), abs(of_sine)) > 1e-12:
            found += ratios[k] * (of_cosine * power.real + of_sine * power.imag)
    return found


def _unit(phase_rad: FloatArray) -> NDArray[np.complex128]:
    """cos + i sin of phases [n]; faster than the exponential function of complex numbers."""
    turn = np.empty(np.shape(phase_rad), complex)
    turn.real, turn.imag = np.cos(phase_rad), np.sin(phase_rad)
    return turn


def correct_phase(phase_rad: FloatArray, steps_rad: FloatArray, ratios: FloatArray) -> FloatArray:
    """The true phases [n], from those found and the harmonics over the first; good to 1e-6 rad.

    Raises ValueError for harmonics so strong that two true phases give the same one.
    """
    tables = _tables(*(np.ascontiguousarray(a, float).tobytes() for a in (steps_rad, ratios)))
    return phase_rad if tables is None else wrapped(phase_rad + tables[0].at(phase_rad))


def error_gain(phase_rad: FloatArray, steps_rad: FloatArray, ratios: FloatArray) -> FloatArray:
    """Factor [n] from errors of the phases found to those of the corrected ones."""
    tables = _tables(*(np.ascontiguousarray(a, float).tobytes() for a in (steps_rad, ratios)))
    return np.ones_like(phase_rad) if tables is None else tables[1].at(phase_rad)


@lru_cache(maxsize=64)
def _tables(steps: bytes, ratios: bytes) -> tuple[PeriodicTable, PeriodicTable] | None:
    """Of the phase found: what has to be added, and the factor of its errors; None where there is nothing to correct.
    steps, ratios: bytes of their float64 arrays."""
    of = np.frombuffer(steps), np.frombuffer(ratios)
    true, found = _table(*of)
    if not np.abs(found - true).max() > 1e-9:
        return None
    place = np.linspace(-np.pi, np.pi, 2 * TABLE + 1)
    gain = np.interp(place, found, np.gradient(true, found), period=2 * np.pi)
    add = np.interp(place, found, true - found, period=2 * np.pi)
    # one step of Newton's method: only the interpolation between these places is left to err
    add -= gain * (add + phase_bias(place + add, *of))
    return PeriodicTable.of(add), PeriodicTable.of(gain)


def _table(steps_rad: FloatArray, ratios: FloatArray) -> tuple[FloatArray, FloatArray]:
    """True phases and those found. ValueError where these do not grow with the true ones."""
    true = np.linspace(-np.pi, np.pi, TABLE + 1)
    found = true + phase_bias(true, steps_rad, ratios)
    if not (np.diff(found) > 0).all():
        raise ValueError(
            f"harmonics of {np.round(ratios[2:5], 3).tolist()} of the first are too strong for {len(steps_rad)} steps: "
            "two phases look the same; must be taken with more steps"
        )
    return true, found


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """Angles from -pi to pi."""
    turned: FloatArray = angle_rad - 2 * np.pi * np.rint(angle_rad / (2 * np.pi))
    return turned


@dataclass(frozen=True)
class ResponseTable:
    """Measured camera values [n] for values shown [n] on the screen, both growing.

    Raises ValueError where they do not, or for fewer than three.
    """

    shown: FloatArray
    camera: FloatArray

    def __post_init__(self) -> None:
        if self.shown.shape != self.camera.shape or self.shown.ndim != 1 or len(self.shown) < 3:
            raise ValueError(
                f"response table: {self.shown.shape} values shown, {self.camera.shape} camera values; "
                "must be two rows of at least three numbers"
            )
        for name, values in (("values shown", self.shown), ("camera values", self.camera)):
            if not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
                raise ValueError(f"response table: the {name} must be finite and grow from entry to entry")

    @property
    def harmonics(self) -> FloatArray:
        """Harmonics over the first, of a sinusoid shown over the table's whole range."""
        return response_harmonics(self.shown, self.camera)

    def shown_values(self, camera: FloatArray) -> FloatArray:
        """Values shown that give these camera values: the table inverted by linear interpolation, its ends beyond."""
        values: FloatArray = np.interp(camera, self.camera, self.shown)
        return values

    def linearised(self, samples: FloatArray, dark: FloatArray, white: FloatArray) -> FloatArray:
        """Values shown, 0 to 1, of samples [..., n] of pixels whose black and white screen give dark, white [n].

        Each pixel is scaled to the table's range first: the curve is the screen's, and pixels differ in brightness.
        """
        share = (samples - dark) / (white - dark)
        camera = self.camera[0] + share * (self.camera[-1] - self.camera[0])
        values: FloatArray = (self.shown_values(camera) - self.shown[0]) / (self.shown[-1] - self.shown[0])
        return values
