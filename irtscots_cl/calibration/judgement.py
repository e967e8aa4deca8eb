"""Whether a fit explains the data, in plain words: chi-square, patterns, priors, what else would explain them.

A good chi-square does not show a wrong geometry: what the unknowns can imitate leaves no residual. So it is also said
which unknowns the data determine, which only their priors, and which mirror terms pass for geometry.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from irtscots_cl.calibration.bundle_adjustment import Adjustment
from irtscots_cl.calibration.consequences import HeightEffects, Wide
from irtscots_cl.calibration.measured import Measurement, base_name
from irtscots_cl.calibration.parameters import parameter, zernike_noll
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.integration import integration_misfit
from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement.quality import OK, WARNING, Check

RATIO = 1.2  # of the residuals' squares to those of the stated errors, which are estimates themselves
SIGMAS = 5.0  # standard deviations: what noise alone makes once in 3.5 million
PATCHES = 8  # along each axis: means over them show patterns below the noise of a pixel
PATTERN = 1.5  # of the means' squares to those of noise
GAIN = 30.0  # of chi-square: 4e-8 for noise alone, for one further unknown
NAMED = 3  # further unknowns that are named
OWN = 0.1  # of a prior's standard deviation: the least that a value is taken to be free to differ by
PULL = 4.0  # standard deviations between an unknown's value and its prior
REJECTED = 0.01  # of the pixels
FROM_DATA, FROM_PRIOR = 0.5, 0.9  # posterior over prior standard deviation: below, above
SURFACE = 0.9  # of the residual slopes' squares, that a surface has
TAKEN = 0.1  # of a mirror term that passes for geometry


def judge(fit: Adjustment, wide: Wide, effects: HeightEffects) -> list[Check]:
    """All checks of a fit; each says what to do."""
    checks = [_priors(fit), _chi_square(fit, wide), _pattern(fit), _rejected(fit), _converged(fit)]
    if checks[1].level != OK:
        checks.insert(2, _surface(fit, effects))
    return [*checks, _taken(fit, effects)]


def verdict(checks: list[Check]) -> str:
    """One line on the whole fit."""
    failed = [check for check in checks if check.level != OK]
    if not failed:
        return "good: the fitted set-up explains the images within their noise"
    named = [check.text for check in failed if check.name in ("priors", "chi-square", "pattern")]
    if named:
        return f"the model does not explain the data: {'; '.join(named[:2])}"
    return f"with reservations: {failed[0].text}"


def _chi_square(fit: Adjustment, wide: Wide) -> Check:
    ratio, degrees = fit.chi_square / fit.degrees, fit.degrees
    limit = max(RATIO, 1 + SIGMAS * math.sqrt(2 / degrees))
    gains = sorted(wide.gains().items(), key=lambda item: -item[1])
    helps = [f"{name} (by {gain * fit.noise**2:.3g})" for name, gain in gains[:NAMED] if gain > GAIN]
    better = f"; fitted in addition, these would lower chi-square most: {', '.join(helps)}" if helps else ""
    what = f"residuals are {math.sqrt(ratio):.3g} times the stated errors"
    if ratio <= limit and not helps:
        return Check("chi-square", OK, ratio, limit, 1e-6, what)
    if ratio <= limit:
        what += ", but not by chance alone"
    if fit.noise > 1:
        what += f"{_by_measurement(fit)}; these are scaled up to them, and the covariance is a lower bound"
    return Check("chi-square", WARNING, ratio, limit, 1e-6, what + better)


def _by_measurement(fit: Adjustment) -> str:
    """The residuals of each of several measurements: they may contradict each other."""
    if len(fit.left) == 1:
        return ""
    parts = zip(fit.problem.measurements, fit.left, fit.used, strict=True)
    told = [f"{m.name} {math.sqrt(np.mean(left[:, used] ** 2)):.3g}" for m, left, used in parts]
    return f" ({', '.join(told)}: are their turns and moves those stated?)"


def _surface(fit: Adjustment, effects: HeightEffects) -> Check:
    """Which part of the residuals, beyond noise, could be slopes of some mirror."""
    grid, m = effects.grid, fit.problem.measurements[0]
    random = np.random.default_rng(0)
    squares = np.zeros(2)  # of the slopes of no surface, and of all
    left = fit.left[0][:, grid.chosen]
    for residual, sign in ((left, 1.0), (random.standard_normal(left.shape), -1.0)):
        slopes = grid.slopes(grid.maps(residual * m.errors_mm[:, grid.chosen]) + grid.landing_mm)
        found = integration_misfit(grid.mirror_mm[0], grid.mirror_mm[1], slopes[0], slopes[1], grid.mask)
        squares += sign * np.square([np.nan_to_num(found.slope), found.rms_slope])
    share = float(np.clip(1 - squares[0] / squares[1], 0.0, 1.0)) if squares[1] > 0 else 1.0
    height = grid.heights(grid.maps(left * m.errors_mm[:, grid.chosen]) + grid.landing_mm)
    rms_nm = rms(grid.without(height, "piston_tilt"), grid.mask) * 1e6
    if share >= SURFACE:
        text = (
            f"{share:.1%} of the residual slopes beyond noise could be those of a surface, of {rms_nm:.3g} nm rms: "
            "higher orders of the mirror, which the height map will show, or what imitates them"
        )
        return Check("surface", OK, share, SURFACE, 0.0, text)
    text = (
        f"{1 - share:.1%} of the residual slopes beyond noise are those of no surface: not the mirror, but the camera, "
        "the screen or its shape, or the images"
    )
    return Check("surface", WARNING, share, SURFACE, 0.0, text)


def _pattern(fit: Adjustment) -> Check:
    """Means of the residuals over patches of the image, squared: 1 for noise alone."""
    squares, count = 0.0, 0
    for m, left, used in zip(fit.problem.measurements, fit.left, fit.used, strict=True):
        means = patch_means(m, left / fit.noise, used)
        squares, count = squares + float(np.sum(means**2)), count + means.size
    degrees = max(count - fit.from_data, 1.0)
    ratio = squares / degrees
    limit = max(PATTERN, 1 + SIGMAS * math.sqrt(2 / degrees))
    if ratio <= limit:
        return Check("pattern", OK, ratio, limit, 1e-6, "residuals have no pattern over the image beyond noise")
    text = (
        f"residuals have a pattern over the image, {math.sqrt(ratio):.3g} times what noise leaves in means over "
        "patches: something smooth is not among the unknowns"
    )
    return Check("pattern", WARNING, ratio, limit, 1e-6, text)


def patch_means(m: Measurement, left: FloatArray, used: BoolArray) -> FloatArray:
    """Sums over PATCHES^2 patches of the image over the root of their pixels [2, patches]: of variance 1 for noise."""
    row, column = m.place_of(np.flatnonzero(used))
    edges = [np.linspace(k.min(initial=0), k.max(initial=0) + 1, PATCHES + 1)[1:-1] for k in (row, column)]
    patch = np.digitize(row, edges[0]) * PATCHES + np.digitize(column, edges[1])
    count = np.bincount(patch, minlength=PATCHES**2)
    sums = np.stack([np.bincount(patch, values, PATCHES**2) for values in left[:, used]])
    found: FloatArray = sums[:, count > 0] / np.sqrt(count[count > 0])
    return found


def prior_pulls(fit: Adjustment) -> FloatArray:
    """By how many standard deviations each unknown's value differs from its prior; NaN without a prior.

    The difference has the variance of the prior less that of the result: what both share is no difference.
    """
    sigmas = fit.problem.sigmas
    variance = np.maximum(sigmas**2 - fit.errors**2, (OWN * sigmas) ** 2)
    found: FloatArray = fit.values / np.sqrt(variance)
    return found


def _priors(fit: Adjustment) -> Check:
    pulls = np.abs(np.nan_to_num(prior_pulls(fit)))
    distances = {d.name: abs(d.mm - d.of(fit.problem.moved_first(fit.values))) / d.sigma for d in fit.problem.distances}
    worst, name = max(
        [*zip(pulls.tolist(), fit.names, strict=True), *((pull, name) for name, pull in distances.items())],
        default=(0.0, ""),
    )
    tests = len(pulls) + len(distances)
    chance = tests * 2 * float(stats.norm.sf(PULL))
    if worst <= PULL:
        return Check("priors", OK, worst, PULL, chance, "the data agree with what is known beforehand")
    if name in distances:
        text = f'the images contradict the known distance "{name}" by {worst:.1f} of its standard deviations'
    else:
        k = fit.names.index(name)
        unit = parameter(base_name(name), fit.problem.measurements[0].scene).unit
        text = (
            f"{name} = {fit.values[k]:.4g} {unit} lies {worst:.1f} standard deviations of its prior "
            f"({fit.problem.sigmas[k]:.3g}) from the scene's value: that is wrong, or something else is"
        )
    return Check("priors", WARNING, worst, PULL, chance, text)


def _rejected(fit: Adjustment) -> Check:
    every = sum(len(m.pixels) for m in fit.problem.measurements)
    share = fit.rejected / every
    text = f"{fit.rejected} of {every} pixels lie too far from the model and do not count"
    return Check("rejected", OK if share <= REJECTED else WARNING, share, REJECTED, 1e-6, text)


def _converged(fit: Adjustment) -> Check:
    text = f"converged in {fit.rounds} rounds"
    if fit.converged:
        return Check("converged", OK, float(fit.rounds), 0.0, 0.0, text)
    text = f"not converged after {fit.rounds} rounds: the unknowns are too far off, or the data determine too little"
    return Check("converged", WARNING, float(fit.rounds), 0.0, 0.0, text)


def _taken(fit: Adjustment, effects: HeightEffects) -> Check:
    """Mirror terms that the fitted geometry imitates."""
    shares = {noll: lost for noll, (_, lost) in effects.taken.items()}
    taken = {noll: lost for noll, lost in shares.items() if abs(lost) > TAKEN}
    free = not any(zernike_noll(name) for name in fit.names) and not any(
        m.knows_mirror for m in fit.problem.measurements
    )
    if not taken:
        text = "no low term of the mirror passes for geometry"
        return Check("mirror terms", OK, 0.0, TAKEN, 0.0, text)
    worst = max(abs(lost) for lost in taken.values())
    told = ", ".join(f"Z{noll} {lost:.0%}" for noll, lost in sorted(taken.items()))
    if free:
        text = (
            f"no term of the mirror is an unknown: of terms that the mirror has, the fit takes for geometry, and the "
            f"height map loses, {told}; fit them too (--mirror-order), or calibrate with a mirror that is known"
        )
        return Check("mirror terms", WARNING, worst, TAKEN, 0.0, text)
    text = f"of a mirror term beyond its prior, the height map loses {told}; the stated standard deviations hold this"
    return Check("mirror terms", OK, worst, TAKEN, 0.0, text)
