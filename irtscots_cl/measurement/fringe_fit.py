"""Fit of one light to all frames of a fringe measurement, and equations of what changed between them.

Noise in M goes with that in Y. Where all pixels see nearly the same phase, little tells the gains, and this bias is
larger than what does, for any number of pixels. For gains the left M is therefore that of the neighbours (an instrument
in the sense of regression): it holds the same light and other noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.fringe_samples import FrameSamples, FringeLight

HARMONIC = 1e-6  # of the largest eigenvalue: directions of harmonics below it are not determined
NULL = 1e-9  # the same of changes


def _shares(shapes: list[FloatArray], left: FloatArray) -> FloatArray:
    """Least squares of what is left [N, n] by shapes [N, n]; 0 for those that are nothing."""
    matrix = np.array([[float((a * b).sum()) for b in shapes] for a in shapes]).reshape(len(shapes), len(shapes))
    right = np.array([float((a * left).sum()) for a in shapes])
    if not shapes or not matrix.any():
        return np.zeros(len(shapes))
    found: FloatArray = np.linalg.pinv(matrix, rcond=HARMONIC, hermitian=True) @ right
    return found


@dataclass(frozen=True)
class FrameFit:
    """Of samples in units of their noise, gains divided out: values, what the light leaves, the harmonics' shares."""

    light: FringeLight
    values: FloatArray
    left: FloatArray
    harmonics: tuple[FloatArray, ...]  # R v / sigma of each that leaves something
    kept: tuple[int, ...]  # their numbers
    square: float

    @classmethod
    def of(cls, light: FringeLight, samples: FrameSamples, sigma: FloatArray, gains: FloatArray) -> FrameFit:
        values = samples.divided(gains).values
        left = light.rest @ values / sigma
        shapes = [light.rest @ shape / sigma for shape in light.harmonics(values)]
        least = 1e-6 * float(np.square(values / sigma).sum())
        kept = tuple(k for k, shape in enumerate(shapes) if np.square(shape).sum() > least)
        shapes = [shapes[k] for k in kept]
        size = _shares(shapes, left)
        for share, shape in zip(size, shapes, strict=True):
            left = left - share * shape
        return cls(light, values, left, tuple(shapes), kept, float(np.square(left).sum()))

    @property
    def freedom(self) -> float:
        return float(self.light.freedom * self.left.shape[1] - len(self.harmonics))

    @property
    def excess(self) -> float:
        return self.square / self.freedom

    def explained(self, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normal equations [K N, K N] and right sides of a change in each frame, harmonics eliminated. shapes: [K, N,
        n] in units of noise, what it adds to each frame."""
        kinds, count, _ = shapes.shape
        rest = self.light.rest
        normal = np.einsum("kfn,lgn,fg->kflg", shapes, shapes, rest, optimize=True).reshape(kinds * count, -1)
        right = np.einsum("kfn,fn->kf", shapes, self.left).ravel()
        if self.harmonics:
            cross = np.stack([np.einsum("kfn,fn->kf", shapes, h).ravel() for h in self.harmonics], -1)
            own = np.array([[float((a * b).sum()) for b in self.harmonics] for a in self.harmonics])
            normal = normal - cross @ np.linalg.pinv(own, rcond=NULL, hermitian=True) @ cross.T
        return normal, right

    def by_instrument(self, samples: FrameSamples, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Equations [N, N] of relative changes of the frames' light, weighted by their neighbours' light, and each
        pixel's part [N, n] of their right sides; harmonics eliminated. samples: gains divided out."""
        rest = self.light.rest
        own, beside = ((self.light.part(part) - samples.dark) / sigma for part in (self.values, samples.around))
        normal, scores = (beside @ own.T) * rest, beside * self.left
        if self.harmonics:
            shapes = list(self.light.harmonics(samples.around))
            theirs = [rest @ shapes[k] / sigma for k in self.kept]
            square = np.array([[float((a * b).sum()) for b in self.harmonics] for a in theirs])
            ours = np.stack([(beside * h).sum(1) for h in self.harmonics], -1)
            by = ours @ np.linalg.pinv(square, rcond=NULL)
            normal = normal - by @ np.stack([(h * own).sum(1) for h in theirs])
            scores = scores - by @ np.stack([(h * self.left).sum(0) for h in theirs])
        return normal, scores
