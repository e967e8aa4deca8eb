"""From fringe images to the places on the screen that the pixels see, with error bars.

found = screen_coordinates(stack)      # FringeStack of images
found.x.fraction, found.x.standard_error
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.fringe_survey import DOUBTFUL, MANY, MAX_FLOOR_RAD, SAMPLE, Survey, phases_of, survey
from irtscots_cl.measurement.harmonics import ResponseTable, without_harmonics
from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.phase import FrameNoise, fit_sinusoid
from irtscots_cl.measurement.unwrapping import TAU, Prior, Unwrapped, phase_floor, refined, unwrap
from irtscots_cl.system import interruption
from irtscots_cl.system.memory import check_memory

if TYPE_CHECKING:
    from irtscots_cl.measurement.spatial_unwrapping import Island

AT_ONCE = 2**15  # pixels: what is made of them on the way stays in a processor's cache
WORKERS = min(4, os.cpu_count() or 1)
MAP_BYTES = 24  # of a pixel and series: five maps
PIXEL_BYTES = 120  # of a pixel: places, errors, and what is made on the way
NOISY_RAD = 0.5  # error of a phase, from which on neighbours may differ by more than pi by chance


@dataclass(frozen=True)
class AxisCoordinates:
    """What the fringes of one axis say. All maps are NaN outside the mask.

    fraction, standard_error: [rows, columns] of the screen, in the fringes' own convention (FringeSet.reverse, ends);
    the standard error holds noise and the floor, for the right fringe orders. wrong: probability of wrong orders.
    misfit: chi-square of the series' agreement over its degrees of freedom.
    phase_rad (harmonics taken out), phase_error_rad (noise alone), amplitude, offset, residual (rms over its degrees of
    freedom, harmonics included): [series, rows, columns] float32, the phase 64 bits. missing: [rows, columns] samples
    left out, saturated or no numbers. islands: where the phase was unwrapped over the image, since the series leave the
    place open: its parts, each with the order that the prior tells.
    """

    fringes: FringeSet
    survey: Survey
    fraction: FloatArray = field(repr=False)
    standard_error: FloatArray = field(repr=False)
    wrong: FloatArray = field(repr=False)
    misfit: FloatArray = field(repr=False)
    phase_rad: NDArray[Any] = field(repr=False)
    phase_error_rad: NDArray[Any] = field(repr=False)
    amplitude: NDArray[Any] = field(repr=False)
    offset: NDArray[Any] = field(repr=False)
    residual: NDArray[Any] = field(repr=False)
    missing: NDArray[Any] = field(repr=False)
    islands: tuple[Island, ...] = ()

    @property
    def modulation(self) -> NDArray[Any]:
        """Amplitude over offset [series, rows, columns]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share: NDArray[Any] = self.amplitude / self.offset
            return share


