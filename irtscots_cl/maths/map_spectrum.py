"""Spatial statistics of a height map on a grid: power spectral density and structure function."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray


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


def radial_psd(heights: FloatArray, pitch_mm: tuple[float, float], bins: int = 0) -> RadialPsd:
    """Power spectral density of a map [rows, columns], NaN where invalid, averaged over directions.

    The window is Hann's over the bounding box of the valid pixels, 0 where they are invalid; the window's mean of the
    heights is removed first. bins: default: half the shorter side.
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
    fx, fy = np.fft.fftfreq(columns, pitch_mm[0]), np.fft.fftfreq(rows, pitch_mm[1])
    radius = np.hypot(fx[None, :], fy[:, None]).ravel()
    top = min(0.5 / pitch_mm[0], 0.5 / pitch_mm[1])
    count = bins or max(1, min(rows, columns) // 2)
    index = np.floor(radius / top * count).astype(int)
    inside = (index < count) & (radius > 0)
    samples = np.bincount(index[inside], minlength=count).astype(float)
    sums = np.bincount(index[inside], spectrum.ravel()[inside], count)
    middles = np.bincount(index[inside], radius[inside], count)
    full = samples > 0
    return RadialPsd(
        middles[full] / samples[full], sums[full] / samples[full], samples[full], power / whole
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
