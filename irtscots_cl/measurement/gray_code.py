"""Cells of a Gray code from images of its planes, with the probability that a bit is misread.

A pixel's share of a plane is where its sample lies between black (0) and white (1). Each bit is read by its share, of
Gaussian noise; for the two values that a bit can have, both as likely beforehand, the probability that the wrong one
was read is 1 / (1 + exp(|2 share - 1| / (2 variance of the share))).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from irtscots_cl.imaging.gray_code import GraySet, from_gray, gray
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.fringe_noise import estimate_noise
from irtscots_cl.measurement.phase import FrameNoise

CLEAR = 0.15  # of a share from 0 or 1: samples there have one light alone, and tell the noise
LEAST_SIGNAL = 5.0  # standard errors of white less black, below which a pixel has no share


@dataclass(frozen=True)
class GrayShares:
    """share, error: [planes, n]; NaN where a sample is missing. noise: of a sample, None where nothing tells it."""

    code: GraySet
    share: FloatArray = field(repr=False)
    error: FloatArray = field(repr=False)
    noise: FrameNoise | None


@dataclass(frozen=True)
class GrayImages:
    """Samples of n pixels, as floating point, NaN where missing.

    planes, inverted: [planes, n], inverted None where not shown. dark, white: [n] means of so many frames, None
    without.
    """

    code: GraySet
    planes: FloatArray = field(repr=False)
    inverted: FloatArray | None = field(repr=False)
    dark: FloatArray | None = field(repr=False)
    white: FloatArray | None = field(repr=False)
    dark_frames: int = 1
    white_frames: int = 1


def gray_noise(images: GrayImages) -> FrameNoise | None:
    """Noise of a sample: from plane and inverted plane, whose sum is the same in all planes; else from samples that are
    plainly black or white, against the means of dark and white. None where it cannot be told."""
    if images.inverted is not None and len(images.planes) > 1:
        total = images.planes + images.inverted
        count = np.isfinite(total).sum(0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.nansum(total, axis=0) / count
        square = np.nansum(np.square(total - mean), axis=0) / 2
        return estimate_noise(square, np.maximum(count - 1, 0), mean / 2)
    if images.dark is None or images.white is None:
        return None
    signal = images.white - images.dark
    square, level = [], []
    with np.errstate(invalid="ignore", divide="ignore"):
        for values in images.planes if images.inverted is None else (*images.planes, *images.inverted):
            share = (values - images.dark) / signal
            for at, mean, frames in ((0.0, images.dark, images.dark_frames), (1.0, images.white, images.white_frames)):
                near = np.abs(share - at) < CLEAR
                square.append(np.square(values - mean)[near] / (1 + 1 / frames))
                level.append(mean[near])
    squares, levels = np.concatenate(square), np.concatenate(level)
    return estimate_noise(squares, np.ones(len(squares)), levels)


def gray_shares(images: GrayImages, noise: FrameNoise | None = None) -> GrayShares:
    """Shares of the planes. noise: of the images; None: from themselves.

    Errors are those of each plane's own samples and of black and white, which all planes share. Raises ValueError
    without inverted planes and without dark and white images: nothing tells black from white.
    """
    noise = noise or gray_noise(images)
    known = noise or FrameNoise(0.0)
    a, b = images.planes, images.inverted
    has_levels = images.dark is not None and images.white is not None
    if b is None and not has_levels:
        raise ValueError("Gray code: no inverted planes: needs a dark and a white image to tell black from white")
    if has_levels:
        assert images.dark is not None and images.white is not None
        signal = images.white - images.dark
        of_dark = known.variance(images.dark) / images.dark_frames
        of_white = known.variance(images.white) / images.white_frames
    else:
        assert b is not None
        least = min(2, len(a))
        signal = np.sort(np.abs(a - b), axis=0)[-least:].mean(0)
        of_dark = of_white = known.variance(np.nanmean(a + b, axis=0) / 2) / least
    with np.errstate(invalid="ignore", divide="ignore"):
        if b is None:
            assert images.dark is not None
            share = (a - images.dark) / signal
            variance = known.variance(a) + np.square(share) * of_white + np.square(1 - share) * of_dark
        else:
            share = 0.5 + (a - b) / (2 * signal)
            variance = (known.variance(a) + known.variance(b)) / 4 + np.square(share - 0.5) * (of_white + of_dark)
        seen = signal > LEAST_SIGNAL * np.sqrt(of_white + of_dark)
        error = np.where(seen, np.sqrt(variance) / signal, np.nan)
    return GrayShares(images.code, np.where(seen, share, np.nan), error, noise)


def noise_of_gaps(images: GrayImages, gap: FloatArray) -> FrameNoise | None:
    """Noise of a sample of single planes, from the gaps [planes, n] between shares and what a fitted place makes of
    them: one degree of freedom of each pixel is the place's. None where there is no freedom."""
    assert images.dark is not None and images.white is not None
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (images.planes - images.dark) / (images.white - images.dark)
    own = 1 + np.square(share) / images.white_frames + np.square(1 - share) / images.dark_frames
    known = np.isfinite(gap)
    count = known.sum(0)
    square = np.where(known, np.square(gap * (images.white - images.dark)) / own, 0.0).sum(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        level = np.where(known, images.planes, 0.0).sum(0) / count
    return estimate_noise(square, np.maximum(count - 1, 0), level)


def read_bits(shares: GrayShares) -> IntArray:
    """The bits [planes, n], 0 where a sample is missing."""
    return (np.nan_to_num(shares.share, nan=0.0) > 0.5).astype(np.int64)


def misread(shares: GrayShares, least_error: float = 0.0) -> FloatArray:
    """Probability [planes, n] that a bit is misread, its share being 0 or 1 but for noise; 1/2 for missing ones.

    least_error: of a share, for what noise does not explain.
    """
    variance = np.square(np.hypot(shares.error, least_error))
    with np.errstate(invalid="ignore", divide="ignore"):
        found = expit(-np.abs(2 * shares.share - 1) / variance / 2)
    return np.where(np.isfinite(found), found, 0.5)


def candidates(code: GraySet, bits: IntArray) -> IntArray:
    """Cells [candidates, n] that bits [planes, n] may mean: their own and those with one bit misread,
    the neighbours among them; -1 where there is no such cell."""
    own = code.number(bits)
    found = [own, *(from_gray(gray(own) ^ (1 << plane)) for plane in range(code.planes))]
    cells = np.stack(found)
    cells[(cells < 0) | (cells >= code.count)] = -1
    for k in range(1, len(cells)):  # each cell once
        cells[k, (cells[:k] == cells[k]).any(0)] = -1
    return cells


def most_likely(
    shares: GrayShares,
    tried: NDArray[Any],
    model: Callable[[NDArray[Any]], FloatArray],
    least_error: float,
    apart: float = 0.5,
    several: FloatArray | float = 0.0,
) -> tuple[NDArray[Any], FloatArray]:
    """Of cells, or places in cells, [candidates, n] the one [n] whose model fits best, and the probability [n] that it
    is wrong: that of all candidates that are at least `apart` from it, and `several` [n], that none of them is right.

    model: of one candidate [n], the shares [planes, n] that it would have. least_error: of the model's shares. tried
    below 0 is no candidate.
    """
    weight = 1 / (np.square(shares.error) + least_error**2)
    weight = np.where(np.isfinite(weight) & np.isfinite(shares.share), weight, 0.0)
    share = np.nan_to_num(shares.share)
    cost = np.empty(tried.shape)
    for k, one in enumerate(tried):
        gap = share - np.nan_to_num(model(one))
        cost[k] = np.where(one < 0, np.inf, (weight * gap**2).sum(0))
    best = np.argmin(cost, axis=0)[None]
    chosen = np.take_along_axis(tried, best, 0)
    with np.errstate(invalid="ignore"):
        chance = np.exp(-(cost - np.take_along_axis(cost, best, 0)) / 2)
    other = np.where(np.abs(tried - chosen) >= apart, chance, 0.0).sum(0) / chance.sum(0)
    lost = (chosen[0] < 0) | ~(weight > 0).any(0)
    wrong = np.minimum(1.0, other + several)
    return chosen[0], np.where(lost, 1.0, wrong)


def two_or_more(chance: FloatArray) -> FloatArray:
    """Probability [n] that two or more of independent events [planes, n] happen."""
    none, one = np.ones(chance.shape[1]), np.zeros(chance.shape[1])
    for plane in chance:
        one = one * (1 - plane) + none * plane
        none = none * (1 - plane)
    total: FloatArray = np.clip(1 - none - one, 0.0, 1.0)
    return total
