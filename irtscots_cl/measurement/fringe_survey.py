"""What a sample of the pixels says of a set of fringe images, before all pixels are evaluated: the steps that were
taken, their direction, harmonics, noise, blur, and how well the series agree."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.fringe_noise import estimate_noise, excess_errors, series_variance
from irtscots_cl.measurement.harmonics import (
    ResponseTable,
    SecondHarmonic,
    blurred,
    correct_phase,
    error_gain,
    gamma_harmonics,
    gamma_of,
    harmonics_of,
    residual_square,
    second_harmonic,
    without_harmonics,
)
from irtscots_cl.measurement.phase import FrameNoise, SinusoidFit, fit_sinusoid
from irtscots_cl.measurement.phase_steps import find_steps
from irtscots_cl.measurement.unwrapping import Prior, phase_floor, unwrap

SAMPLE = 8000  # pixels
STEP_SAMPLE = 1000  # of them, for the search of steps
HARMONIC_ROUNDS = 6  # of finding steps and harmonics in turn
SETTLED_RAD = 1e-4  # of the steps, where that ends
MIN_RATIO = 0.002  # second harmonic over the first: below, what the others do to a phase is under 1 mrad
BETTER = 0.5  # residual of other steps over that of the nominal ones: the steps are wrong
AGREE = 0.1  # relative: second harmonics of a table and of the images that are called the same
CLEARLY = 0.1  # misfit over that of the other direction: the direction is found
MAX_FLOOR_RAD = 0.2  # beyond, the orders of the fringes are in doubt
DOUBTFUL, MANY = 0.01, 0.01  # probability of wrong orders; share of the pixels beyond it
SEEN = 3.0  # standard errors of an amplitude, the median pixel's: below, a series has no fringes
BROKEN_RAD = 0.5  # difference of the series' phases, beyond which one of them is broken
MAX_RATIO = 0.7  # of a second harmonic: beyond, it is none
ROUNDING = 1 / 12  # variance of whole numbers

NOT_SEEN = SecondHarmonic(math.nan, math.nan)
NO_NOISE = (
    "three steps leave nothing to tell the noise from: the error bars come from the agreement of the series alone"
)
DISAGREE = (
    "the phases of the series differ by {:.2f} rad beyond their noise; a number of periods may be wrong, or beyond "
    "what the blur lets through"
)
AMBIGUOUS = (
    "{:.0%} of the pixels fit several places on the screen; must have a series below one period, or a prior such as a "
    "design's"
)
EMPTY = (
    "{} fringes of {:g} periods: no fringes in the images: the amplitude is {:.2g} times what noise and wrong frames "
    "alone make; the series is broken or was not shown: record it again, or delete its lines in the manifest"
)
IMPOSSIBLE = (
    "{} fringes of {:g} periods: a second harmonic of more than {:.1f} of the first, which no screen makes: "
    "frames are exchanged, wrong, or of another series; record the series again"
)
BROKEN_SERIES = (
    "{} fringes: the phases of the series differ by {:.2f} rad{}: a series is broken, its number of periods is "
    "another, or beyond what the blur lets through; record it again, mend the manifest's periods, or delete its lines"
)
UNEVEN_SERIES = (
    "residuals {:.3g} times those of the other series: a frame is wrong, or the light changed; they count less"
)
NO_FRINGES = (
    "there are none, or a frame is wrong: what is left of a sinusoid's fit is as large as the fringes; not used"
)
BACKWARDS = "the steps ran backwards: the phases of the series agree {:.0f} times better that way, which is used"


@dataclass(frozen=True)
class Survey:
    """What holds for all pixels of a set. steps_rad: [series] of the steps to evaluate with. sign: -1 where the steps
    ran backwards. noise: None where it cannot be told. harmonics: [series] over the first, None where they are left
    alone. second: what the images say of the second one, [series]. floor_rad: error of all phases that noise does not
    explain. amplitude, offset: [series] medians. notes: what was found that is not as it was said. excess: [series]
    factor of the phases' errors, above 1 where a series' residuals are no noise. faults: what makes the images no
    measurement."""

    steps_rad: tuple[FloatArray, ...]
    sign: int
    noise: FrameNoise | None
    harmonics: tuple[FloatArray | None, ...]
    second: tuple[SecondHarmonic, ...]
    floor_rad: float
    amplitude: FloatArray
    offset: FloatArray
    notes: tuple[str, ...]
    excess: tuple[float, ...]
    faults: tuple[str, ...] = ()


def survey(
    stack: FringeStack,
    number: int,
    pixels: IntArray,
    noise: FrameNoise | None = None,
    response: ResponseTable | None = None,
    prior: Prior | None = None,
) -> Survey:
    """Survey of a stack's set, from the flat pixel numbers [n]. prior: of these pixels.

    noise: of the images where it is known. response: a table of the screen's and camera's response, believed if the
    images agree with it.
    """
    fringes = stack.sets[number]
    notes: list[str] = []
    samples, steps, fits = [], [], []
    for periods, said, values in stack.samples(number, pixels):
        taken, found = _steps_of(values, np.asarray(said), fringes.axis, periods, stack.saturation)
        notes += found
        samples.append(values)
        steps.append(taken)
        fits.append(fit_sinusoid(values, taken, stack.saturation))
    second = tuple(_second_harmonic(v, f) for v, f in zip(samples, fits, strict=True))
    broken = _impossible(fringes, second) | _empty_series(fringes, fits)
    second = tuple(one if abs(one.ratio) <= MAX_RATIO else NOT_SEEN for one in second)
    harmonics, found = _harmonics_of(fringes, fits, second, response)
    notes += found
    fits = [
        fit if ratios is None else without_harmonics(values, fit, ratios)
        for values, fit, ratios in zip(samples, fits, harmonics, strict=True)
    ]
    left = _residuals(samples, fits, harmonics, second)
    excess = _excess(fits, left)
    notes += _left_out(fringes, excess, broken)
    faults = list(broken.values())
    if noise is None:
        noise = _noise_of(samples, fits, left, excess)
        if noise is None:
            notes.append(f"{fringes.axis} fringes: {NO_NOISE}")
    phases, errors = phases_of(fits, steps, harmonics, noise, 1)
    errors *= excess[:, None]
    sign, found = _direction(fringes, phases, errors, prior)
    notes += found
    floor, found, fault = _agreement(fringes, sign * phases, errors, prior)
    notes += found
    faults += fault
    return Survey(
        tuple(steps),
        sign,
        noise,
        harmonics,
        second,
        floor,
        np.array([np.nanmedian(fit.amplitude) for fit in fits]),
        np.array([np.nanmedian(fit.offset) for fit in fits]),
        tuple(notes),
        tuple(map(float, excess)),
        tuple(faults),
    )


def _agreement(
    fringes: FringeSet, phases: FloatArray, errors: FloatArray, prior: Prior | None
) -> tuple[float, list[str], list[str]]:
    """Error [rad] of all phases that their noise does not explain; notes and faults of how the series agree."""
    # not noise: what may be one and the same in all frames
    floor = phase_floor(phases, errors, fringes.periods, prior)
    if floor > BROKEN_RAD:
        return floor, [], [BROKEN_SERIES.format(fringes.axis, floor, _culprit(fringes, phases, errors, prior))]
    if floor > MAX_FLOOR_RAD:
        return floor, [f"{fringes.axis} fringes: {DISAGREE.format(floor)}"], []
    doubtful = unwrap(phases, np.hypot(errors, floor), fringes.periods, prior).wrong > DOUBTFUL
    if doubtful.mean() > MANY:
        return floor, [f"{fringes.axis} fringes: {AMBIGUOUS.format(doubtful.mean())}"], []
    return floor, [], []


def _second_harmonic(values: NDArray[Any], fit: SinusoidFit) -> SecondHarmonic:
    """As second_harmonic; one beyond MAX_RATIO where the residuals are those of no screen."""
    try:
        return second_harmonic(values, fit)
    except ValueError:
        return SecondHarmonic(1.0, 0.0)


def _empty_series(fringes: FringeSet, fits: list[SinusoidFit]) -> dict[int, str]:
    """Series whose amplitude is no more than their own residuals make."""
    told = {}
    for k, (periods, fit) in enumerate(zip(fringes.periods, fits, strict=True)):
        rms = fit.residual_rms
        if not np.isfinite(rms).any():
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.nanmedian(fit.amplitude) / (np.sqrt(2 / len(fit.steps_rad)) * np.sqrt(np.nanmean(rms**2)))
        if share < SEEN:
            told[k] = EMPTY.format(fringes.axis, periods, share)
    return told


def _impossible(fringes: FringeSet, second: tuple[SecondHarmonic, ...]) -> dict[int, str]:
    """Series with a second harmonic that no screen makes."""
    return {
        k: IMPOSSIBLE.format(fringes.axis, periods, MAX_RATIO)
        for k, (periods, one) in enumerate(zip(fringes.periods, second, strict=True))
        if abs(one.ratio) > MAX_RATIO and one.is_seen
    }


def _culprit(fringes: FringeSet, phases: FloatArray, errors: FloatArray, prior: Prior | None) -> str:
    """Which series the others agree without, in words; "" where none or several would do."""
    if len(fringes.periods) < 3:
        return ""
    agree = []
    for k in range(len(fringes.periods)):
        others = np.arange(len(fringes.periods)) != k
        periods = tuple(p for j, p in enumerate(fringes.periods) if j != k)
        if phase_floor(phases[others], errors[others], periods, prior) < MAX_FLOOR_RAD:
            agree.append(fringes.periods[k])
    return f", without that of {agree[0]:g} periods they agree" if len(agree) == 1 else ""


def phases_of(
    fits: list[SinusoidFit],
    steps: list[FloatArray] | tuple[FloatArray, ...],
    harmonics: tuple[FloatArray | None, ...],
    noise: FrameNoise | None,
    sign: int,
) -> tuple[FloatArray, FloatArray]:
    """Phases and their standard errors [series, n], harmonics taken out."""
    phases, errors = [], []
    for fit, of_steps, ratios in zip(fits, steps, harmonics, strict=True):
        found, error = fit.phase_rad, fit.phase_error_rad(noise or FrameNoise(0.0))
        if ratios is not None:
            # pixels that lack samples have been fitted without the harmonics
            whole = fit.samples == len(of_steps)
            error = np.where(whole, error * error_gain(found, of_steps, ratios), error)
            found = np.where(whole, correct_phase(found, of_steps, ratios), found)
        phases.append(sign * found)
        errors.append(error)
    return np.stack(phases), np.stack(errors)


def _steps_of(
    values: NDArray[Any], said: FloatArray, axis: str, periods: float, saturation: float
) -> tuple[FloatArray, list[str]]:
    """The steps to evaluate with, and a note where they are not those said.

    Other steps count only where they explain the samples much better than a second harmonic does.
    """
    some = values[:, :: max(1, values.shape[1] // STEP_SAMPLE)]
    found = find_steps(some, said, saturation)
    for _ in range(HARMONIC_ROUNDS):
        if found is None or not found.wrong.size:
            return said, []
        # a second harmonic looks like other steps, and other steps like a second harmonic
        last, first = found, _first_alone(some, found.found_rad, saturation)
        found = find_steps(first, said, saturation, last.found_rad)
        if found is None or np.abs(found.found_rad - last.found_rad).max() < SETTLED_RAD:
            break
    if found is None or not found.wrong.size:
        return said, []
    if not _left(some, found.found_rad, saturation) < BETTER * _left(some, said, saturation):
        return said, []
    worst = int(np.argmax(np.abs(found.difference_rad)))
    mean = np.diff(found.found_rad).mean()
    return found.found_rad, [
        f"{axis} fringes of {periods:g} periods: {found.wrong.size} of {len(said)} frames were not taken at the steps "
        f"said: frame {worst} at {found.found_rad[worst]:.3f} rad, said {said[worst]:.3f} rad; "
        f"mean step {mean:.4f} rad = 2 pi / {2 * math.pi / mean:.2f}; the steps found are used"
    ]


def _first_alone(values: NDArray[Any], steps: FloatArray, saturation: float) -> NDArray[Any]:
    """Samples without the harmonics of a screen's gamma, as far as the fits with these steps show them."""
    fit = fit_sinusoid(values, steps, saturation)
    seen = _second_harmonic(values, fit)
    if not seen.is_seen or abs(seen.ratio) > MAX_RATIO:
        return values
    ratios = gamma_harmonics(gamma_of(seen.ratio))
    fit = without_harmonics(values, fit, ratios)
    higher = harmonics_of(fit, ratios)
    cut = ~(np.asarray(values, float) < saturation)
    return np.where(cut, np.nan, values - higher)


