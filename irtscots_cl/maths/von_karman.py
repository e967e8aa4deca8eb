"""Turbulence of von Karman's spectrum: random fields in a plane, with their slopes and their closed forms.

The spectrum is (k^2 + k0^2)^(-11/6) with k0 = 2 pi over the outer scale; for scales far below it, it is Kolmogorov's
(J. W. Hardy, Adaptive Optics for Astronomical Telescopes, 1998, chapter 3). Fields here have variance 1 over the whole
plane.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import fftfreq, ifft2
from scipy.special import gamma, kv

from irtscots_cl.maths.arrays import FloatArray

ORDER = 5 / 6  # of the Bessel function in the covariance
PHASE_VARIANCE = gamma(11 / 6) * gamma(5 / 6) / (2 * np.pi ** (8 / 3)) * (24 / 5 * gamma(6 / 5)) ** (5 / 6)  # 0.0863


def phase_rms(fried_mm: float, outer_scale_mm: float) -> float:
    """Standard deviation in rad of the phase of a wave with Fried's parameter r0: 0.294 (L0 / r0)^(5/6)."""
    return float(np.sqrt(PHASE_VARIANCE) * (outer_scale_mm / fried_mm) ** ORDER)


def structure_function(distance_mm: ArrayLike, outer_scale_mm: float) -> FloatArray:
    """Mean square [...] of the difference of a field of variance 1 at two points."""
    x = np.maximum(2 * np.pi * np.asarray(distance_mm, float) / outer_scale_mm, 1e-9)
    found: FloatArray = 2 * (1 - 2 ** (1 - ORDER) / gamma(ORDER) * x**ORDER * kv(ORDER, x))
    return found


def spectrum(wave_rad_per_mm: ArrayLike, outer_scale_mm: float) -> FloatArray:
    """Density [...] in mm^2 of the variance over the plane of wave vectors: its integral is 1."""
    lowest = 2 * np.pi / outer_scale_mm
    k = np.asarray(wave_rad_per_mm, float)
    found: FloatArray = ORDER / np.pi * lowest ** (2 * ORDER) * (k**2 + lowest**2) ** (-ORDER - 1)
    return found


def waves(
    numbers: NDArray[np.complex128], step_mm: float, outer_scale_mm: float, smooth_mm: float = 0.0
) -> tuple[NDArray[np.complex128], FloatArray]:
    """Waves [size, size] of two independent periodic fields on a grid, and their wave numbers [size] along an axis.

    numbers: [size, size] complex, each part standard normal. smooth_mm: standard deviation along each axis of the
    Gaussian over which the fields are averaged.
    """
    amplitude, k = _amplitude(len(numbers), step_mm, outer_scale_mm, smooth_mm)
    return numbers * amplitude, k


@lru_cache(maxsize=1)
def _amplitude(size: int, step_mm: float, outer_scale_mm: float, smooth_mm: float) -> tuple[FloatArray, FloatArray]:
    """Factor [size, size] on the random numbers of waves, and wave numbers [size]: the same in all draws."""
    k = 2 * np.pi * fftfreq(size, step_mm)
    square = k[:, None] ** 2 + k**2
    density = spectrum(np.sqrt(square), outer_scale_mm) * (2 * np.pi / (size * step_mm)) ** 2
    density[0, 0] = 0.0  # the mean
    amplitude = np.sqrt(density) * np.exp(-square * smooth_mm**2 / 2) * size**2  # ifft2 divides by size^2
    for array in (amplitude, k):
        array.setflags(write=False)
    return amplitude, k


def fields(
    numbers: NDArray[np.complex128], step_mm: float, outer_scale_mm: float, smooth_mm: float = 0.0
) -> FloatArray:
    """Two independent fields [2, size, size], y before x; arguments as of waves."""
    found = ifft2(waves(numbers, step_mm, outer_scale_mm, smooth_mm)[0])
    return np.stack([found.real, found.imag])


def slopes(
    numbers: NDArray[np.complex128], step_mm: float, outer_scale_mm: float, smooth_mm: float = 0.0
) -> FloatArray:
    """Derivatives [2, size, size, 2] of the same fields, by x and by y, per mm."""
    parts, k = waves(numbers, step_mm, outer_scale_mm, smooth_mm)
    both = [ifft2(1j * k * parts), ifft2(1j * k[:, None] * parts)]
    return np.stack([np.stack([one.real for one in both], -1), np.stack([one.imag for one in both], -1)])
