"""A measured map's power spectral density as the mirror's: what the transfer function took from it, put back."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.corrected_spectrum import FLOOR, Aliases, CorrectedPsd, corrected_psd
from irtscots_cl.maths.integration.rule_symbols import noise_symbol
from irtscots_cl.maths.low_order import TERMS, remove_terms
from irtscots_cl.maths.map_spectrum import windowed_spectrum
from irtscots_cl.measurement.prediction import SHARPENED
from irtscots_cl.measurement.transfer_function import TransferFunction

NEIGHBOURS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]  # periods of the grid's frequencies
REMOVED = "piston_tilt"
LEAK = 0.1  # of a ring's density: more of it from low orders is told
FIRST_RINGS = 4  # of frequencies: the window spreads low orders over them
PLACES = 4  # pixels over the mirror whose responses are averaged, of small maps
MOST_WAVES = 2**17  # of maps that count as small


@dataclass(frozen=True)
class MeasuredMap:
    """A map [rows, columns] in mm, NaN where invalid, its grid, and the noise of what it was made of.

    column_mm, row_mm: (x, y) on the mirror from a sample to the next. own_grid: whether the samples are the camera's
    pixels: then the response is taken by the turn from pixel to pixel, which hardly changes over the mirror.
    height_error_mm, slope_errors: rms of the standard errors of heights and slopes; NaN where unknown.
    """

    heights_mm: FloatArray = field(repr=False)
    column_mm: tuple[float, float]
    row_mm: tuple[float, float]
    own_grid: bool = False
    height_error_mm: float = math.nan
    slope_errors: tuple[float, float] = (math.nan, math.nan)

    def left(self, removed: str) -> FloatArray:
        """The heights [rows, columns] in mm without the low-order terms `removed`, one of low_order.TERMS."""
        rows, columns = self.heights_mm.shape
        column, row = np.meshgrid(np.arange(columns), np.arange(rows))
        x, y = (column * self.column_mm[k] + row * self.row_mm[k] for k in range(2))
        return remove_terms(x, y, self.heights_mm, np.isfinite(self.heights_mm), removed)

    @property
    def pitch_mm(self) -> tuple[float, float]:
        """The distances of the columns and of the rows."""
        return math.hypot(*self.column_mm), math.hypot(*self.row_mm)


@dataclass(frozen=True)
class WindowLeak:
    """What power and astigmatism of a map put into its spectrum at higher frequencies: the window is cut at the rim.

    low_mm: their rms in mm. leaked: how many of the `rings` of frequencies have more than LEAK of their density from
    them, beyond the FIRST_RINGS that they are in themselves.
    """

    low_mm: float
    leaked: int
    rings: int


def window_leak(measured: MeasuredMap, removed: str = REMOVED) -> WindowLeak:
    """The leak of the low orders that are left where the terms `removed`, of low_order.TERMS, are taken out."""
    left = measured.left(removed)
    low = left - measured.left(TERMS[-1])
    whole, part = (windowed_spectrum(heights, measured.pitch_mm) for heights in (left, low))
    index, count = whole.rings()
    inside = index >= FIRST_RINGS
    of_all, of_low = (np.bincount(index[inside], one.density_mm4[inside], count) for one in (whole, part))
    return WindowLeak(float(np.sqrt(np.nanmean(low**2))), int(np.sum(of_low > LEAK * of_all)), count)


def mirror_psd(
    transfer: TransferFunction, measured: MeasuredMap, floor: float = FLOOR, removed: str = REMOVED
) -> CorrectedPsd:
    """The mirror's power spectral density from a measured map's, the terms `removed`, of low_order.TERMS, taken out.

    The sampling by lines counts as its mean over the light's places. Raises ValueError for a map without a valid
    height, or a floor that is not between 0 and 1.
    """
    transfer = replace(transfer, lines_averaged=True)
    grid = np.stack([measured.column_mm, measured.row_mm])  # [2, xy]
    pitch = measured.pitch_mm
    spectrum = windowed_spectrum(measured.left(removed), pitch)
    turns = (
        2
        * np.pi
        * np.stack(np.meshgrid(spectrum.frequency_x_per_mm * pitch[0], spectrum.frequency_y_per_mm * pitch[1]), -1)
    )
    waves = [turns + 2 * np.pi * np.array(shift) for shift in [(0, 0), *NEIGHBOURS]]
    k = np.stack(waves) @ np.linalg.inv(grid).T  # [1 + aliases, rows, columns, xy]
    responses = _rms_response(transfer, measured, grid, k)
    aliases = Aliases(np.linalg.norm(k[1:], axis=-1) / (2 * np.pi), responses[1:])
    noise = _noise(transfer, measured, grid, turns) if _noise_known(measured) else None
    return corrected_psd(spectrum, responses[0], aliases, noise, floor)


def _noise_known(measured: MeasuredMap) -> bool:
    return math.isfinite(measured.height_error_mm) or all(map(math.isfinite, measured.slope_errors))


def _rms_response(
    transfer: TransferFunction, measured: MeasuredMap, grid: FloatArray, k_per_mm: FloatArray
) -> FloatArray:
    """Root of the mean square, over the mirror, of the height's response to waves k [..., 2]."""
    few = k_per_mm[0, ..., 0].size > MOST_WAVES
    numbers = transfer.nearest() if few else transfer.pixels(PLACES)[:: max(1, transfer.pixels(PLACES).size // PLACES)]
    square = np.zeros(k_per_mm.shape[:-1])
    geometry = transfer.geometry(numbers)
    for n in range(len(numbers)):
        one = geometry.part(slice(n, n + 1))
        size = math.sqrt(abs(np.linalg.det(one.pixel[0]) / np.linalg.det(grid))) if measured.own_grid else 1.0
        for square_of, waves in zip(square, k_per_mm / size, strict=True):
            found = transfer.response(one, waves.reshape(-1, 2)).height[0]
            square_of += found.reshape(square_of.shape) ** 2 / len(numbers)
    return np.sqrt(square)


def _noise(transfer: TransferFunction, measured: MeasuredMap, grid: FloatArray, turns: FloatArray) -> FloatArray:
    """Density [rows, columns] in mm^4 of the noise: white in the slopes, integrated."""
    how = transfer.how
    known = all(map(math.isfinite, measured.slope_errors))
    sharpened = 1.0 if how.pixel_average else SHARPENED
    slopes = np.array(measured.slope_errors) / sharpened if known else np.ones(2)
    rises = np.hypot(grid[:, 0] * slopes[0], grid[:, 1] * slopes[1])
    density = noise_symbol(how.method, turns, rises) * abs(float(np.linalg.det(grid)))
    if not how.pixel_average:
        density = density * (1 + np.sum(1 - np.cos(turns), -1) / 12) ** 2
    if known:
        return np.asarray(density)
    rows, columns = density.shape
    cell = 1 / (rows * columns * abs(float(np.linalg.det(grid))))
    variance = float(np.nansum(density)) * cell  # that of frequency 0 is NaN: a piston
    return np.asarray(density * (measured.height_error_mm**2 / variance))
