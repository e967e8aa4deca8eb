"""Refinement of a measured surface by a model: simulate it, compare the light curves, correct it, and repeat.

Zernike polynomials are fitted to the measured surface. The model is the scene with this surface; its light curves
follow in closed form, or from traced light where that does not hold. Differences between measured and modelled
centroids are slopes that the model lacks. Only these small differences go through triangulation and integration. So the
neglected effects (averaging over a pixel, partly lit pixels at the edge, second-order geometry, sampling by lines) act
only on the differences. This is Gauss-Newton on the slopes.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.zernike.fit import applied, large_smoothing_matrix, smoothing_matrix
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.centroids import centroids
from irtscots_cl.measurement.light_profiles import sampled_centroids
from irtscots_cl.measurement.one_scan import ScanEstimate
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.scan_estimates import estimate_centroids
from irtscots_cl.measurement.slopes import deconvolve_pixel
from irtscots_cl.measurement.surface_heights import triangulated
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.model import Scene

Fit = NDArray[np.floating]
MANY_NUMBERS = 2**26  # of a fit's matrix: a larger one is held in float32
MODEL_ORDER = 20  # radial order of the model: finer structure stays in the differences
PIXELS_PER_TERM = 8  # at least, so that the model does not follow the noise


def refine(result: Reconstruction, stack: ImageStack, *, rounds: int = 4, tolerance_nm: float = 1e-3) -> Reconstruction:
    """Refine a reconstruction of the stack until a round changes less than tolerance_nm rms, at most `rounds` times.

    updates_nm of the result contains each round's change, without piston and tilt; converged says whether the last one
    was below tolerance_nm. Pixels without light in the model
    keep their slopes. No threshold is applied to the light curves: the centroid of a curve cut at a threshold jumps as
    the light moves, and the rounds would not converge.
    """
    fit = zernike_fit(result)
    measured = None if result.estimates_of_scans else [centroids(s, s.jackknife_w()) for s in (stack.x, stack.y)]
    for _ in range(rounds):
        refined = _round(result, stack, fit, measured)
        change = remove_terms(
            result.x_mm, result.y_mm, refined.deviation_mm - result.deviation_mm, result.height_mask, "piston_tilt"
        )
        update = rms(change, result.height_mask) * 1e6
        converged = update < tolerance_nm
        result = dataclasses.replace(refined, updates_nm=(*result.updates_nm, update), converged=converged)
        if converged:
            break
    return result


def zernike_fit(result: Reconstruction, order: int | None = None, pixels_per_term: int | None = None) -> Fit:
    """Matrix [terms, pixels used] from heights to coefficients of Noll terms 1, 2, ... by least squares over the mask.

    Combinations of terms that the mask cannot separate are omitted. Groups of islands have pistons of their own.
    order: the highest radial order, None: MODEL_ORDER; lower where a term would have fewer than pixels_per_term (None:
    PIXELS_PER_TERM).
    """
    radius = result.nominal.mirror.diameter_mm / 2
    order = order_of_model(result.pixels_used, order, pixels_per_term)
    x, y = result.x_mm[result.mask] / radius, result.y_mm[result.mask] / radius
    apart = result.islands if result.islands is not None and result.islands.groups > 1 else None
    groups, terms = None if apart is None else apart.group_map[result.mask] - 1, (order + 1) * (order + 2) // 2
    if terms * x.size > MANY_NUMBERS:
        return large_smoothing_matrix(lambda part: zernikes(order, x[part], y[part]), terms, x.size, groups)
    return smoothing_matrix(zernikes(order, x, y), groups)


def order_of_model(pixels: int, order: int | None = None, pixels_per_term: int | None = None) -> int:
    """The highest radial order of a model for so many pixels. order, pixels_per_term: as of zernike_fit."""
    order = MODEL_ORDER if order is None else order
    pixels_per_term = PIXELS_PER_TERM if pixels_per_term is None else pixels_per_term
    while (order + 1) * (order + 2) // 2 * pixels_per_term > pixels and order > 1:
        order -= 1
    return order


def zernikes(order: int, x: FloatArray, y: FloatArray) -> FloatArray:
    """Noll terms 1, 2, ... up to a radial order, [terms, n], at points of the unit disk [n]."""
    return np.stack([zernike(noll, x, y) for noll in range(1, (order + 1) * (order + 2) // 2 + 1)])


def _with_errors_of(new: ScanEstimate, old: ScanEstimate) -> ScanEstimate:
    """The new estimate, with the old errors of the curves for which it has none: these keep their old slopes."""
    return dataclasses.replace(new, error_mm=np.where(np.isfinite(new.error_mm), new.error_mm, old.error_mm))


def modelled(result: Reconstruction, fit: Fit) -> Scene:
    """The design with the measured deviation as Zernike terms. fit: see zernike_fit."""
    mirror, fit_um = result.nominal.mirror, applied(fit, result.deviation_mm[result.mask]) * 1e3
    terms = ZernikeTerms(mirror.diameter_mm / 2, "noll", dict(enumerate(fit_um.tolist(), 1)))
    return dataclasses.replace(result.nominal, mirror=dataclasses.replace(mirror, zernike=(terms,)))


def _round(result: Reconstruction, stack: ImageStack, fit: Fit, measured: list[FloatArray] | None) -> Reconstruction:
    """One round: the surface that explains the measured curves. measured: their centroids; None: estimated anew."""
    scene, mask = modelled(result, fit), result.mask
    chief = ChiefRays(scene)
    pixels = np.flatnonzero(mask)
    light = PixelLight.of(chief, pixels)
    means = light.means("uv")
    model = [np.full(mask.shape, np.nan) for _ in "uv"]
    residual = []
    estimates = None
    if result.estimates_of_scans:
        new, old = estimate_centroids(stack, result.setup, result.light_curve, light), result.estimates_of_scans
        estimates = (_with_errors_of(new[0], old[0]), _with_errors_of(new[1], old[1]))
    for k, (on_grid, mean, scan) in enumerate(zip(model, means, (stack.x, stack.y), strict=True)):
        on_grid.ravel()[pixels] = mean
        differ = np.full((1 + len(result.jackknife_slope_x), mask.size), np.nan)
        if estimates is None:
            assert measured is not None
            differ[:, scan.pixels] = measured[k] - sampled_centroids(scan, light)
        elif result.light_curve == "likelihood":
            differ[:, estimates[k].scan.pixels] = estimates[k].centroid_mm
            differ -= on_grid.ravel()
        else:
            of_scan = estimates[k].scan
            differ[:, of_scan.pixels] = estimates[k].centroid_mm - sampled_centroids(of_scan, light)
        residual.append(differ.reshape(-1, *mask.shape))
    surface = chief.surface
    height = surface.sag(result.x_mm, result.y_mm)
    model_slopes = triangulated(chief, result.x_mm, result.y_mm, height, *model)
    moved = triangulated(
        chief, result.x_mm, result.y_mm, height, *(m + r for m, r in zip(model, residual, strict=True))
    )
    own = surface.gradient(result.x_mm, result.y_mm)
    extra = []
    for axis, there, model_slope, gradient in zip("xy", moved, model_slopes, own, strict=True):
        differ = there - model_slope
        if not result.pixel_average:
            differ = deconvolve_pixel(differ, mask)
        kept = result.estimates(f"slope_{axis}") - gradient  # for pixels without light in the model
        extra.append(np.where(np.isfinite(differ), differ, kept))
    differ = integrate_slopes(result.x_mm, result.y_mm, extra[0], extra[1], mask, result.method, result.join)
    deviation = surface.deviation_at(result.x_mm, result.y_mm)[0] + differ
    if result.islands is None or result.islands.groups == 1:
        deviation = deviation - np.nanmean(deviation, axis=(1, 2), keepdims=True)
    else:
        deviation = result.islands.levelled(deviation)
    slopes = [gradient + e for gradient, e in zip(own, extra, strict=True)]
    design = result.setup.chief_rays.surface.sag(result.x_mm, result.y_mm)
    return dataclasses.replace(
        result,
        slope_x=slopes[0][0],
        slope_y=slopes[1][0],
        height_mm=design + deviation[0],
        deviation_mm=deviation[0],
        jackknife_slope_x=slopes[0][1:],
        jackknife_slope_y=slopes[1][1:],
        jackknife_deviation_mm=deviation[1:],
        estimates_of_scans=estimates,
    )
