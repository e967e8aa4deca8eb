"""Places by fringes as those of the light's centroids: the phase of a pixel's light is not that of its centroid.

A pixel's samples have the phase of the Fourier component of its light at p periods. The light is spread by the camera's
aperture and by the pixel, and the screen shows its fringes in steps of its own pixels, at values of so many bits. The
design's light, moved to where the pixel's light was found, gives the difference of the two phases, and how much of the
fringes the light lets through.
Places free of it are means over the light, as those of line scans are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.fringe_gamma import ScreenGamma, screen_gamma
from irtscots_cl.measurement.fringe_noise import errors_of_agreement
from irtscots_cl.measurement.harmonics import phase_bias
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates, places_again
from irtscots_cl.measurement.shown_light import first_edge_mm, shown_light
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.instrument import Screen

LEAST = 0.02  # of the light's modulation, below which its phase says nothing
ROUNDS = 8  # at most, of finding the places and what the light makes of the fringes there
SETTLED = 0.01  # of a place's standard error, by which a round moves it, where they end
SETTLED_MM = 1e-8  # or by that
EXACT, EMITTED, WHOLE, OTHER = "exact", "emitted", "whole", "other"
LINEAR = ScreenGamma()
STEEP = 2.0  # step of the secant over the plain one: beyond, the plain one is taken


@dataclass(frozen=True)
class LightPhases:
    """Of fringes' series, all [series, rows, columns] upright, or [series, n] of some pixels; NaN where the light
    is not known.

    difference_rad: phase of the design's light less that of its centroid. modulation: the amplitude over that of a
    point's light. harmonics_rad: what harmonics of the screen's gamma add to phases of fits to all steps, and
    harmonics_error_rad, by the gamma's own error. gamma: of the screen.
    """

    difference_rad: FloatArray = field(repr=False)
    modulation: FloatArray = field(repr=False)
    harmonics_rad: FloatArray = field(repr=False)
    harmonics_error_rad: FloatArray = field(repr=False)
    gamma: ScreenGamma


def light_phases(
    setup: Setup, fringes: FringeSet, place_mm: FloatArray, levels: int = 0, gamma: ScreenGamma = LINEAR
) -> LightPhases:
    """What the design's light makes of fringes, its centroids moved to place_mm [rows, columns] along the axis.

    levels: number of equal steps of the screen's values (255 for 8 bits), 0: any value; what they do to the phases is
    part of the difference.
    """
    light = setup.pixel_light
    found = phases_of_light(light, setup.scene.screen, fringes, place_mm.ravel()[light.pixels], levels, gamma)
    maps = (found.difference_rad, found.modulation, found.harmonics_rad, found.harmonics_error_rad)
    difference, modulation, harmonics, error = (_on_grid(v, light.pixels, place_mm.shape) for v in maps)
    return LightPhases(difference, modulation, harmonics, error, gamma)


def phases_of_light(
    light: PixelLight,
    screen: Screen,
    fringes: FringeSet,
    centre_mm: FloatArray,
    levels: int = 0,
    gamma: ScreenGamma = LINEAR,
) -> LightPhases:
    """As light_phases, of some pixels' light, its centroids moved to centre_mm [n]: maps [series, n]."""
    k = "xy".index(fringes.axis)
    pitch, count = screen.pitch_xy_mm[k], screen.pixels[k]
    fractions = fringes.pixel_fractions(count)
    shown = _screen_lines(fringes, fractions, levels, gamma)
    means = shown_light(light, screen, fringes.axis, np.concatenate(list(shown.values())), centre_mm)
    of = dict(zip(shown, means.reshape(len(shown), len(fringes.periods), -1), strict=True))
    at_pixel = (centre_mm - first_edge_mm(screen, fringes.axis)) / pitch - 0.5
    at = at_pixel * (fractions[1] - fractions[0]) + fractions[0]
    turn = np.exp(-2j * math.pi * np.array(fringes.periods)[:, None] * at)
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = of[EXACT] * turn
        maps = [np.angle(relative), np.abs(relative), *(np.zeros(relative.shape) for _ in range(2))]
        for k, one, other in ((0, WHOLE, EMITTED), (2, EMITTED, EXACT), (3, OTHER, EMITTED)):
            if one in of:
                maps[k] = maps[k] + np.angle(of[one] / of[other])
    for k in (0, 2, 3):
        maps[k] *= -1 if fringes.reverse else 1
        maps[k][~(maps[1] > LEAST)] = np.nan
    difference, modulation, harmonics, error = maps
    return LightPhases(difference, modulation, harmonics, error, gamma)


