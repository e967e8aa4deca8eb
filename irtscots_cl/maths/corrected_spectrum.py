"""A map's power spectral density as that of what the instrument saw: its response taken out, with error bars.

At a frequency f the map holds |H(f)|^2 times the mirror's density, and from beyond the grid's highest frequencies what
looks the same on the grid, with the response there. The density beyond is not known: it is taken to go on as the power
law that fits the densities found. Noise is subtracted first.

The error bars are statistical: Gaussian heights, whose spectrum is flat over the width of the window's own. Then
neighbouring samples of the windowed spectrum are correlated as the spectrum C of the window's square says, and the mean
over a ring of n samples has the relative variance 2 / n^2 times the sum of |C|^2 over all pairs of them; the 2 since f
and -f are the same sample.

Source: D. B. Percival, A. T. Walden, Spectral Analysis for Physical Applications (1993), for tapered spectra.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.maths.map_spectrum import PowerSpectrum
from irtscots_cl.system.option_error import OptionError

FLOOR = 0.1  # least response whose density is told
MOST_ALIASED = 0.5  # of the mirror's own density that may come from beyond the grid's frequencies
LOWEST = 2.0  # samples from frequency 0: nearer to it the window mixes in the piston and tilt that were removed
LAGS = 6  # samples of the spectrum over which the window correlates them
FIT_ROUNDS = 4
LEAST_RINGS = 3  # of a power law's fit


@dataclass(frozen=True)
class Aliases:
    """Waves that look the same on the grid: frequency_per_mm and response, both [waves, rows, columns]."""

    frequency_per_mm: FloatArray
    response: FloatArray


@dataclass(frozen=True)
class CorrectedPsd:
    """Of n rings of frequencies, all [n]; densities in mm^4 (mm^2 per (1/mm)^2).

    measured_mm4: of the map. response: root of the mean square of the instrument's over the ring. corrected_mm4: the
    mirror's, and standard_error_mm4, its statistical error; NaN where the response is below the floor somewhere in the
    ring, where more than MOST_ALIASED comes from beyond the grid, and within LOWEST samples of frequency 0. aliased:
    the share from beyond the grid, taken out, of a density that goes on as frequency^-exponent. exponent: NaN where no
    law can be fitted, and nothing is taken out. noise_mm4: of the noise, subtracted; NaN where it is not known, and
    included.
    """

    frequency_per_mm: FloatArray
    measured_mm4: FloatArray
    response: FloatArray
    corrected_mm4: FloatArray
    standard_error_mm4: FloatArray
    aliased: FloatArray
    noise_mm4: FloatArray
    exponent: float


def corrected_psd(
    spectrum: PowerSpectrum, response: FloatArray, aliases: Aliases, noise_mm4: FloatArray | None, floor: float = FLOOR
) -> CorrectedPsd:
    """response, noise_mm4: [rows, columns], at the spectrum's frequencies. Raises ValueError for a map of a single row
    or column, or a floor out of range."""
    if not 0 < floor < 1:
        raise OptionError(f"--floor = {floor}: must be above 0 and below 1")
    if min(spectrum.density_mm4.shape) < 2:
        raise ValueError("a corrected spectrum needs a map of more than one row and column")
    index, count = spectrum.rings()
    inside = index >= 0
    samples = np.bincount(index[inside], minlength=count)
    full = np.flatnonzero(samples)
    frequency = np.hypot(spectrum.frequency_x_per_mm[None, :], spectrum.frequency_y_per_mm[:, None])

    def mean(values: FloatArray) -> FloatArray:
        sums = np.bincount(index[inside], values[inside], count)
        return np.asarray(sums[full] / samples[full])

    power = np.where(inside, np.nan_to_num(response) ** 2, 1.0)
    seen = mean((power >= floor**2).astype(float)) > 1 - 1e-9
    lowest = LOWEST * max(abs(f[1]) for f in (spectrum.frequency_x_per_mm, spectrum.frequency_y_per_mm) if f.size > 1)
    safe = np.maximum(power, floor**2)
    noise = np.zeros(power.shape) if noise_mm4 is None else np.where(inside, np.nan_to_num(noise_mm4), 0.0)
    middles, exponent = mean(frequency), np.nan
    aliased = np.zeros(power.shape)
    relative = _relative_errors(spectrum.window, index, count)[full]
    for _ in range(FIT_ROUNDS):
        shares = mean(aliased)
        corrected = mean((spectrum.density_mm4 - noise) / (safe * (1 + aliased)))
        error = relative * mean(spectrum.density_mm4 / (safe * (1 + aliased)))
        exponent = _exponent(middles, corrected, error, seen & (middles >= lowest))
        aliased = _aliased(frequency, safe, inside, aliases, exponent)
    good = seen & (shares <= MOST_ALIASED) & (middles >= lowest)
    unknown = np.full(full.size, np.nan)
    return CorrectedPsd(
        middles, mean(spectrum.density_mm4), np.sqrt(mean(power)), np.where(good, corrected, np.nan),
        np.where(good, error, np.nan), shares, unknown if noise_mm4 is None else mean(noise), exponent,
    )  # fmt: skip


def _exponent(frequency: FloatArray, density: FloatArray, error: FloatArray, good: BoolArray) -> float:
    """n of the power law frequency^-n through densities, least squares of their logarithms; NaN for too few."""
    usable = good & (density > 0) & (error > 0)
    if np.count_nonzero(usable) < LEAST_RINGS:
        return np.nan
    slope, _ = np.polyfit(np.log(frequency[usable]), np.log(density[usable]), 1, w=(density / error)[usable])
    return -float(slope)


def _aliased(
    frequency: FloatArray, power: FloatArray, inside: BoolArray, aliases: Aliases, exponent: float
) -> FloatArray:
    """Power [rows, columns] that looks the same on the grid over the own, for that power law; 0 for none."""
    if not np.isfinite(exponent):
        return np.zeros(power.shape)
    own = np.where(frequency > 0, frequency, 1.0)
    falls = (np.maximum(aliases.frequency_per_mm, own) / own) ** -exponent
    share = np.sum(np.nan_to_num(aliases.response) ** 2 * falls, axis=0) / power
    return np.where(inside, share, 0.0)


def _relative_errors(window: FloatArray, index: IntArray, count: int) -> FloatArray:
    """Relative standard error [count] of the mean of a spectrum's samples over each ring."""
    square = np.abs(np.fft.fft2(window**2)) ** 2
    square /= square[0, 0]
    rows, columns = window.shape
    pairs = np.zeros(count)
    for down in range(-min(LAGS, (rows - 1) // 2), min(LAGS, (rows - 1) // 2) + 1):
        for across in range(-min(LAGS, (columns - 1) // 2), min(LAGS, (columns - 1) // 2) + 1):
            other = np.roll(index, (down, across), (0, 1))
            both = (index >= 0) & (other == index)
            pairs += square[down, across] * np.bincount(index[both], minlength=count)
    samples = np.maximum(np.bincount(index[index >= 0], minlength=count), 1)
    return np.asarray(np.sqrt(2 * pairs) / samples)
