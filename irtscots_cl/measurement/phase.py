"""Phase of N-step fringes by least squares, for any steps, with its standard error.

Model of a pixel's samples at the steps d_i: offset + cosine cos d_i + sine sin d_i. The amplitude is the length of
(cosine, sine), the phase its angle (Greivenkamp, Opt. Eng. 23, 350 (1984)). For noise that varies as the signal does,
variance = read + gain * signal, the covariance of the three is exact with equal weights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray

MAX_CONDITION = 1e6  # of a pixel's normal equations where samples are missing: beyond, its steps give no phase
BLAS_TASK = 2**18  # multiplications of one matrix product: more, and BLAS starts threads of its own, which wait mostly
FEWEST_AT_ONCE = 256  # pixels of one product
WORD = 64  # bits


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
        # faster than hypot, which guards against numbers beyond 1e150
        return np.asarray(np.sqrt(self.cosine * self.cosine + self.sine * self.sine))

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
        # the covariance's terms that go with 1, cos d and sin d of the samples' variance
        terms = _least_squares(self.steps_rad.tobytes()).terms
        mean = noise.variance(self.offset)
        slopes = (noise.gain * self.cosine, noise.gain * self.sine) if noise.gain else ()
        cc, cs, ss = (
            sum((part * term for part, term in zip(slopes, terms[1:, a, b], strict=False)), mean * terms[0, a, b])
            for a, b in ((0, 0), (0, 1), (1, 1))
        )
        if self.incomplete.size:
            own = mean[self.incomplete]
            for part, a, b in ((cc, 1, 1), (cs, 1, 2), (ss, 2, 2)):
                part[self.incomplete] = own * self.inverse[:, a, b]
        sine2, cosine2 = self.sine * self.sine, self.cosine * self.cosine
        square = cosine2 + sine2
        cc *= sine2
        ss *= cosine2
        cs *= self.sine
        cs *= self.cosine
        cs *= 2
        cc += ss
        cc -= cs
        with np.errstate(divide="ignore", invalid="ignore"):
            error: FloatArray = np.sqrt(np.maximum(cc, 0.0)) / square
        error[square == 0] = np.inf
        return error


@dataclass(frozen=True)
class _LeastSquares:
    """Of N steps: basis [N, 3], the model's columns (1, cos, sin); inverse [3, N], its pseudo-inverse; rest [N - 3, N],
    orthonormal rows that the model leaves nothing of; terms [3, 2, 2] of the covariance of cosine and sine, that go
    with 1, cos d and sin d of the samples' variance."""

    basis: FloatArray
    inverse: FloatArray
    rest: FloatArray
    terms: FloatArray


@lru_cache(maxsize=256)
def _least_squares(steps: bytes) -> _LeastSquares:
    """For steps [N] as the bytes of their float64 array: the same few in every block of pixels."""
    steps_rad = np.frombuffer(steps)
    basis = np.stack([np.ones_like(steps_rad), np.cos(steps_rad), np.sin(steps_rad)], -1)
    inverse = np.linalg.pinv(basis)
    rest = np.ascontiguousarray(np.linalg.qr(basis, mode="complete")[0][:, 3:].T)
    return _LeastSquares(basis, inverse, rest, np.einsum("it,ai,bi->tab", basis, inverse[1:], inverse[1:]))


