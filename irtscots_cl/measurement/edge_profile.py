"""The edge of a bright area in a picture, to fractions of a pixel: what pixels near it record, and where it is.

A pixel counts the light of its whole square. Of a straight edge it has the share of its area on the bright side: over
the distance from the edge, a ramp as wide as the square seen along the edge. The lens spreads it, here by a Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray

LEAST_WIDTH = 0.02  # pixels, of a square seen along its side: thinner ones lose digits
BLUR = 0.05, 4.0  # pixels: least and most
ROUNDS = 12
STEP = 0.7  # pixels: most that an edge moves in a round
SETTLED = 1e-4  # pixels
FREEDOM = 12  # pixels of a piece beyond its unknowns, for a noise that is known
UNKNOWNS = 5  # of a piece


def edge_share(distance: FloatArray, normal: FloatArray, blur: float = 0.0) -> FloatArray:
    """Share of pixels' light that is from the bright side of straight edges.

    distance: [...] pixels from the edge to the pixels' middle, above 0 on the bright side. normal: [..., 2] (row,
    column) unit vectors across the edges. blur: standard deviation of the lens's spread in pixels.
    """
    return _share(distance, normal, max(blur, 1e-3))[0]


def _share(distance: FloatArray, normal: FloatArray, blur: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The share and its derivatives by the distance and by the blur."""
    wide, high = (np.maximum(np.abs(normal[..., k]), LEAST_WIDTH) for k in (0, 1))
    share, by_distance, by_blur = (np.zeros(np.broadcast_shapes(distance.shape, wide.shape)) for _ in range(3))
    for sign, shift in ((1, wide + high), (-1, wide - high), (-1, high - wide), (1, -wide - high)):
        t = distance + shift / 2
        below = ndtr(t / blur)
        bell = np.exp(-0.5 * (t / blur) ** 2) / np.sqrt(2 * np.pi)
        share += sign * ((t * t + blur * blur) * below + t * blur * bell) / 2
        by_distance += sign * (t * below + blur * bell)
        by_blur += sign * blur * below
    area = wide * high
    return share / area, by_distance / area, by_blur / area


@dataclass(frozen=True)
class EdgePieces:
    """Pieces of an edge, one value each [n].

    offset: pixels from the expected edge to the one found, towards the dark side. error: its standard error, from the
    noise of the piece's own pixels. height: brightness behind the edge less that before it. noise: rms of the pixels
    from the fit. known: pieces with enough pixels in the picture; the others are NaN. blur: pixels, of all pieces.
    """

    offset: FloatArray = field(repr=False)
    error: FloatArray = field(repr=False)
    height: FloatArray = field(repr=False)
    noise: FloatArray = field(repr=False)
    known: BoolArray = field(repr=False)
    blur: float


@dataclass(frozen=True)
class EdgePixels:
    """Pixels near an edge, [m] each: signal, the piece that they belong to, distance from the expected edge (above 0 on
    the bright side), place along the piece, from -1 to 1, and normal [m, 2]."""

    signal: FloatArray = field(repr=False)
    piece: IntArray = field(repr=False)
    distance: FloatArray = field(repr=False)
    along: FloatArray = field(repr=False)
    normal: FloatArray = field(repr=False)


def fit_edges(pixels: EdgePixels, count: int, blur: float = 0.5) -> EdgePieces:
    """The edge in each of `count` pieces, by least squares; the blur is that of all together.

    A piece's pixels have a level before the edge, and one behind it with slopes across and along. Pieces with too few
    pixels are not known.
    """
    order = np.argsort(pixels.piece, kind="stable")
    sizes = np.bincount(pixels.piece, minlength=count)
    known = sizes >= UNKNOWNS + FREEDOM
    width = int(sizes.max(initial=0))
    if not known.any():
        nothing = np.full(count, np.nan)
        return EdgePieces(nothing, nothing, nothing, nothing, known, blur)
    slot = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    weight = np.zeros((count, width))
    weight[pixels.piece[order], slot] = 1.0

    def table(values: FloatArray) -> FloatArray:
        found = np.zeros((count, width, *values.shape[1:]))
        found[pixels.piece[order], slot] = values[order]
        return found[known]

    weight = weight[known]
    signal, distance, along, normal = map(table, (pixels.signal, pixels.distance, pixels.along, pixels.normal))
    offset = np.zeros(len(signal))
    for turn in range(ROUNDS):
        linear, step, by_blur = _round(signal, distance + offset[:, None], along, normal, blur, weight)
        if turn == ROUNDS - 1 or (np.abs(step).max() < SETTLED and abs(by_blur) < SETTLED):
            break
        offset = offset + np.clip(step, -STEP, STEP)
        blur = float(np.clip(blur + np.clip(by_blur, -STEP, STEP), *BLUR))
    variance = linear.misfit / (weight.sum(1) - UNKNOWNS)
    maps = np.full((4, count), np.nan)
    maps[:, known] = offset, np.sqrt(variance * linear.inverse), linear.height, np.sqrt(variance)
    return EdgePieces(maps[0], maps[1], maps[2], maps[3], known, blur)


@dataclass(frozen=True)
class _Linear:
    height: FloatArray
    misfit: FloatArray  # sum of squares
    inverse: FloatArray  # of the normal matrix: the offset's own element


def _round(
    signal: FloatArray, distance: FloatArray, along: FloatArray, normal: FloatArray, blur: float, weight: FloatArray
) -> tuple[_Linear, FloatArray, float]:
    """The levels at the present offsets and blur, the step of each offset, and that of the blur."""
    share, by_distance, by_blur = _share(distance, normal, blur)
    depth = np.maximum(distance, 0.0)
    columns = np.stack([np.ones_like(share), share, share * depth, share * along], -1) * weight[..., None]
    levels = (np.linalg.pinv(columns) @ signal[..., None])[..., 0]
    behind = levels[:, 1:2] + levels[:, 2:3] * depth + levels[:, 3:4] * along
    left = (signal - (columns @ levels[..., None])[..., 0]) * weight
    whole = np.concatenate([columns, (behind * by_distance * weight)[..., None]], -1)
    step = np.linalg.pinv(whole) @ left[..., None]
    inverse = np.linalg.pinv(np.swapaxes(whole, -1, -2) @ whole, hermitian=True)[:, -1, -1]
    # the blur's column, without what the piece's own unknowns explain of it
    spread = (behind * by_blur * weight)[..., None]
    spread = (spread - whole @ (np.linalg.pinv(whole) @ spread))[..., 0]
    quiet = np.median((left**2).sum(1)) * 4  # pieces with something else in them do not count
    good = (left**2).sum(1) <= quiet
    top, bottom = (spread * left)[good].sum(), (spread * spread)[good].sum()
    misfit = (left**2).sum(1)
    return _Linear(levels[:, 1], misfit, inverse), step[:, -1, 0], float(top / max(bottom, 1e-300))
