"""Places by fringes as those of the light's centroids: the phase of a pixel's light is not that of its centroid.

A pixel's samples have the phase of the Fourier component of its light at p periods. The light is spread by the camera's
aperture and by the pixel, and the screen shows its fringes in steps of its own pixels, at values of so many bits. The
design's light, moved to where the pixel's light was found, gives the difference of the two phases, and how much of the
fringes the light lets through.
Places free of it are means over the light, as those of line scans are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates, places_of_phases
from irtscots_cl.measurement.unwrapping import phase_floor
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.instrument import Screen
from irtscots_cl.system import interruption

AT_ONCE = 2**20  # values of the light on the screen's lines
LEAST = 0.02  # of the light's modulation, below which its phase says nothing
SAMPLE = 8000  # pixels


@dataclass(frozen=True)
class LightPhases:
    """Of fringes' series: difference_rad, the phase of the design's light less that of its centroid; modulation, the
    amplitude over that of a point's light; both [series, rows, columns] upright, or [series, n] of some pixels, NaN
    where the light is not known."""

    difference_rad: FloatArray = field(repr=False)
    modulation: FloatArray = field(repr=False)


def light_phases(
    setup: Setup, fringes: FringeSet, place_mm: FloatArray, levels: int = 0, gamma: float = 1.0
) -> LightPhases:
    """What the design's light makes of fringes, its centroids moved to place_mm [rows, columns] along the axis.

    levels: number of equal steps of the screen's values (255 for 8 bits), 0: any value. gamma: of the screen, for what
    these steps do; what it does to the phases itself is not in the result.
    """
    light, screen = setup.pixel_light, setup.scene.screen
    found = phases_of_light(light, screen, fringes, place_mm.ravel()[light.pixels], levels, gamma)
    grids = (_on_grid(values, light.pixels, place_mm.shape) for values in (found.difference_rad, found.modulation))
    return LightPhases(*grids)


def phases_of_light(
    light: PixelLight, screen: Screen, fringes: FringeSet, centre_mm: FloatArray, levels: int = 0, gamma: float = 1.0
) -> LightPhases:
    """As light_phases, of some pixels' light, its centroids moved to centre_mm [n]: maps [series, n]."""
    k = "xy".index(fringes.axis)
    output, pitch, count = "uv"[k], screen.pitch_xy_mm[k], screen.pixels[k]
    own = light.means(output)[0]
    known = light.valid() & np.isfinite(own) & np.isfinite(centre_mm)
    moved = np.where(known, centre_mm - own, 0.0)
    middle, half = light.extent(output)
    known &= np.isfinite(middle) & np.isfinite(half)
    start_mm = -count * pitch / 2 + screen.centre_offset_mm[k]
    first = np.floor((np.where(known, middle + moved - half, 0.0) - start_mm) / pitch) - 1
    most = int(np.ceil(2 * half[known].max(initial=0.0) / pitch)) + 3
    fractions = fringes.pixel_fractions(count)
    shown = _screen_lines(fringes, fractions, levels, gamma)  # [kinds, series, lines]
    sums = np.zeros((*shown.shape[:2], len(centre_mm)), complex)
    whole = np.zeros(len(centre_mm))
    step = max(1, AT_ONCE // max(len(centre_mm), 1))
    for begin in range(0, most, step):
        interruption.check()
        lines = first[:, None] + begin + np.arange(min(step, most - begin) + 1)
        share = light.light(output, start_mm + pitch * lines - moved[:, None])
        number = lines[:, :-1]
        on_screen = (number >= 0) & (number < count)
        share = np.where(on_screen & known[:, None], share, 0.0)
        number = np.clip(number, 0, count - 1).astype(int)
        whole += share.sum(1)
        for kind, series in np.ndindex(shown.shape[:2]):
            sums[kind, series] += (share * shown[kind, series][number]).sum(1)
    at = ((centre_mm - start_mm) / pitch - 0.5) * (fractions[1] - fractions[0]) + fractions[0]
    turn = np.exp(-2j * math.pi * np.array(fringes.periods)[:, None] * at)
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.where(known & (whole > 0), sums[0] * turn / whole, np.nan)
        difference = np.angle(relative)
        if levels:
            difference = difference + np.angle(sums[2] / sums[1])
    difference *= -1 if fringes.reverse else 1
    difference[~(np.abs(relative) > LEAST)] = np.nan
    return LightPhases(difference, np.abs(relative))


def _screen_lines(fringes: FringeSet, fractions: FloatArray, levels: int, gamma: float) -> FloatArray:
    """What each line of the screen adds to the fringes' Fourier component, complex [kinds, series, lines].

    The component itself; with levels also what least squares make of the emitted values, without and with their steps.
    """
    exact = np.exp(2j * math.pi * np.array(fringes.periods)[:, None] * fractions)
    if not levels:
        return exact[None]
    values = fringes.values(fractions)
    sign = -1 if fringes.reverse else 1
    kinds = [exact]
    for emitted in (values**gamma, (np.rint(values * levels) / levels) ** gamma):
        series, start = [], 0
        for steps in fringes.steps_rad:
            basis = np.stack([np.ones(len(steps)), np.cos(steps), np.sin(steps)], -1)
            _, cosine, sine = np.linalg.pinv(basis) @ emitted[start : start + len(steps)]
            series.append(cosine + 1j * sign * sine)
            start += len(steps)
        kinds.append(np.stack(series))
    return np.stack(kinds)


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
    found: ScreenCoordinates, setup: Setup, levels: int = 0
) -> tuple[ScreenCoordinates, dict[str, LightPhases]]:
    """The same coordinates with the places of the light's centroids; and what the light makes of the fringes, by axis.

    setup: of the design. found: of images as stored, with the detector's pixels. levels: see light_phases.
    phase_rad stays as measured. A pixel whose light is not known keeps its place. One round will do: the
    difference is some um on the screen, and hardly another one that far away.
    """
    axes, phases = {}, {}
    for axis, one in found.axes.items():
        phases[axis] = light_phases(setup, one.fringes, place_mm(one, setup), levels, _gamma(one))
        difference = stored(phases[axis].difference_rad, setup.scene.camera.detector.orientation)
        axes[axis] = _moved(one, found.mask, difference)
    return ScreenCoordinates(found.mask, axes), phases


def _gamma(one: AxisCoordinates) -> float:
    """Of the screen, where the images show one."""
    lowest = int(np.argmin(one.fringes.periods))
    return 1.0 if one.survey.harmonics[lowest] is None else one.survey.second[lowest].gamma


def _moved(one: AxisCoordinates, mask: np.ndarray, difference: FloatArray) -> AxisCoordinates:
    """Places from the phases less the differences, with the floor that they leave."""
    pixels = np.flatnonzero(mask)

    def flat(values: Any) -> FloatArray:
        return np.asarray(values.reshape(len(values), -1)[:, pixels], float)

    phase = flat(one.phase_rad) - np.nan_to_num(flat(difference))
    error = flat(one.phase_error_rad)
    some = slice(None, None, max(1, len(pixels) // SAMPLE))
    floor = phase_floor(phase[:, some], error[:, some], one.fringes.periods)
    places = places_of_phases(one.fringes, phase, error, floor)
    grids = _on_grid(places, pixels, mask.shape)
    survey = replace(one.survey, floor_rad=floor)
    return replace(one, survey=survey, fraction=grids[0], standard_error=grids[1], wrong=grids[2], misfit=grids[3])
