"""The probability of wrong fringe orders before there are images.

Between the right orders and others lies a distance D in the phases, in their standard errors; the others look better
with the probability Q(D / 2), Q the upper tail of the normal distribution. All that are near are summed up: an upper
bound, and nearly exact where it is small. Those compared are the ones that unwrapping.unwrap compares: a place on the
screen for each order of the highest number of periods, with the orders of the others next to it.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.special import ndtr

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.unwrapping import MARGIN

NEAREST = 40  # other sets of orders that are summed over
TAU = 2 * np.pi


def wrong_orders(periods: tuple[float, ...], errors_rad: FloatArray, fraction: FloatArray) -> FloatArray:
    """Probability [n] that the most likely orders are wrong, of pixels that see the places `fraction` [n].

    errors_rad: [series, n] standard errors of the phases. periods: of the series, over the screen.
    """
    order = np.argsort(periods)
    p, variance = np.asarray(periods, float)[order], np.square(errors_rad[order] / TAU)
    away, gaps = _others(p)
    if not away.size:
        return np.where(np.isfinite(variance).all(0), 0.0, 1.0)
    known = np.isfinite(variance).all(0)
    variance = np.where(known, variance, 1.0)
    near = np.argsort(_square(p, gaps, np.median(variance, 1)[:, None])[:, 0])[:NEAREST]
    square = _square(p, gaps[:, near], variance)
    there = fraction + away[near, None] / p[-1]
    on_screen = (there >= -MARGIN) & (there <= 1 + MARGIN)
    chance = np.where(on_screen, ndtr(-np.sqrt(square) / 2), 0.0).sum(0)
    wrong: FloatArray = np.where(known, np.minimum(chance, 1.0), 1.0)
    return wrong


def _others(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Other sets of orders: by how much [m] that of the highest number of periods is off, and by how much [series - 1,
    m] the phases of the others then are, in turns."""
    most = int(np.floor(p[-1] * (1 + 2 * MARGIN)))
    off = np.concatenate([np.arange(-most, 0), np.arange(1, most + 1)]).astype(float)
    exact = p[:-1, None] * off / p[-1]
    fraction = exact - np.floor(exact)
    # the next order on either side: both are near where the phase lies between them
    kinds = list(itertools.product((0.0, 1.0), repeat=len(p) - 1))
    gaps = np.concatenate([fraction - np.array(kind)[:, None] for kind in kinds], axis=1)
    return np.tile(off, len(kinds)), gaps


def _square(p: FloatArray, gaps: FloatArray, variance: FloatArray) -> FloatArray:
    """Squared distances [m, n] of gaps [series - 1, m] from variances [series, n] in turns squared."""
    weight = 1 / np.maximum(variance, 1e-24)
    s0 = np.einsum("j,jn->n", p**2, weight)
    s1 = np.einsum("j,jm,jn->mn", p[:-1], gaps, weight[:-1])
    s2 = np.einsum("jm,jn->mn", gaps**2, weight[:-1])
    square: FloatArray = np.maximum(s2 - s1**2 / s0, 0.0)
    return square
