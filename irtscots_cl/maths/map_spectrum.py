"""Spatial statistics of a height map on a grid: power spectral density and structure function."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class RadialPsd:
    """Mean over all directions: frequency_per_mm [bins], psd_mm4 [bins] (mm^2 per (1/mm)^2), samples [bins].

    window_share: of the window's area that lies on valid pixels. The sum of psd x the plane of frequencies is the
    map's mean square under the window.
    """

    frequency_per_mm: FloatArray
    psd_mm4: FloatArray
    samples: FloatArray
    window_share: float


@dataclass(frozen=True)
class StructureFunction:
    """Mean square difference of the heights of two pixels: distance_mm [bins], mean_square_mm2 [bins], pairs [bins]."""

    distance_mm: FloatArray
    mean_square_mm2: FloatArray
    pairs: FloatArray


@dataclass(frozen=True)
class PowerSpectrum:
    """Power spectral density of a map under a window.

    density_mm4: [rows, columns] (mm^2 per (1/mm)^2). frequency_x_per_mm: [columns], frequency_y_per_mm: [rows], in the
    order of numpy.fft.fftfreq. window: [rows, columns], 0 where the map is invalid. window_share: see RadialPsd.
    """

    density_mm4: FloatArray
    frequency_x_per_mm: FloatArray
    frequency_y_per_mm: FloatArray
    window: FloatArray
    window_share: float

    def rings(self, bins: int = 0) -> tuple[IntArray, int]:
        """The ring [rows, columns] of frequencies that each is in, -1 for none, and how many there are.

        They are equally wide, up to the lower of the two highest frequencies. bins: default: half the shorter side.
        """
        rows, columns = self.density_mm4.shape
        radius = np.hypot(self.frequency_x_per_mm[None, :], self.frequency_y_per_mm[:, None])
        top = min(_highest(self.frequency_x_per_mm), _highest(self.frequency_y_per_mm))
        count = bins or max(1, min(rows, columns) // 2)
        index = np.floor(radius / top * count).astype(int)
        return np.where((index < count) & (radius > 0), index, -1), count


def _highest(frequencies: FloatArray) -> float:
    """Half the rate of samples whose frequencies are numpy.fft.fftfreq's; of a single sample inf."""
    return float(frequencies.size * abs(frequencies[1]) / 2) if frequencies.size > 1 else np.inf


def windowed_spectrum(heights: FloatArray, pitch_mm: tuple[float, float]) -> PowerSpectrum:
    """Power spectral density of a map [rows, columns], NaN where invalid.

    The window is Hann's over the bounding box of the valid pixels, 0 where they are invalid; the window's mean of the
    heights is removed first.
    """
    part = _boxed(heights)
    rows, columns = part.shape
    window = np.outer(_hann(rows), _hann(columns))
    whole = float((window**2).sum())
    window = np.where(np.isfinite(part), window, 0.0)
    power = float((window**2).sum())
    values = np.where(np.isfinite(part), part, 0.0)
    values = values - float((window * values).sum() / window.sum())
    spectrum = np.abs(np.fft.fft2(values * window)) ** 2 * (pitch_mm[0] * pitch_mm[1] / power)
    fx, fy = (np.asarray(np.fft.fftfreq(n, p), np.float64) for n, p in zip((columns, rows), pitch_mm, strict=True))
    return PowerSpectrum(spectrum, fx, fy, window, power / whole)


def radial_psd(heights: FloatArray, pitch_mm: tuple[float, float], bins: int = 0) -> RadialPsd:
    """Power spectral density of a map [rows, columns], NaN where invalid, averaged over directions.

    Under the window of windowed_spectrum. bins: default: half the shorter side.
    """
    spectrum = windowed_spectrum(heights, pitch_mm)
    index, count = spectrum.rings(bins)
    radius = np.hypot(spectrum.frequency_x_per_mm[None, :], spectrum.frequency_y_per_mm[:, None])
    inside = index >= 0
    samples = np.bincount(index[inside], minlength=count).astype(float)
    sums = np.bincount(index[inside], spectrum.density_mm4[inside], count)
    middles = np.bincount(index[inside], radius[inside], count)
    full = samples > 0
    return RadialPsd(
        middles[full] / samples[full], sums[full] / samples[full], samples[full], spectrum.window_share
    )  # fmt: skip


def _hann(length: int) -> FloatArray:
    """Hann's window at the pixels' middles; a single pixel has 1."""
    window: FloatArray = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    return window


def structure_function(heights: FloatArray, pitch_mm: tuple[float, float], bins: int = 0) -> StructureFunction:
    """Mean of (h(p) - h(q))^2 over all pairs of valid pixels p, q, by their distance. NaN where a height is invalid.

    The sums over pairs are exact, by correlations of the map padded with zeros. bins: default: half the shorter side,
    up to half the longer side of the valid pixels' bounding box.
    """
    part = _boxed(heights)
    rows, columns = part.shape
    good = np.isfinite(part)
    mask = good.astype(float)
    values = np.where(good, part - float(part[good].mean()), 0.0)
    size = (2 * rows, 2 * columns)
    f_mask, f_value, f_square = (np.fft.rfft2(a, size) for a in (mask, values, values**2))
    cross = np.fft.irfft2(2 * (np.conj(f_mask) * f_square).real - 2 * np.abs(f_value) ** 2, size)
    pairs = np.rint(np.fft.irfft2(np.abs(f_mask) ** 2, size))
    dx = np.fft.fftfreq(2 * columns, 1 / (2 * columns)) * pitch_mm[0]
    dy = np.fft.fftfreq(2 * rows, 1 / (2 * rows)) * pitch_mm[1]
    distance = np.hypot(dx[None, :], dy[:, None]).ravel()
    top = max(rows * pitch_mm[1], columns * pitch_mm[0]) / 2
    count = bins or max(1, min(rows, columns) // 2)
    index = np.floor(distance / top * count).astype(int)
    inside = (index < count) & (distance > 0) & (pairs.ravel() > 0)
    number = np.bincount(index[inside], pairs.ravel()[inside], count)
    sums = np.bincount(index[inside], np.maximum(cross.ravel()[inside], 0.0), count)
    places = np.bincount(index[inside], distance[inside] * pairs.ravel()[inside], count)
    full = number > 0
    return StructureFunction(places[full] / number[full], sums[full] / number[full], number[full] / 2)


def _boxed(heights: FloatArray) -> FloatArray:
    """The part of a map that holds its valid pixels. Raises ValueError where none is."""
    good = np.isfinite(heights)
    if not good.any():
        raise ValueError("the map has no valid height")
    rows, columns = np.nonzero(good.any(axis=1))[0], np.nonzero(good.any(axis=0))[0]
    return heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
