"""Phase of N-step fringes by least squares, for any steps, with its standard error.

Model of a pixel's samples at the steps d_i: offset + cosine cos d_i + sine sin d_i. The amplitude is the length of
(cosine, sine), the phase its angle (Greivenkamp, Opt. Eng. 23, 350 (1984)). For noise that varies as the signal does,
variance = read + gain * signal, the covariance of the three is exact with equal weights.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray

MAX_CONDITION = 1e6  # of a pixel's normal equations where samples are missing: beyond, its steps give no phase


@dataclass(frozen=True)
class FrameNoise:
    """Variance of a sample: read + gain * signal, the signal counted from 0. In the images' unit squared."""

    read: float
    gain: float = 0.0

    def variance(self, signal: FloatArray) -> FloatArray:
        """Variance of samples with this mean."""
        return self.read + self.gain * np.maximum(signal, 0.0)


@dataclass(frozen=True)
class SinusoidFit:
    """Least-squares fits of n pixels to one series of N steps.

    offset, cosine, sine: [n], NaN where fewer than three steps, or no three different ones, are left. square: [n] sum
    of the squared residuals. samples: [n] those used. steps_rad: [N]. incomplete: [k] pixels that lack samples, with
    the inverse [k, 3, 3] of their normal equations. saturation: at which samples were left out.
    """

    offset: FloatArray
    cosine: FloatArray
    sine: FloatArray
    square: FloatArray
    samples: IntArray
    steps_rad: FloatArray
    incomplete: IntArray = field(repr=False)
    inverse: FloatArray = field(repr=False)
    saturation: float = np.inf

    @property
    def amplitude(self) -> FloatArray:
        return np.hypot(self.cosine, self.sine)

    @property
    def phase_rad(self) -> FloatArray:
        """Phase from -pi to pi."""
        return np.arctan2(self.sine, self.cosine)

    @property
    def freedom(self) -> IntArray:
        """Samples beyond the three parameters: what the residual can tell the noise from."""
        return np.maximum(self.samples - 3, 0)

    @property
    def residual_rms(self) -> FloatArray:
        """Root of square / freedom; NaN without freedom."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(np.where(self.freedom > 0, self.square / self.freedom, np.nan))

    def phase_error_rad(self, noise: FrameNoise) -> FloatArray:
        """Standard error [n] of the phase, to first order in noise / amplitude; infinite without amplitude."""
        basis, inverse = _basis(self.steps_rad)
        # the covariance's terms that go with 1, cos d and sin d of the samples' variance
        terms = np.einsum("it,ai,bi->tab", basis, inverse[1:], inverse[1:])
        mean = noise.variance(self.offset)
        parts = (mean, noise.gain * self.cosine, noise.gain * self.sine)
        cc, cs, ss = (
            sum(p * t for p, t in zip(parts, terms[:, a, b], strict=True)) for a, b in ((0, 0), (0, 1), (1, 1))
        )
        if self.incomplete.size:
            own = mean[self.incomplete]
            for part, a, b in ((cc, 1, 1), (cs, 1, 2), (ss, 2, 2)):
                part[self.incomplete] = own * self.inverse[:, a, b]
        square = self.cosine**2 + self.sine**2
        variance = (self.sine**2 * cc - 2 * self.sine * self.cosine * cs + self.cosine**2 * ss) / np.maximum(
            square, np.finfo(float).tiny
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                square > 0, np.sqrt(np.maximum(variance, 0.0) / square), np.where(square == 0, np.inf, np.nan)
            )


def _basis(steps_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The model's columns [N, 3] (1, cos, sin) and their pseudo-inverse [3, N]."""
    basis = np.stack([np.ones_like(steps_rad), np.cos(steps_rad), np.sin(steps_rad)], -1)
    return basis, np.linalg.pinv(basis)


def fit_sinusoid(samples: NDArray[Any], steps_rad: FloatArray, saturation: float = np.inf) -> SinusoidFit:
    """Fit every pixel of samples [N, n]. Samples at or above `saturation`, and those that are no numbers, are left out.

    Leaving out what is cut off is free of bias where the signal is above the ceiling by more than its noise.
    """
    steps = np.asarray(steps_rad, float)
    values = np.asarray(samples, float)
    basis, inverse = _basis(steps)
    wrong = _unusable(samples, saturation)
    incomplete = np.flatnonzero(wrong.any(0)) if wrong is not None else np.zeros(0, np.int64)
    if incomplete.size:
        values = values.copy() if values is samples else values
        assert wrong is not None
        values[wrong] = 0.0
    found = inverse @ values
    square = np.square(values - basis @ found).sum(0)
    count = np.full(values.shape[1], len(steps))
    inverses = np.zeros((0, 3, 3))
    if incomplete.size:
        assert wrong is not None
        used = ~wrong[:, incomplete]
        found[:, incomplete], square[incomplete], inverses = _fit_some(values[:, incomplete], used, basis)
        count[incomplete] = used.sum(0)
    return SinusoidFit(found[0], found[1], found[2], square, count, steps, incomplete, inverses, saturation)


def used_samples(samples: NDArray[Any], fit: SinusoidFit) -> BoolArray:
    """Which samples [N, n] a fit of them uses."""
    wrong = _unusable(samples, fit.saturation)
    return np.ones(samples.shape, bool) if wrong is None else ~wrong


def _unusable(samples: NDArray[Any], saturation: float) -> BoolArray | None:
    """Samples [N, n] that are no measurement; None where all are."""
    if samples.dtype.kind == "f":
        wrong = ~(samples < saturation) | ~np.isfinite(samples)
        return wrong if wrong.any() else None
    if not np.isfinite(saturation) or not samples.size or samples.max() < saturation:
        return None
    return np.asarray(samples >= saturation)


def _fit_some(values: FloatArray, used: BoolArray, basis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fits [3, k], their squared residuals [k] and inverse normal equations [k, 3, 3] of pixels with some samples."""
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), 9)
    normal = (used.T.astype(float) @ products).reshape(-1, 3, 3)
    size = np.linalg.eigvalsh(normal)
    good = (used.sum(0) >= 3) & (size[:, 0] * MAX_CONDITION > size[:, 2])
    inverse = np.full(normal.shape, np.nan)
    inverse[good] = np.linalg.inv(normal[good])
    found = np.einsum("kab,bk->ak", inverse, basis.T @ (values * used))
    square = np.square((values - basis @ found) * used).sum(0)
    return found, square, inverse