@dataclass(frozen=True)
class ScreenCoordinates:
    """Places on the screen that the pixels see. mask: [rows, columns] pixels that were evaluated. axes: by "x", "y"."""

    mask: BoolArray = field(repr=False)
    axes: Mapping[str, AxisCoordinates]

    @property
    def x(self) -> AxisCoordinates:
        return self.axes["x"]

    @property
    def y(self) -> AxisCoordinates:
        return self.axes["y"]

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found that is not as it was said."""
        return tuple(note for axis in self.axes.values() for note in (*axis.survey.faults, *axis.survey.notes))


def screen_coordinates(
    stack: FringeStack,
    *,
    mask: BoolArray | None = None,
    noise: FrameNoise | None = None,
    response: ResponseTable | None = None,
    prior: Mapping[str, tuple[FloatArray, FloatArray]] | None = None,
) -> ScreenCoordinates:
    """Places on the screen from fringe images.

    mask: pixels [rows, columns] to evaluate; None: those that see the mirror, from the white and dark images or the
    fringes' amplitude. noise: of the images; None: from their residuals. response: of screen and camera; used if the
    images agree with it. prior: by axis, fractions and standard errors [rows, columns] known beforehand, as a design's.

    Raises ValueError where no pixel sees fringes, or the images do not fit the memory.
    """
    rows, columns = stack.shape
    series = max(len(one.periods) for one in stack.sets)
    check_memory(f"fringe images of {rows} x {columns} pixels", rows * columns * (2 * series * MAP_BYTES + PIXEL_BYTES))
    if mask is not None and np.shape(mask) != stack.shape:
        raise ValueError(f"mask of shape {np.shape(mask)}: must be {stack.shape}, as the images")
    mask = find_mask(stack) if mask is None else np.asarray(mask, bool)
    pixels = np.flatnonzero(mask)
    if not pixels.size:
        raise ValueError("mask: no pixel is marked")
    axes = {}
    for number, fringes in enumerate(stack.sets):
        known = (prior or {}).get(fringes.axis)
        axes[fringes.axis] = _axis(stack, number, pixels, known, noise, response)
    return ScreenCoordinates(mask, axes)


def find_mask(stack: FringeStack, largest: bool = True) -> BoolArray:
    """The pixels that see the mirror, by their mirror_signal. largest: see mirror_mask."""
    return mirror_mask(mirror_signal(stack), largest)


def mirror_signal(stack: FringeStack) -> FloatArray:
    """How bright the pixels [rows, columns] are in the screen's light: white less dark where there are such images,
    else the least amplitude of both axes' lowest series."""
    if stack.white is not None:
        return np.asarray(stack.white, float) - (0.0 if stack.dark is None else np.asarray(stack.dark, float))
    weakest = np.full(stack.shape[0] * stack.shape[1], np.inf)
    for number, fringes in enumerate(stack.sets):
        lowest = int(np.argmin(fringes.periods))
        lines, steps = stack.lines(number, lowest), np.asarray(fringes.steps_rad[lowest])

        def take_part(part: slice, lines: list[NDArray[Any]] = lines, steps: FloatArray = steps) -> None:
            amplitude = fit_sinusoid(_samples(lines, part, None), steps, stack.saturation).amplitude
            weakest[part] = np.fmin(weakest[part], amplitude)

        _for_all(take_part, len(weakest))
    weakest[~np.isfinite(weakest)] = np.nan
    return weakest.reshape(stack.shape)


def _samples(lines: list[NDArray[Any]], part: slice, inside: BoolArray | None) -> NDArray[Any]:
    """Samples [N, n] of images [pixels] each, of a part of the pixels, or of those inside it."""
    kind = np.result_type(*lines)
    if inside is None:
        return np.array([line[part] for line in lines], kind)
    return np.array([line[part][inside] for line in lines], kind)


def _parts(count: int) -> list[slice]:
    return [slice(k, min(k + AT_ONCE, count)) for k in range(0, count, AT_ONCE)]


