"""Places on the screen from a Gray code, alone or with one number of fringes whose orders it tells.

What a plane's image should be at a place is the design's light, moved there, on the plane's stripes (shown_light): that
holds on the edges of cells as well, and where stripes are finer than a pixel's light. The places are those of the
light's centroids.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

from irtscots_cl.imaging.gray_code import GraySet
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.fringe_frames import ShownFrames, matched, most_alike
from irtscots_cl.measurement.gray_code import GrayShares, candidates, misread, most_likely, read_bits, two_or_more
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates
from irtscots_cl.measurement.shown_light import shown_light
from irtscots_cl.measurement.unwrapping import TAU
from irtscots_cl.optics.setup import Setup

MODEL_ERROR = 0.05  # of a share: how well the design's light tells what a plane shows at a place
ROOM = 0.75  # of the width of a pixel's light: cells of at least that are told by reading bits
PARTS = 4  # of such a cell: places that are compared
ROUNDS = 6  # of Gauss and Newton
STEP_PX = 0.25  # of the screen, for derivatives by differences
HIGHEST_FLOOR = 0.5  # of a share


def plane_values(code: GraySet, setup: Setup) -> FloatArray:
    """What the planes show on the screen's lines: [planes, lines]."""
    count = setup.scene.screen.pixels["xy".index(code.axis)]
    return code.values((np.arange(count) + 0.5) / count)


def fraction_mm(setup: Setup, axis: str, fraction: FloatArray) -> FloatArray:
    """Places in mm on the screen's grid of fractions between its outer edges."""
    k, screen = "xy".index(axis), setup.scene.screen
    place: FloatArray = (fraction - 0.5) * screen.pixels[k] * screen.pitch_xy_mm[k] + screen.centre_offset_mm[k]
    return place


def with_gray_orders(found: ScreenCoordinates, shares: dict[str, GrayShares], setup: Setup) -> ScreenCoordinates:
    """The coordinates of one number of periods for each axis, in the orders that the Gray code and the phase make most
    likely together. shares: by axis, of the pixels of setup.pixel_light."""
    orientation = setup.scene.camera.detector.orientation
    axes = {}
    for axis, one in found.axes.items():
        turns, error = (
            upright(values[0], orientation).ravel()[setup.pixel_light.pixels].astype(float) / TAU
            for values in (one.phase_rad, one.phase_error_rad)
        )
        cell, wrong = _order(shares[axis], turns, setup)
        periods = one.fringes.periods[0]
        rows = [(cell + turns % 1.0) / periods, error / periods, np.where(np.isfinite(turns), wrong, np.nan)]
        maps = [stored(on_grid(row, setup), orientation) for row in rows]
        known = found.mask & np.isfinite(maps[0])
        fraction, standard_error, chance = (np.where(known, values, np.nan) for values in maps)
        axes[axis] = replace(one, fraction=fraction, standard_error=standard_error, wrong=chance)
    return ScreenCoordinates(found.mask, axes)


def _order(shares: GrayShares, turns: FloatArray, setup: Setup) -> tuple[IntArray, FloatArray]:
    """Orders [n] and the probability that they are wrong. turns: [n] phases in turns."""
    code = shares.code
    patterns = plane_values(code, setup)

    def model(cell: IntArray) -> FloatArray:
        place = np.where(cell < 0, np.nan, (cell + turns % 1.0) / code.cells)
        return _shown(setup, code.axis, patterns, fraction_mm(setup, code.axis, place))

    several = two_or_more(misread(shares, MODEL_ERROR))
    return most_likely(shares, candidates(code, read_bits(shares)), model, MODEL_ERROR, several=several)


@dataclass(frozen=True)
class GrayPlaces:
    """Places [n] in mm along an axis of the pixels of setup.pixel_light, their standard errors, and the probability
    that they are wrong by a cell whose bits can be read; NaN where no plane tells anything.

    A standard error holds what the edges within the pixel's light tell, and where there are none the width of the cell.
    gap: [planes, n] of the shares and what the places make of them. floor: error of shares that noise does not explain.
    """

    place_mm: FloatArray
    error_mm: FloatArray
    wrong: FloatArray
    gap: FloatArray
    floor: float


