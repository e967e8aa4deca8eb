"""Samples of the frames of a fringe measurement in some pixels, and what light of one place makes of all frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import binary_dilation

from irtscots_cl.imaging.fringes import FringeStack
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.system import interruption

SAMPLE = 4000  # pixels
RIM = 2  # pixels around the mirror that count: motion shows there
TINY = 1e-3  # of the samples' range
SINGULAR = 1e-6  # of the largest singular value
HARMONICS = (2, 3)  # that a screen's gamma adds, and that are no change between frames
BEYOND = 0.25  # of the fringes' swing: noise hardly makes a sample brighter than white by so much


@dataclass(frozen=True)
class FrameSamples:
    """values, around, along_x, along_y: [N, n] samples, means of their four neighbours, half differences of them; dark,
    column, row: [n]; inside: [n] on the mirror. at_zero, white, black: as FrameFactors.at_zero, white, dark."""

    values: FloatArray
    around: FloatArray
    along_x: FloatArray
    along_y: FloatArray
    dark: FloatArray
    column: FloatArray
    row: FloatArray
    inside: BoolArray
    at_zero: FloatArray
    white: float
    black: float

    def divided(self, gains: FloatArray) -> FrameSamples:
        """With the light of the frames divided by gains [N]."""
        by = gains[:, None]
        values, around = (self.dark + (part - self.dark) / by for part in (self.values, self.around))
        return replace(self, values=values, around=around, along_x=self.along_x / by, along_y=self.along_y / by)

    @property
    def mean_light(self) -> float:
        """Of the screen, in counts; at least a little."""
        return max(float(np.mean(self.values.mean(0) - self.dark)), TINY * float(np.ptp(self.values)), 1e-30)


@dataclass(frozen=True)
class FringeLight:
    """ends: of the series. basis: [N, P] of what light of one place makes of the frames; rest: [N, N] what that leaves
    of samples; rest_noise: the same without what harmonics of a gamma leave, where the steps have room for them."""

    steps: tuple[FloatArray, ...]
    ends: IntArray
    basis: FloatArray
    rest: FloatArray
    rest_noise: FloatArray

    @classmethod
    def of(cls, steps: Sequence[FloatArray]) -> FringeLight:
        ends = np.cumsum([0, *map(len, steps)])
        basis = np.zeros((ends[-1], 1 + 2 * len(steps)))
        basis[:, 0] = 1.0
        for k, (own, (start, end)) in enumerate(zip(steps, pairwise(ends), strict=True)):
            basis[start:end, 1 + 2 * k], basis[start:end, 2 + 2 * k] = np.cos(own), np.sin(own)
        higher = [basis]
        for own, (start, end) in zip(steps, pairwise(ends), strict=True):
            for order in HARMONICS:
                if order % len(own):  # three steps take the third harmonic for the offset
                    columns = np.zeros((len(basis), 2))
                    columns[start:end] = np.stack([np.cos(order * own), np.sin(order * own)], -1)
                    higher.append(columns)
        return cls(tuple(steps), ends, basis, _complement(basis), _complement(np.concatenate(higher, 1)))

    @property
    def freedom(self) -> int:
        count, parameters = self.basis.shape
        return int(count - parameters)

    def part(self, values: FloatArray) -> FloatArray:
        """What of values [N, n] the light explains."""
        return values - self.rest @ values

    def harmonics(self, values: FloatArray) -> Iterator[FloatArray]:
        """Samples [N, n] of each series' harmonics, of amplitude 1 of the first."""
        found = np.linalg.pinv(self.basis) @ values
        for k, (own, (start, end)) in enumerate(zip(self.steps, pairwise(self.ends), strict=True)):
            cosine, sine = found[1 + 2 * k : 3 + 2 * k]
            phase, amplitude = np.arctan2(sine, cosine), np.hypot(cosine, sine)
            for order in HARMONICS:
                shape = np.zeros_like(values)
                shape[start:end] = amplitude * np.cos(order * (phase - own[:, None]))
                yield shape


def _complement(basis: FloatArray) -> FloatArray:
    """Projector [N, N] on what columns [N, P] leave."""
    left, size, _ = np.linalg.svd(basis, full_matrices=False)
    kept = left[:, size > SINGULAR * size[0]]
    rest: FloatArray = np.eye(len(basis)) - kept @ kept.T
    return rest


def frame_samples(stack: FringeStack, mask: BoolArray) -> FrameSamples:
    """Complete pixels on the mirror and around its rim, without those at the images' edges."""
    near = binary_dilation(mask, iterations=RIM)
    near[[0, -1]] = near[:, [0, -1]] = False
    pixels = np.flatnonzero(near)
    pixels = pixels[:: max(1, len(pixels) // SAMPLE)]
    columns, inside = stack.shape[1], mask.ravel()[pixels]
    rows, zero, complete = [], [], np.ones(len(pixels), bool)
    most, least = np.full(len(pixels), -np.inf), np.full(len(pixels), np.inf)
    for number in range(len(stack.sets)):
        for _, _, images in stack.series(number):
            interruption.check()
            for image in images:
                flat = image.ravel()
                around = [np.asarray(flat[pixels + step], float) for step in (0, 1, -1, columns, -columns)]
                for values in around:
                    complete &= np.isfinite(values) & (values < stack.saturation)
                mean = sum(around[1:]) / 4
                rows.append((around[0], mean, (around[1] - around[2]) / 2, (around[3] - around[4]) / 2))
                zero.append(np.mean(around[0][inside] <= 0) if image.dtype.kind in "iu" and inside.any() else 0.0)
                most, least = np.fmax(most, around[0]), np.fmin(least, around[0])
    dark = np.zeros(len(pixels)) if stack.dark is None else np.asarray(stack.dark, float).ravel()[pixels]
    row, column = np.divmod(pixels, columns)
    values, beside, along_x, along_y = (np.stack(part)[:, complete] for part in zip(*rows, strict=True))
    clear = inside & (most < stack.saturation) & np.isfinite(most)
    swing = most - least
    white = 0.0 if stack.white is None else _share(clear, np.asarray(stack.white, float).ravel()[pixels] - most, swing)
    black = 0.0 if stack.dark is None else _share(clear, least - dark, swing)
    place = column[complete].astype(float), row[complete].astype(float)
    return FrameSamples(
        values, beside, along_x, along_y, dark[complete], *place, inside[complete], np.array(zero), white, black
    )


def _share(clear: BoolArray, margin: FloatArray, swing: FloatArray) -> float:
    """Share of the pixels where a margin is below zero by more than part of the fringes' swing."""
    return float(np.mean((margin < -BEYOND * swing)[clear])) if clear.any() else 0.0