def fit_sinusoid(samples: NDArray[Any], steps_rad: FloatArray, saturation: float = np.inf) -> SinusoidFit:
    """Fit every pixel of samples [N, n]. Samples at or above `saturation`, and those that are no numbers, are left out.

    Leaving out what is cut off is free of bias where the signal is above the ceiling by more than its noise.
    """
    steps = np.ascontiguousarray(steps_rad, float)
    values = np.asarray(samples, float)
    wrong = _unusable(samples, saturation)
    incomplete = np.flatnonzero(wrong.any(0)) if wrong is not None else np.zeros(0, np.int64)
    if incomplete.size:
        values = values.copy() if values is samples else values
        assert wrong is not None
        values[wrong] = 0.0
    model = _least_squares(steps.tobytes())
    found, square = _fit_whole(values, model)
    count = np.full(values.shape[1], len(steps))
    inverses = np.zeros((0, 3, 3))
    if incomplete.size:
        assert wrong is not None
        used = ~wrong[:, incomplete]
        found[:, incomplete], square[incomplete], inverses = _fit_some(values[:, incomplete], used, model.basis)
        count[incomplete] = used.sum(0)
    return SinusoidFit(found[0], found[1], found[2], square, count, steps, incomplete, inverses, saturation)


def _fit_whole(values: FloatArray, model: _LeastSquares) -> tuple[FloatArray, FloatArray]:
    """Fits [3, n] of values [N, n] and their squared residuals [n]: in pieces that stay in a processor's cache."""
    count = values.shape[1]
    found, square = np.empty((3, count)), np.empty(count)
    step = max(FEWEST_AT_ONCE, BLAS_TASK // model.rest.size) if model.rest.size else max(count, 1)
    for first in range(0, count, step):
        part = slice(first, first + step)
        some = values[:, part]
        np.matmul(model.inverse, some, out=found[:, part])
        left = model.rest @ some
        np.einsum("an,an->n", left, left, out=square[part])
    return found, square


def used_samples(samples: NDArray[Any], fit: SinusoidFit) -> BoolArray:
    """Which samples [N, n] a fit of them uses."""
    wrong = _unusable(samples, fit.saturation)
    return np.ones(samples.shape, bool) if wrong is None else ~wrong


def _unusable(samples: NDArray[Any], saturation: float) -> BoolArray | None:
    """Samples [N, n] that are no measurement; None where all are."""
    if not samples.size:
        return None
    if samples.dtype.kind == "f":
        if samples.max() < saturation and samples.min() > -np.inf:  # not so for what is no number
            return None
        return np.asarray(~((samples < saturation) & (samples > -np.inf)))
    if not np.isfinite(saturation) or samples.max() < saturation:
        return None
    return np.asarray(samples >= math.ceil(saturation))  # compared as whole numbers


def _fit_some(values: FloatArray, used: BoolArray, basis: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fits [3, k], their squared residuals [k] and inverse normal equations [k, 3, 3] of pixels with some samples."""
    inverse = _inverses(used, basis)
    values = np.where(used, values, 0.0)
    found = solved(inverse, basis.T @ values)
    square = np.square(np.where(used, values - basis @ found, 0.0)).sum(0)
    return found, square, inverse


def solved(inverse: FloatArray, right: FloatArray) -> FloatArray:
    """Solutions [3, k] of normal equations of the inverses [k, 3, 3] and right sides [3, k]."""
    a, b, c = right
    return np.stack([inverse[:, k, 0] * a + inverse[:, k, 1] * b + inverse[:, k, 2] * c for k in range(3)])


def _inverses(used: BoolArray, basis: FloatArray) -> FloatArray:
    """Inverse normal equations [k, 3, 3] of pixels with some samples [N, k]; NaN where these give no phase.

    Samples go missing in few ways, since what is saturated lies side by side: each way is inverted once.
    """
    kind: IntArray | slice = slice(None)
    some = used
    if len(used) <= WORD:
        bits = np.zeros(used.shape[1], np.uint64)
        for row in used:
            bits <<= np.uint64(1)
            bits |= row
        _, first, kind = np.unique(bits, return_index=True, return_inverse=True)
        some = used[:, first]
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), 9)
    normal = (some.T.astype(float) @ products).reshape(-1, 3, 3)
    size = np.linalg.eigvalsh(normal)
    good = (some.sum(0) >= 3) & (size[:, 0] * MAX_CONDITION > size[:, 2])
    inverse = np.full(normal.shape, np.nan)
    inverse[good] = np.linalg.inv(normal[good])
    return inverse[kind]