def gray_places(shares: GrayShares, setup: Setup) -> GrayPlaces:
    """The places that a Gray code alone tells."""
    code, k = shares.code, "xy".index(shares.code.axis)
    patterns = plane_values(code, setup)
    width_mm = setup.scene.screen.pixels[k] * setup.scene.screen.pitch_xy_mm[k]
    coarse, planes = _readable(code, setup, width_mm)
    some = GrayShares(coarse, shares.share[:planes], shares.error[:planes], shares.noise)
    cells = candidates(coarse, read_bits(some))
    within = (np.arange(PARTS) + 0.5) / PARTS
    places = np.concatenate([np.where(cells < 0, -1, cells + part) for part in within])

    def model(place: FloatArray) -> FloatArray:
        fraction = np.where(place < 0, np.nan, place / coarse.cells)
        return _shown(setup, code.axis, patterns, fraction_mm(setup, code.axis, fraction))

    several = two_or_more(misread(some, MODEL_ERROR))
    start, wrong = most_likely(shares, places, model, MODEL_ERROR, apart=1.0, several=several)
    lost = (start < 0) | ~np.isfinite(shares.share).any(0)
    place = np.where(lost, np.nan, fraction_mm(setup, code.axis, start / coarse.cells))
    place, slope, gap = _refined(shares, patterns, place, setup, width_mm / coarse.cells)
    floor = _floor(gap, shares.error, place)
    weight = 1 / (np.square(shares.error) + floor**2)
    information = np.nansum(weight * slope**2, axis=0) + 12 / (width_mm / coarse.cells) ** 2
    error = np.where(np.isfinite(place), 1 / np.sqrt(information), np.nan)
    return GrayPlaces(place, error, np.where(lost, 1.0, wrong), gap, floor)


def _readable(code: GraySet, setup: Setup, width_mm: float) -> tuple[GraySet, int]:
    """The code of the planes alone whose cells are wide enough for bits to be read, and their number."""
    k = "xy".index(code.axis)
    half = setup.pixel_light.extent("uv"[k])[1]
    least = ROOM * 2 * float(np.nanmedian(half[np.isfinite(half)]))
    finer = math.ceil(max(math.log2(max(least * code.cells / width_mm, 1.0)), 0.0))
    left_out = min(finer, code.planes - 1)
    return GraySet(code.axis, max(code.cells / 2**left_out, 1 + 1e-9)), code.planes - left_out


def _refined(
    shares: GrayShares, patterns: FloatArray, place: FloatArray, setup: Setup, most_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places [n] of least misfit near the given ones, the shares' slopes there [planes, n] per mm, and the gaps."""
    axis = shares.code.axis
    step = STEP_PX * setup.scene.screen.pitch_xy_mm["xy".index(axis)]
    weight = np.where(np.isfinite(shares.share), 1 / (np.square(shares.error) + MODEL_ERROR**2), 0.0)
    weight = np.nan_to_num(weight)
    start = place
    for k in range(ROUNDS + 1):
        shown = [_shown(setup, axis, patterns, place + d) for d in (-step, 0.0, step)]
        slope = (shown[2] - shown[0]) / (2 * step)
        gap = shares.share - shown[1]
        if k == ROUNDS:
            return place, slope, gap
        # a cell's width holds pixels whose light has no edge in it
        normal = np.nansum(weight * slope**2, axis=0) + 12 / most_mm**2
        change = np.nansum(weight * slope * gap, axis=0) / normal
        place = np.clip(place + np.clip(change, -most_mm / PARTS, most_mm / PARTS), start - most_mm, start + most_mm)
    raise AssertionError


def _floor(gap: FloatArray, error: FloatArray, place: FloatArray) -> float:
    """Error of all shares, beside their own, that makes the median misfit what it should be; 0 where noise does."""
    known = np.isfinite(gap) & np.isfinite(error)
    freedom = known.sum(0) - 1
    fits = (freedom > 0) & np.isfinite(place)
    if not fits.any():
        return 0.0
    expected = chi2.median(freedom[fits])

    def excess(floor: float) -> float:
        with np.errstate(divide="ignore", invalid="ignore"):
            square = np.where(known, gap**2 / (np.square(error) + floor**2), 0.0).sum(0)
        return float(np.median(square[fits] / expected)) - 1.0

    tiny = 1e-6
    if excess(tiny) <= 0:
        return tiny
    return HIGHEST_FLOOR if excess(HIGHEST_FLOOR) > 0 else float(brentq(excess, tiny, HIGHEST_FLOOR, rtol=1e-2))


def gray_frames_shown(
    shares: dict[str, GrayShares], places_mm: list[dict[str, FloatArray]], setup: Setup, used: np.ndarray
) -> ShownFrames:
    """Which plane each plane's shares show, axis by axis. places_mm: by axis [n], of the design and as found; those
    that explain more count. used: [n] pixels to compare."""
    images = np.concatenate([one.share[:, used] for one in shares.values()])
    tried = []
    for places in places_mm:
        shown = [_shown(setup, axis, plane_values(one.code, setup), places[axis]) for axis, one in shares.items()]
        tried.append(np.concatenate([rows[:, used] for rows in shown]))
    return matched(images, most_alike(images, tried))


def _shown(setup: Setup, axis: str, patterns: FloatArray, place_mm: FloatArray) -> FloatArray:
    return shown_light(setup.pixel_light, setup.scene.screen, axis, patterns, place_mm)


def on_grid(values: FloatArray, setup: Setup) -> FloatArray:
    """Values [n] of the pixels of setup.pixel_light on the detector's grid, upright; NaN elsewhere."""
    grid = np.full(math.prod(setup.chief_rays.shape), np.nan)
    grid[setup.pixel_light.pixels] = values
    return grid.reshape(setup.chief_rays.shape)