def _left(values: NDArray[Any], steps: FloatArray, saturation: float) -> float:
    """Median squared residual of fits with these steps and a screen's gamma."""
    fit = fit_sinusoid(values, steps, saturation)
    seen = _second_harmonic(values, fit)
    if seen.is_seen and abs(seen.ratio) <= MAX_RATIO:
        ratios = gamma_harmonics(gamma_of(seen.ratio))
        whole = fit.samples == len(steps)
        fit = without_harmonics(values, fit, ratios)
        return float(np.nanmedian(np.where(whole, residual_square(values, fit, ratios), fit.square)))
    return float(np.nanmedian(fit.square))


def _harmonics_of(
    fringes: FringeSet,
    fits: list[SinusoidFit],
    second: tuple[SecondHarmonic, ...],
    response: ResponseTable | None,
) -> tuple[tuple[FloatArray | None, ...], list[str]]:
    """Harmonics over the first to take out of the phases of each series, and notes."""
    nothing: tuple[FloatArray | None, ...] = (None,) * len(fits)
    lowest = int(np.argmin(fringes.periods))
    seen = second[lowest]
    notes: list[str] = []
    whole: FloatArray | None = None
    if response is not None:
        whole = response.harmonics
        if np.isfinite(seen.ratio) and abs(seen.ratio - whole[2]) > max(AGREE * abs(whole[2]), 5 * seen.standard_error):
            notes.append(
                f"{fringes.axis} fringes: the response table makes a second harmonic of {whole[2]:.4f} of the first, "
                f"the images have {seen.ratio:.4f} +- {seen.standard_error:.1g}: the fringes were not shown through "
                "this response; it is not applied"
            )
            whole = None
    if whole is None and seen.is_seen and abs(seen.ratio) > MIN_RATIO:
        whole = gamma_harmonics(seen.gamma)
    if whole is None:
        return nothing, notes
    fall = blur_fall(np.array(fringes.periods), np.array([np.nanmedian(fit.amplitude) for fit in fits]))
    least = min(fringes.periods)
    return tuple(blurred(whole, fall, math.sqrt(p**2 - least**2)) for p in fringes.periods), notes