def _screen_lines(
    fringes: FringeSet, fractions: FloatArray, levels: int, gamma: ScreenGamma
) -> dict[str, NDArray[np.complex128]]:
    """What each line of the screen adds to the fringes' Fourier component, complex [series, lines].

    EXACT: the component itself. Also what least squares make of what the screen emits: EMITTED, WHOLE with whole levels
    only, OTHER with a gamma that is one standard error higher.
    """
    kinds = {EXACT: np.exp(2j * math.pi * np.array(fringes.periods)[:, None] * fractions)}
    values = fringes.values(fractions)
    if levels or gamma.value != 1:
        kinds[EMITTED] = _fitted(fringes, values**gamma.value)
    if levels:
        kinds[WHOLE] = _fitted(fringes, (np.rint(values * levels) / levels) ** gamma.value)
    if gamma.standard_error:
        kinds[OTHER] = _fitted(fringes, values ** (gamma.value + gamma.standard_error))
    return kinds


def _fitted(fringes: FringeSet, emitted: FloatArray) -> NDArray[np.complex128]:
    """Complex amplitudes [series, lines] of the fits to what the frames [frames, lines] emit."""
    sign = -1 if fringes.reverse else 1
    series, start = [], 0
    for steps in fringes.steps_rad:
        basis = np.stack([np.ones(len(steps)), np.cos(steps), np.sin(steps)], -1)
        _, cosine, sine = np.linalg.pinv(basis) @ emitted[start : start + len(steps)]
        series.append(cosine + 1j * sign * sine)
        start += len(steps)
    return np.stack(series)


def _on_grid(values: FloatArray, pixels: np.ndarray, shape: tuple[int, ...]) -> FloatArray:
    grid = np.full((len(values), math.prod(shape)), np.nan)
    grid[:, pixels] = values
    return grid.reshape(-1, *shape)


def place_mm(one: AxisCoordinates, setup: Setup) -> FloatArray:
    """Places [rows, columns] upright in mm along the axis of the screen's grid."""
    k, screen = "xy".index(one.fringes.axis), setup.scene.screen
    fraction = upright(one.fraction, setup.scene.camera.detector.orientation)
    return one.fringes.position_mm(fraction, screen.pixels[k], screen.pitch_xy_mm[k], screen.centre_offset_mm[k])


def places_of_light(
    found: ScreenCoordinates, setup: Setup, levels: int = 0, keep_orders: bool = False
) -> tuple[ScreenCoordinates, dict[str, LightPhases]]:
    """The same coordinates with the places of the light's centroids; and what the light makes of the fringes, by axis.

    setup: of the design. found: of images as stored, with the detector's pixels. levels: see light_phases.
    keep_orders: of the fringes, where something else than the series told them: a Gray code, the design.
    phase_rad stays as measured. A pixel whose light is not known keeps its place; a series of which the light leaves
    too little is not used. Where places do not settle, what they still move by is part of their standard error.
    """
    setup.pixel_light.valid()  # made once, before two threads ask for it
    with ThreadPoolExecutor(len(found.axes)) as pool:
        results = pool.map(lambda one: _of_light(one, found.mask, setup, levels, keep_orders), found.axes.values())
        moved = dict(zip(found.axes, results, strict=True))
    axes = {axis: one for axis, (one, _) in moved.items()}
    return ScreenCoordinates(found.mask, axes), {axis: light for axis, (_, light) in moved.items()}


def _of_light(
    one: AxisCoordinates, mask: np.ndarray, setup: Setup, levels: int, keep_orders: bool
) -> tuple[AxisCoordinates, LightPhases]:
    """One axis of places_of_light. The light's phases depend on the place that they give: rounds with secant steps."""
    orientation, width = setup.scene.camera.detector.orientation, _fraction_mm(one.fringes, setup)
    at, last = place_mm(one, setup), None
    # the steps that were really taken
    taken = tuple(tuple(float(one.survey.sign * s) for s in steps) for steps in one.survey.steps_rad)
    fringes, lowest = replace(one.fringes, steps_rad=taken), int(np.argmin(one.fringes.periods))
    gamma = LINEAR
    if one.survey.harmonics[lowest] is not None and np.isfinite(one.survey.second[lowest].ratio):
        gamma = screen_gamma(setup, fringes, lowest, at, one.survey.second[lowest])
    for _ in range(ROUNDS):
        phases = light_phases(setup, fringes, at, levels, gamma)
        moved = _moved(one, mask, phases, orientation, keep_orders)
        rest = place_mm(moved, setup) - at
        with np.errstate(invalid="ignore"):
            limit = np.maximum(SETTLED * width * upright(moved.standard_error, orientation), SETTLED_MM)
            unsettled = np.abs(rest) > limit
        if not unsettled.any():
            return moved, phases
        at, last = _secant(at, rest, last), (at, rest)
    left = stored(np.where(unsettled, rest / width, 0.0), orientation)
    return replace(moved, standard_error=np.hypot(moved.standard_error, left)), phases