def _axis(
    stack: FringeStack,
    number: int,
    pixels: IntArray,
    known: tuple[FloatArray, FloatArray] | None,
    noise: FrameNoise | None,
    response: ResponseTable | None,
) -> AxisCoordinates:
    fringes = stack.sets[number]
    prior = None
    if known is not None:
        place, error = (np.asarray(a, float).ravel() for a in np.broadcast_arrays(*known))
        prior = Prior(1 - place if fringes.reverse else place, error)
    chosen = pixels[:: max(1, len(pixels) // SAMPLE)]
    some = None if prior is None else Prior(prior.fraction[chosen], prior.standard_error[chosen])
    found = survey(stack, number, chosen, noise, response, some)
    maps = _evaluate(stack, number, pixels, found)
    mask = _mask_of(pixels, stack)
    islands: tuple[Island, ...] = ()
    if some is not None and _is_open(fringes, maps, chosen, found.floor_rad):
        assert prior is not None
        places, islands = _places_of_image(fringes, maps, found.floor_rad, prior, mask, stack.shape)
        found = replace(found, notes=found.notes + _doubts(fringes, islands))
    else:
        places = places_of_phases(fringes, maps["phase_rad"], maps["phase_error_rad"], found.floor_rad, prior, mask)
    grids: dict[str, Any] = {name: values.reshape(*values.shape[:-1], *stack.shape) for name, values in maps.items()}
    grids["islands"] = islands
    return AxisCoordinates(fringes, found, *places.reshape(4, *stack.shape), **grids)


def _is_open(fringes: FringeSet, maps: Mapping[str, NDArray[Any]], pixels: IntArray, floor_rad: float) -> bool:
    """Whether the series alone leave several places to some of the pixels."""
    phase, error = (np.asarray(maps[name][:, pixels], float) for name in ("phase_rad", "phase_error_rad"))
    return bool((unwrap(phase, np.hypot(error, floor_rad), fringes.periods).wrong > DOUBTFUL).mean() > MANY)


def _places_of_image(
    fringes: FringeSet,
    maps: Mapping[str, NDArray[Any]],
    floor_rad: float,
    prior: Prior,
    mask: BoolArray,
    shape: tuple[int, int],
) -> tuple[FloatArray, tuple[Island, ...]]:
    """As places_of_phases, and the islands: the lowest series unwrapped over the image, the others from its places."""
    from irtscots_cl.measurement.spatial_unwrapping import unwrap_image

    lowest = int(np.argmin(fringes.periods))
    turn = TAU * fringes.periods[lowest]  # phase over the whole screen
    error = np.hypot(maps["phase_error_rad"][lowest].astype(float), floor_rad)
    image = unwrap_image(
        maps["phase_rad"][lowest].reshape(shape),
        (mask & (error < NOISY_RAD)).reshape(shape),
        turn * prior.fraction.reshape(shape),
        turn * prior.standard_error.reshape(shape),
    )
    coarse = Prior(image.phase_rad.ravel() / turn, error / turn)
    wrong = np.where(mask, image.wrong.ravel(), np.nan)
    others = [k for k in range(len(fringes.periods)) if k != lowest]
    if others:
        rest = replace(
            fringes,
            periods=tuple(fringes.periods[k] for k in others),
            steps_rad=tuple(fringes.steps_rad[k] for k in others),
        )
        known = np.isfinite(coarse.fraction)
        phases, errors = (maps[name][others] for name in ("phase_rad", "phase_error_rad"))
        places = places_of_phases(rest, phases, errors, floor_rad, coarse, known)
        places[2] = np.where(known, 1 - (1 - wrong) * (1 - places[2]), wrong)
        return places, image.islands
    fraction = 1 - coarse.fraction if fringes.reverse else coarse.fraction
    spread = np.where(np.isfinite(fraction), coarse.standard_error, np.nan)
    return np.stack([fraction, spread, wrong, np.full_like(wrong, np.nan)]), image.islands


def _doubts(fringes: FringeSet, islands: tuple[Island, ...]) -> tuple[str, ...]:
    """A note where the prior does not tell the order of an island."""
    doubtful = [island for island in islands if island.wrong > DOUBTFUL]
    if not doubtful:
        return ()
    most = max(doubtful, key=lambda island: island.pixels)
    where = f"that of {most.pixels} pixels from row {most.row}, column {most.column}"
    why = f"is {abs(most.gap_turns):.2f} of a period from the predicted place: wrong with probability {most.wrong:.2g}"
    if np.isnan(most.gap_turns):
        why = "has no predicted place"
    return (
        f"{fringes.axis} fringes: which fringe they see is in doubt for {len(doubtful)} of {len(islands)} islands of "
        f"pixels, which are not used; {where} {why}",
    )


def places_again(
    one: AxisCoordinates, pixels: IntArray, phase_rad: FloatArray, error_rad: FloatArray, keep_orders: bool = False
) -> tuple[float, FloatArray]:
    """Floor [rad] and places [4, n], as of places_of_phases, for somewhat other phases [series, n] of some pixels.

    pixels: [n] flat numbers. Orders that were found from the image as a whole stay as they are, and with keep_orders
    all do, as where a Gray code told them.
    """
    periods = one.fringes.periods
    if not one.islands and not keep_orders:
        some = slice(None, None, max(1, len(pixels) // SAMPLE))
        floor = phase_floor(phase_rad[:, some], error_rad[:, some], periods)
        return floor, places_of_phases(one.fringes, phase_rad, error_rad, floor)
    floor, fraction = one.survey.floor_rad, one.fraction.ravel()[pixels]
    near = 1 - fraction if one.fringes.reverse else fraction
    places = _told(one.fringes, refined(phase_rad, np.hypot(error_rad, floor), periods, near))
    places[2] = one.wrong.ravel()[pixels]
    return floor, places


def _told(fringes: FringeSet, result: Unwrapped) -> FloatArray:
    """Fraction in the fringes' convention, standard error, probability of wrong orders, misfit over freedom: [4, n]."""
    fraction = 1 - result.fraction if fringes.reverse else result.fraction
    with np.errstate(divide="ignore", invalid="ignore"):
        misfit = np.where(result.freedom > 0, result.misfit / result.freedom, np.nan)
    return np.stack([fraction, result.standard_error, result.wrong, misfit])


def _mask_of(pixels: IntArray, stack: FringeStack) -> BoolArray:
    """Whether each pixel of the images, by its flat number, is one of these."""
    mask = np.zeros(stack.shape[0] * stack.shape[1], bool)
    mask[pixels] = True
    return mask


def places_of_phases(
    fringes: FringeSet,
    phase_rad: NDArray[Any],
    error_rad: NDArray[Any],
    floor_rad: float,
    prior: Prior | None = None,
    mask: BoolArray | None = None,
) -> FloatArray:
    """Fraction, standard error, probability of wrong orders and misfit over its freedom, [4, n].

    phase_rad, error_rad: [series, n]. floor_rad: error of all phases beside their own. prior: of [n], in the phases'
    direction. mask: [n] pixels to evaluate, NaN elsewhere; None: all.
    """
    places = np.full((4, phase_rad.shape[1]), np.nan)

    def place_part(part: slice) -> None:
        inside = None if mask is None else mask[part]
        if inside is not None and not inside.any():
            return
        there = slice(None) if inside is None or inside.all() else inside
        near = None if prior is None else Prior(prior.fraction[part][there], prior.standard_error[part][there])
        error = np.asarray(error_rad[:, part][:, there], float)
        total = np.sqrt(error * error + floor_rad**2)
        result = unwrap(np.asarray(phase_rad[:, part][:, there], float), total, fringes.periods, near)
        told = _told(fringes, result)
        if floor_rad > MAX_FLOOR_RAD:  # series that do not agree
            told[2] = 1.0
        for row, values in zip(places, told, strict=True):
            row[part][there] = values

    _for_all(place_part, phase_rad.shape[1])
    return places


def _evaluate(stack: FringeStack, number: int, pixels: IntArray, found: Survey) -> dict[str, NDArray[Any]]:
    """Phases and what belongs to them [series, all pixels], samples that are missing [all pixels]; NaN outside the
    given pixels."""
    shape = len(found.steps_rad), stack.shape[0] * stack.shape[1]
    names = ("phase_error_rad", "amplitude", "offset", "residual")
    # places to 1e-9 of the screen need more than 32 bits of phase
    maps: dict[str, NDArray[Any]] = {"phase_rad": np.full(shape, np.nan)}
    maps |= {name: np.full(shape, np.nan, np.float32) for name in names}
    maps["missing"] = np.full(shape[1], np.nan, np.float32)
    mask = _mask_of(pixels, stack)
    maps["missing"][mask] = 0
    for k in range(shape[0]):
        lines = stack.lines(number, k)

        def fit_part(part: slice, k: int = k, lines: list[NDArray[Any]] = lines) -> None:
            inside = mask[part]
            if not inside.any():
                return
            where = None if inside.all() else inside
            samples = _samples(lines, part, where)
            fit = fit_sinusoid(samples, found.steps_rad[k], stack.saturation)
            ratios = found.harmonics[k]
            if ratios is not None:
                fit = without_harmonics(samples, fit, ratios)
            of_series = slice(k, k + 1)
            phase, error = phases_of(
                [fit], found.steps_rad[of_series], found.harmonics[of_series], found.noise, found.sign
            )
            there = slice(None) if where is None else where
            with np.errstate(invalid="ignore", divide="ignore"):
                values = (found.excess[k] * error[0], fit.amplitude, fit.offset, fit.residual_rms)
                for name, value in zip(names, values, strict=True):
                    maps[name][k, part][there] = value
            maps["phase_rad"][k, part][there] = phase[0]
            if fit.incomplete.size:
                maps["missing"][part][there] += len(lines) - fit.samples

        _for_all(fit_part, shape[1])
    return maps


def _for_all(work: Callable[[slice], None], count: int) -> None:
    """Call work(part) for all parts of so many pixels; NumPy works on several at once."""
    with ThreadPoolExecutor(WORKERS) as pool:
        for _ in pool.map(work, _parts(count)):
            interruption.check()