def blur_fall(periods: FloatArray, amplitude: FloatArray) -> float:
    """The constant k of a blur exp(-k p^2), from the amplitudes of the lowest and the highest number of periods."""
    low, high = int(np.argmin(periods)), int(np.argmax(periods))
    span = periods[high] ** 2 - periods[low] ** 2
    if span <= 0 or not (amplitude[low] > 0 and amplitude[high] > 0):
        return 0.0
    return max(0.0, math.log(amplitude[low] / amplitude[high]) / float(span))


def _residuals(
    samples: list[NDArray[Any]],
    fits: list[SinusoidFit],
    harmonics: tuple[FloatArray | None, ...],
    second: tuple[SecondHarmonic, ...],
) -> list[FloatArray]:
    """Sums of squared residuals [n] of all series, without the harmonics in them."""
    found = []
    for values, fit, ratios, own in zip(samples, fits, harmonics, second, strict=True):
        left = fit.square
        if np.isfinite(own.ratio):
            there = np.zeros(4) if ratios is None else ratios.copy()
            there[2] = own.ratio
            left = np.where(fit.samples == len(fit.steps_rad), residual_square(values, fit, there), left)
        found.append(left)
    return found


def _excess(fits: list[SinusoidFit], left: list[FloatArray]) -> FloatArray:
    """Factors [series] of the errors of series whose residuals are no noise, as where one frame is wrong."""
    variance = np.array([series_variance(s, f.freedom.astype(float)) for s, f in zip(left, fits, strict=True)])
    return excess_errors(variance, np.array([np.nanmedian(fit.amplitude) for fit in fits]))