def _secant(at: FloatArray, rest: FloatArray, last: tuple[FloatArray, FloatArray] | None) -> FloatArray:
    """Where to look next for the place that a round does not move, from what the last two rounds moved it by."""
    plain = at + rest
    if last is None:
        return plain
    with np.errstate(invalid="ignore", divide="ignore"):
        step = rest * (at - last[0]) / (last[1] - rest)
        return np.where(np.abs(step) <= STEEP * np.abs(rest), at + step, plain)


def _fraction_mm(fringes: FringeSet, setup: Setup) -> float:
    """Length on the screen of the fraction 1."""
    k, screen = "xy".index(fringes.axis), setup.scene.screen
    ends = fringes.position_mm(np.array([0.0, 1.0]), screen.pixels[k], screen.pitch_xy_mm[k])
    return float(np.diff(ends)[0])


def _moved(
    one: AxisCoordinates, mask: np.ndarray, phases: LightPhases, orientation: str, keep_orders: bool
) -> AxisCoordinates:
    """Places from the phases less what the light and the harmonics make of them, with the floor that they leave."""
    pixels = np.flatnonzero(mask)

    def flat(values: Any) -> FloatArray:
        return np.asarray(values.reshape(len(values), -1)[:, pixels], float)

    light, harmonics, harmonics_error = (
        flat(stored(v, orientation)) for v in (phases.difference_rad, phases.harmonics_rad, phases.harmonics_error_rad)
    )
    known = np.isfinite(light)
    phase, error = flat(one.phase_rad), flat(one.phase_error_rad)
    if phases.gamma != LINEAR:
        raw = flat(_with_harmonics(one).phase_rad) - harmonics
        complete = known & _complete(one).ravel()[pixels]
        phase, error = np.where(complete, raw, phase), np.hypot(error, np.where(complete, harmonics_error, 0.0))
    phase = np.where(known | ~known.any(0), phase - np.nan_to_num(light), np.nan)
    if one.survey.noise is None:
        error = errors_of_agreement(phase, flat(one.amplitude), one.fringes.periods)
    floor, places = places_again(one, pixels, phase, error, keep_orders)
    grids = _on_grid(places, pixels, mask.shape)
    survey = replace(one.survey, floor_rad=floor)
    return replace(one, survey=survey, fraction=grids[0], standard_error=grids[1], wrong=grids[2], misfit=grids[3])


def _complete(one: AxisCoordinates) -> NDArray[np.bool_]:
    """Pixels [rows, columns] with all samples: those of the others have been fitted without the harmonics."""
    complete: NDArray[np.bool_] = one.missing == 0
    return complete


def _with_harmonics(one: AxisCoordinates) -> AxisCoordinates:
    """The coordinates with the phases of complete pixels as fits of one sinusoid find them."""
    survey, phase, where = one.survey, np.array(one.phase_rad), _complete(one)
    for k, ratios in enumerate(survey.harmonics):
        if ratios is not None:
            own = survey.sign * phase[k, where]
            phase[k, where] = survey.sign * (own + phase_bias(own, survey.steps_rad[k], ratios))
    return replace(one, phase_rad=phase, survey=replace(survey, harmonics=(None,) * len(survey.harmonics)))


def places_with_harmonics(
    found: ScreenCoordinates, phases: Mapping[str, LightPhases], orientation: str, keep_orders: bool = False
) -> ScreenCoordinates:
    """What places_of_light would give if harmonics were left in the phases: to tell what they cost.

    found: what it was given. phases: what it returned.
    """
    axes = {}
    for axis, one in found.axes.items():
        axes[axis] = _moved(
            _with_harmonics(one), found.mask, replace(phases[axis], gamma=LINEAR), orientation, keep_orders
        )
    return ScreenCoordinates(found.mask, axes)
