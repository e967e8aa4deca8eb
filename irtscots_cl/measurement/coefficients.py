"""Zernike coefficients of a measured deviation, with their standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.maths.zernike.fit import ZernikeFit, separable_terms
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.system.option_error import OptionError

FITTED_NOLL = 45  # radial orders up to 8
KINDS = ("circular", "annular")
ERROR_SOURCES = ("images", "replicates", "misfit", "none")
NOISE_DRAWS = 64  # maps of random slopes for errors without replicates: known to 9 %


@dataclass(frozen=True)
class Coefficients:
    """Noll coefficients of the deviation; the pistons of groups of islands but the largest are fitted too.

    um, standard_error_um: [terms of the fit]. error_source: of ERROR_SOURCES. residual_nm: rms deviation that the fit
    leaves. kind: of KINDS. radius_mm: of the terms' disk.
    """

    kind: str
    radius_mm: float
    fit: ZernikeFit = field(repr=False)
    um: FloatArray
    standard_error_um: FloatArray
    error_source: str
    residual_nm: float


def check_kind(kind: str) -> None:
    """Raise ValueError unless ``kind`` is one of KINDS."""
    if kind not in KINDS:
        raise OptionError(f"--zernike = {kind!r}: must be one of {', '.join(KINDS)}")


def terms_disk(mirror: Mirror, kind: str) -> tuple[float, float]:
    """Radius [mm] of the disk of a mirror's terms and the ratio of its hole.

    Circular terms have no hole, and the disk of the mirror's own table of Zernike terms if it has one; else it is the
    mirror's. Annular terms have the mirror's rim and its central hole.
    """
    check_kind(kind)
    if kind == "annular":
        return mirror.diameter_mm / 2, mirror.obscuration_mm / mirror.diameter_mm
    return mirror.zernike[0].radius_mm if mirror.zernike else mirror.diameter_mm / 2, 0.0


def coefficients(
    result: Reconstruction,
    mirror: Mirror | None = None,
    kind: str = "circular",
    nolls: Sequence[int] = range(1, FITTED_NOLL + 1),
    noise_errors: bool = True,
    bars: ErrorBars | None = None,
) -> Coefficients:
    """Noll coefficients of the measured deviation, fitted together to all pixels used.

    mirror: whose disk the terms have, by default the design's; see terms_disk. Terms that the pixels cannot separate
    are left out: see maths.zernike.fit. Standard errors are those of the images' noise, from ``bars``, if these are
    there; else the jackknife's over the replicates; without replicates and with noise_errors, those of white noise of
    the slopes that has the misfit of integration; else NaN. The stated errors of joined islands are added. Raises
    ValueError for an unknown kind.
    """
    radius_mm, ratio = terms_disk(mirror or result.nominal.mirror, kind)
    mask, islands = result.mask, result.islands
    groups = None if islands is None else islands.group_map[mask] - 1
    fit = separable_terms(result.x_mm[mask] / radius_mm, result.y_mm[mask] / radius_mm, nolls, ratio, groups)
    maps_um = result.estimates("deviation_mm")[:, mask] * 1e3
    found = fit.coefficients(maps_um)
    error, source = jackknife_error(found), "replicates"
    if bars is not None:
        error, source = fit.coefficients(bars.draws_mm[:, mask] * 1e3).std(axis=0), "images"
    elif np.isnan(error).any():
        error, source = _noise_error(result, fit) if noise_errors else error, "misfit"
        if np.isnan(error).any():
            source = "none"
    joining = result.joining_errors_mm()
    if len(joining):
        error = np.hypot(error, np.sqrt(np.mean(fit.coefficients(joining[:, mask] * 1e3) ** 2, axis=0)))
    return Coefficients(kind, radius_mm, fit, found[0], error, source, fit.residual_rms(maps_um[0]) * 1e3)


def coefficient_noise(
    result: Reconstruction, fit: ZernikeFit, noise_x: FloatArray, noise_y: FloatArray, draws: int = NOISE_DRAWS
) -> FloatArray:
    """Standard errors [terms] in um from independent errors noise_x, noise_y [rows, columns] in rad of the slopes.

    The scatter of ``draws`` maps of random slopes that went through integration and fit, as measured slopes do.
    """
    random = np.random.default_rng(0).standard_normal((2, draws, *result.mask.shape))
    heights = integrate_slopes(
        result.x_mm, result.y_mm, noise_x * random[0], noise_y * random[1], result.mask, result.method, result.join
    )
    error: FloatArray = np.sqrt(np.mean(fit.coefficients(heights[:, result.mask] * 1e3) ** 2, axis=0))
    return error


def _noise_error(result: Reconstruction, fit: ZernikeFit) -> FloatArray:
    noise = result.white_slope_noise()
    if np.isnan(noise):
        return np.full(len(fit.nolls), np.nan)
    everywhere = np.where(result.mask, noise, np.nan)
    return coefficient_noise(result, fit, everywhere, everywhere)
