"""From phases of several numbers of periods to one place on the screen: temporal unwrapping by maximum likelihood.

A phase of p periods over the screen gives the place s up to a multiple of 1 / p:

    p s = phase / (2 pi) + n,    n a whole number: the order of the fringe.

The orders of all p together that make the phases' weighted misfit least are the most likely ones. The probability that
they are wrong follows from the misfit of all the others: for Gaussian errors all sets of orders have the same width in
s, so that each has the posterior probability exp(-misfit / 2) over the sum of all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

from irtscots_cl.maths.arrays import BoolArray, FloatArray

MARGIN = 0.05  # of the screen beyond its ends: phases there are taken as they are
DOUBT = 1e-6  # probability of wrong orders from which on all orders are compared
AT_ONCE = 2**21  # candidates compared in one go
HIGHEST_FLOOR_RAD = 1.0
WIDER = 3.0  # a prior, where the series are compared with each other
TAU = 2 * np.pi


@dataclass(frozen=True)
class Unwrapped:
    """Places of n pixels. fraction: [n] of the screen, NaN where no phase is known. standard_error: [n] of it, for the
    right orders. wrong: [n] probability that the orders are wrong. misfit: [n] chi-square of the phases; freedom: [n]
    its degrees of freedom."""

    fraction: FloatArray
    standard_error: FloatArray
    wrong: FloatArray
    misfit: FloatArray
    freedom: FloatArray


@dataclass(frozen=True)
class Prior:
    """A place [n] that is known beforehand, as from a design, with its standard error [n]."""

    fraction: FloatArray
    standard_error: FloatArray


def unwrap(
    phases_rad: FloatArray, errors_rad: FloatArray, periods: tuple[float, ...], prior: Prior | None = None
) -> Unwrapped:
    """Places on the screen from phases [series, n] with their standard errors [series, n], of so many periods [series].

    A phase that is no number, or without a finite error, is not used. The place is sought on the screen, or, with a
    prior, where that and the phases agree best. Where no number of periods is below 1 and there is no prior, the
    phases may fit several places: `wrong` says so.
    """
    order = np.argsort(periods)
    p = np.asarray(periods, float)[order]
    turns, variance = phases_rad[order] / TAU, np.square(errors_rad[order] / TAU)
    known = np.isfinite(turns) & np.isfinite(variance)
    variance = np.where(known, np.maximum(variance, 1e-24), np.inf)
    turns = np.where(known, turns, 0.0)
    result = _in_sequence(turns, variance, p, prior)
    doubtful = ~(result.wrong < DOUBT) & known.any(0)
    if doubtful.any():
        _compare_all(result, np.flatnonzero(doubtful), turns, variance, p, prior)
    return result


def refined(phases_rad: FloatArray, errors_rad: FloatArray, periods: tuple[float, ...], near: FloatArray) -> Unwrapped:
    """As unwrap, with the orders that lead nearest to known places [n]; `wrong` is 0."""
    p = np.asarray(periods, float)[:, None]
    turns, variance = phases_rad / TAU, np.square(errors_rad / TAU)
    known = np.isfinite(turns) & np.isfinite(variance) & np.isfinite(near)
    weight = np.where(known, p**2 / np.maximum(np.where(known, variance, 1.0), 1e-24), 0.0)
    place = np.where(known, (turns + np.rint(p * near - turns)) / p, 0.0)
    total = weight.sum(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (weight * place).sum(0) / total
        misfit = (weight * np.square(place - mean)).sum(0)
        return Unwrapped(mean, np.sqrt(1 / np.where(total > 0, total, np.nan)), total * 0, misfit, known.sum(0) - 1.0)


def _in_sequence(turns: FloatArray, variance: FloatArray, p: FloatArray, prior: Prior | None) -> Unwrapped:
    """Orders found one after the other, each from the place that all lower numbers of periods give.

    The probability of wrong orders is the sum over the series of the second nearest order's share. It is 1 where there
    is no unique start.
    """
    n = turns.shape[1]
    wrong, misfit = np.zeros(n), np.zeros(n)
    freedom = np.isfinite(variance).sum(0) - 1.0
    if prior is not None:
        place, spread, first = prior.fraction.copy(), np.square(prior.standard_error), 0
        freedom += 1
    else:
        unique = p[0] * (1 + 2 * MARGIN) <= 1
        start = turns[0] - p[0] / 2
        place, spread, first = 0.5 + (start - np.rint(start)) / p[0], variance[0] / p[0] ** 2, 1
        wrong[:] = np.where(np.isfinite(variance[0]) & unique, 0.0, 1.0)
    for j in range(first, len(p)):
        with np.errstate(invalid="ignore", over="ignore"):
            gap = p[j] * place - turns[j]
            gap -= np.rint(gap)
            joint = p[j] ** 2 * spread + variance[j]
            wrong += np.where(np.isfinite(variance[j]), np.exp(-(0.5 - np.abs(gap)) / joint), 0.0)
            misfit += np.square(gap) / joint
            share = np.where(np.isfinite(joint), p[j] ** 2 * spread / joint, 0.0)
            place -= share * gap / p[j]
            spread = spread * (1 - share)
    found = np.isfinite(spread)
    return Unwrapped(
        np.where(found, place, np.nan),
        np.where(found, np.sqrt(spread), np.nan),
        np.minimum(wrong, 1.0),
        misfit,
        freedom,
    )


def _compare_all(
    result: Unwrapped, pixels: np.ndarray, turns: FloatArray, variance: FloatArray, p: FloatArray, prior: Prior | None
) -> None:
    """Put the most likely of all sets of orders into the result, for some pixels.

    For each order of the highest known number of periods the others' nearest orders are taken: a number of periods
    below it has its place better known than to half a fringe.
    """
    known = np.isfinite(variance[:, pixels])
    kinds, which = np.unique(known, axis=1, return_inverse=True)
    for kind, used in enumerate(kinds.T):
        if not used.any():
            continue
        those = pixels[which.ravel() == kind]
        size = max(1, AT_ONCE // int(p[used][-1] * 2 + 4))
        for start in range(0, len(those), size):
            some = those[start : start + size]
            near = None if prior is None else Prior(prior.fraction[some], prior.standard_error[some])
            best = _most_likely(turns[used][:, some], variance[used][:, some], p[used], near)
            for whole, part in zip(
                (result.fraction, result.standard_error, result.wrong, result.misfit), best, strict=True
            ):
                whole[some] = part


def _most_likely(
    turns: FloatArray, variance: FloatArray, p: FloatArray, prior: Prior | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Place, standard error, probability of wrong orders and misfit [n], all orders compared."""
    first = np.ceil(-MARGIN * p[-1] - turns[-1])
    orders = first + np.arange(int(np.floor(p[-1] * (1 + 2 * MARGIN))) + 1)[:, None]
    place = (orders + turns[-1]) / p[-1]  # [orders, n]
    s0 = (p[:, None] ** 2 / variance).sum(0)
    s1, s2 = np.zeros_like(place), np.zeros_like(place)
    for j in range(len(p) - 1):
        gap = turns[j] - p[j] * place
        gap -= np.rint(gap)
        s1 += p[j] / variance[j] * gap
        s2 += gap**2 / variance[j]
    if prior is not None:
        weight, gap = 1 / np.square(prior.standard_error), prior.fraction - place
        s0, s1, s2 = s0 + weight, s1 + weight * gap, s2 + weight * gap**2
    misfit = np.maximum(s2 - s1**2 / s0, 0.0)
    misfit[place > 1 + MARGIN] = np.inf
    best = np.argmin(misfit, 0)[None]
    least = np.take_along_axis(misfit, best, 0)[0]
    with np.errstate(invalid="ignore"):
        wrong = 1 - 1 / np.exp(-(misfit - least) / 2).sum(0)
    there = np.take_along_axis(place + s1 / s0, best, 0)[0]
    nowhere = ~np.isfinite(least)
    return np.where(nowhere, np.nan, there), np.sqrt(1 / s0), np.where(nowhere, 1.0, wrong), least


