"""What a fit means: for the height map in nm, for mirror terms that it takes for geometry, and what else would explain.

All follows from derivatives at the fit, by the fitted unknowns and by further ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_triangular

from irtscots_cl.calibration.bundle_adjustment import Adjustment
from irtscots_cl.calibration.heights import TERMS, HeightGrid
from irtscots_cl.calibration.measured import base_name
from irtscots_cl.calibration.parameters import known_parameters, moved, zernike_names, zernike_noll
from irtscots_cl.calibration.triangular import Triangle
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.low_order import rms
from irtscots_cl.scene.model import Scene

DRAWS = 100  # of noise and unknowns: standard deviations to 7 %
MOST_NOISE = 2**24  # numbers that draws of noise may have; for larger images the height's noise is drawn by itself
OF_SURFACE = ("mirror.radius_relative", "mirror.conic")  # no geometry: the whole height is right with any of them


@dataclass(frozen=True)
class Wide:
    """Derivatives at a fit by further unknowns, and draws of noise.

    names: fitted and further unknowns; count: of the fitted. triangle: rows [names | residual] of all pixels over
    their errors, and those of priors; steps in units of scales. pulls: [count, draws], right sides of the fitted
    unknowns' normal equations by noise and priors. noise_mm: [draws, 2, n] the noise of the first measurement, or None.
    """

    fit: Adjustment
    names: tuple[str, ...]
    scales: FloatArray
    count: int
    triangle: Triangle = field(repr=False)
    pulls: FloatArray = field(repr=False)
    noise_mm: FloatArray | None = field(repr=False)

    @property
    def _head(self) -> FloatArray:
        """[fitted, fitted] triangle of the fitted unknowns, priors included."""
        return self.triangle.values[: self.count, : self.count]

    def errors_of_unknowns(self) -> FloatArray:
        """Draws [draws, fitted] of fitted less true values."""
        inner = solve_triangular(self._head, self.pulls, trans="T")
        found: FloatArray = solve_triangular(self._head, inner).T * self.scales[: self.count]
        return found

    def error_by(self, name: str) -> FloatArray:
        """Fitted less true values [fitted] where an unknown's true value is one unit from the scene's, all else true.

        A fitted unknown does it through its prior alone, which pulls towards the scene's value.
        """
        k = self.names.index(name)
        if k < self.count:
            known = self.fit.problem.prior_rows(self.fit.values)[:, : self.count]
            inner = solve_triangular(self._head, -(known.T @ known)[:, k], trans="T")
        else:
            inner = self.triangle.values[: self.count, k]
        found: FloatArray = solve_triangular(self._head, inner) * self.scales[: self.count] / self.scales[k]
        return found

    def gains(self) -> dict[str, float]:
        """By how much chi-square falls if a further unknown joins the fit, by its name."""
        return dict(zip(self.names[self.count :], self.triangle.left_beside(self.count).tolist(), strict=True))


def widened(fit: Adjustment, further: Sequence[str], draws: int = DRAWS, seed: int = 0) -> Wide:
    """One more look at all pixels: derivatives by further unknowns, and noise through those by the fitted ones."""
    wide = fit.problem.with_unknowns(further)
    count, random = len(fit.names), np.random.default_rng(seed)
    values = np.concatenate([fit.values, np.zeros(len(further))])
    first = wide.measurements[0]
    noise_mm = np.empty((draws, 2, len(first.pixels))) if 2 * len(first.pixels) * draws <= MOST_NOISE else None
    known = fit.problem.prior_rows(fit.values)
    pulls = known[:, :count].T @ random.standard_normal((len(known), draws))
    triangle = Triangle.empty(len(wide.names)).with_rows(np.insert(known, [count] * len(further), 0.0, axis=1))
    for k, (m, share) in enumerate(zip(wide.measurements, wide.shares, strict=True)):
        for part in m.parts():
            use = np.flatnonzero(fit.used[k][part])
            errors = m.errors_mm[:, part] * fit.noise
            rows = m.jacobian(share.changes(values), share.names, part) @ (share.matrix * wide.scales)
            rows = (rows / errors[..., None])[:, use]
            noise = random.standard_normal((2, errors.shape[1], draws))
            if k == 0 and noise_mm is not None:
                noise_mm[:, :, part] = np.moveaxis(noise * errors[..., None], -1, 0)
            pulls += rows[..., :count].reshape(-1, count).T @ noise[:, use].reshape(-1, draws)
            left = fit.left[k][:, part][:, use, None] / fit.noise
            triangle = triangle.with_rows(np.concatenate([rows, left], axis=-1).reshape(-1, len(wide.names) + 1))
    return Wide(fit, wide.names, wide.scales, count, triangle, pulls, noise_mm)


@dataclass(frozen=True)
class HeightEffects:
    """What the calibration does to the heights of the first measurement, in mm on grid [r, c].

    before, after: heights by the believed and by the fitted geometry. by_unknown: [fitted, r, c], height per unit of an
    unknown that is larger in truth than in the scene. draws: [draws, r, c] errors of `after` by noise and calibration,
    noise_draws: by noise alone. kept: {Noll term: (rms of the height's error, part of the term that is lost)} for a
    mirror with one micrometre of it.
    """

    grid: HeightGrid
    before: FloatArray = field(repr=False)
    after: FloatArray = field(repr=False)
    by_unknown: FloatArray = field(repr=False)
    draws: FloatArray = field(repr=False)
    noise_draws: FloatArray = field(repr=False)
    taken: dict[int, tuple[float, float]] = field(repr=False)

    @property
    def change(self) -> FloatArray:
        return self.after - self.before


def height_effects(wide: Wide) -> HeightEffects:
    """The heights before and after a calibration, and draws of their errors."""
    fit = wide.fit
    m, used = fit.problem.measurements[0], fit.used[0]
    fitted = fitted_scene(fit)
    believed = HeightGrid.of(m, m.scene, used)
    grid = HeightGrid.of(m, fitted, used)
    before = believed.heights(believed.maps(m.places_mm[:, believed.chosen]))
    after = grid.heights(grid.maps(m.places_mm[:, grid.chosen]))
    by_unknown = _by_unknown(fit, grid)
    flat = by_unknown.reshape(len(by_unknown), -1)
    errors = wide.errors_of_unknowns()
    noise = _noise_heights(wide, grid)
    draws = noise - (errors @ flat).reshape(noise.shape)
    taken = {}
    for noll, (name,) in ((noll, zernike_names([noll])) for noll in TERMS):
        if name not in wide.names:
            continue
        lost = -(wide.error_by(name) @ flat).reshape(grid.mask.shape)
        lost = grid.without(lost, "piston_tilt")
        own = grid.coefficients(lost)[TERMS.index(noll)]
        taken[noll] = (rms(lost, grid.mask), float(-own / 1e-3))
    return HeightEffects(grid, before, after, by_unknown, draws, noise, taken)


def fitted_scene(fit: Adjustment) -> Scene:
    """The first measurement's scene with the fitted geometry; the mirror stays the design, without figure terms."""
    m = fit.problem.measurements[0]
    changes = {name: value for name, value in fit.changes().items() if zernike_noll(name) is None}
    return moved(m.scene, changes)


def _by_unknown(fit: Adjustment, grid: HeightGrid) -> FloatArray:
    """Height [fitted, r, c] in mm per unit of each unknown of the geometry; 0 for those of the surface."""
    share, m = fit.problem.shares[0], grid.measurement
    found = np.zeros((len(fit.names), *grid.mask.shape))
    columns = m.jacobian(fit.changes(), share.names, grid.chosen) @ share.matrix
    pitches = m.scene.screen.pitch_xy_mm, grid.chief.scene.screen.pitch_xy_mm
    design = grid.landing_mm * np.divide(*pitches)[:, None, None]
    for k, name in enumerate(fit.names):
        base = base_name(name)
        if zernike_noll(base) is not None or base in OF_SURFACE or not share.matrix[:, k].any():
            continue
        step = fit.errors[k]
        both = np.stack([design + grid.maps(columns[..., k] * sign * step) for sign in (1.0, -1.0)], axis=1)
        plus, minus = grid.heights(both)
        found[k] = (plus - minus) / (2 * step)
    return np.nan_to_num(found)


def _noise_heights(wide: Wide, grid: HeightGrid) -> FloatArray:
    """Draws [draws, r, c] of the heights' errors by noise alone."""
    m, draws = grid.measurement, wide.pulls.shape[1]
    if wide.noise_mm is not None:
        noise = wide.noise_mm[..., grid.chosen]
    else:  # the mean of the pixels that one stands for
        random = np.random.default_rng(1)
        noise = random.standard_normal((draws, 2, len(grid.chosen))) * m.errors_mm[:, grid.chosen] / grid.step
    return np.nan_to_num(grid.noise_heights(noise))


def candidates(fit: Adjustment) -> tuple[str, ...]:
    """Further unknowns that might explain what the fit leaves: all of the geometry, and low mirror terms."""
    scene = fit.problem.measurements[0].scene
    every = (*known_parameters(scene), *zernike_names(TERMS))
    return tuple(name for name in every if name not in fit.names)