def _left_out(fringes: FringeSet, excess: FloatArray, broken: dict[int, str]) -> list[str]:
    """Notes on the series that count less or not at all, but for those that are named as broken."""
    return [
        f"{fringes.axis} fringes of {fringes.periods[k]:g} periods: "
        + (UNEVEN_SERIES.format(excess[k]) if np.isfinite(excess[k]) else NO_FRINGES)
        for k in np.flatnonzero(excess > 1)
        if k not in broken
    ]


def _noise_of(
    samples: list[NDArray[Any]], fits: list[SinusoidFit], left: list[FloatArray], excess: FloatArray
) -> FrameNoise | None:
    """Noise from the residuals [n] of all series where they are noise."""
    usual = [k for k in range(len(fits)) if excess[k] == 1] or list(range(len(fits)))
    square, freedom, signal = (
        np.concatenate([of(k) for k in usual])
        for of in (lambda k: left[k], lambda k: fits[k].freedom.astype(float), lambda k: fits[k].offset)
    )
    noise = estimate_noise(square, freedom, signal)
    if noise is not None and all(values.dtype.kind in "iu" for values in samples):
        noise = FrameNoise(max(noise.read, ROUNDING), noise.gain)
    return noise


def _direction(
    fringes: FringeSet, phases: FloatArray, errors: FloatArray, prior: Prior | None
) -> tuple[int, list[str]]:
    """1 where the steps ran as said, -1 where they ran backwards: then no place fits the phases of several series."""
    misfit = []
    for sign in (1, -1):
        found = unwrap(sign * phases, np.hypot(errors, 0.05), fringes.periods, prior)
        inside = np.isfinite(found.fraction) & (found.freedom > 0)
        misfit.append(float(np.median(found.misfit[inside])) if inside.any() else math.nan)
    if misfit[1] < CLEARLY * misfit[0]:
        times = misfit[0] / misfit[1]
        return -1, [f"{fringes.axis} fringes: {BACKWARDS.format(times)}"]
    return 1, []