def phase_floor(
    phases_rad: FloatArray, errors_rad: FloatArray, periods: tuple[float, ...], prior: Prior | None = None
) -> float:
    """Error [rad] that has to be added in quadrature to all phases to make their median misfit what it should be.

    What it stands for is no noise: harmonics, another blur at other numbers of periods, motion. 0 where noise explains
    the misfit, and where one series is all there is. A prior only tells the orders: its own error is often the same in
    all pixels.
    """
    if len(periods) == 1:
        return 0.0
    wide = None if prior is None else Prior(prior.fraction, WIDER * prior.standard_error)

    def excess(floor: float) -> float:
        errors = np.hypot(errors_rad, floor)
        found = unwrap(phases_rad, errors, periods, wide)
        if wide is not None:
            found = refined(phases_rad, errors, periods, found.fraction)
        fits: BoolArray = np.isfinite(found.fraction) & (found.freedom > 0)
        if not fits.any():
            return -1.0
        kinds, which = np.unique(found.freedom[fits], return_inverse=True)
        return float(np.median(found.misfit[fits] / chi2.median(kinds)[which])) - 1.0

    if excess(0.0) <= 0:
        return 0.0
    if excess(HIGHEST_FLOOR_RAD) > 0:
        return HIGHEST_FLOOR_RAD
    return float(brentq(excess, 0.0, HIGHEST_FLOOR_RAD, xtol=1e-5, rtol=1e-2))
