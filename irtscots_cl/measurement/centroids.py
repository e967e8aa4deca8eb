"""Centroids of light curves: the screen coordinate that a detector pixel sees."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.light_curves import effective_screen_pixels, positions

DARK = 1e-12  # of a curve's light


def centroids(scan: Scan, curves_w: FloatArray, threshold: float = 0.0) -> FloatArray:
    """Flux-weighted mean line position [..., n] in mm of light curves curves_w [..., n, window] (paper, Eq. 4).

    Only the effective screen pixels count; threshold: see effective_screen_pixels. NaN for a curve without light.
    """
    flux = np.where(effective_screen_pixels(curves_w, threshold), curves_w, 0.0)
    offset = _offsets(scan)
    with np.errstate(invalid="ignore", divide="ignore"):
        found: FloatArray = scan.positions_mm[scan.first_line] + (flux * offset).sum(-1) / flux.sum(-1)
    return found


def jackknife_centroids(scan: Scan, threshold: float = 0.0) -> FloatArray:
    """Centroids [1 + replicates, n] in mm of the mean light curves, then of those with one replicate left out in turn.

    As `centroids` of scan.jackknife_w(). Without a threshold and without samples below 0 the replicates' moments tell
    them, with no need for the curves.
    """
    if threshold > 0 or scan.flux_w.min(initial=0.0) < 0 or np.isnan(scan.flux_w).any():
        return centroids(scan, scan.jackknife_w(), threshold)
    weights = scan.weights[:, None]
    flux = weights * scan.flux_w.sum(-1)
    moment = weights * np.einsum("rnw,nw->rn", scan.flux_w, _offsets(scan))
    flux, moment = (np.concatenate([part.sum(0)[None], part.sum(0) - part])[: len(part) + (len(part) > 1)]
                    for part in (flux, moment))  # fmt: skip
    flux[flux < DARK * flux[0]] = 0.0  # all light in one replicate: what is left is rounding
    with np.errstate(invalid="ignore", divide="ignore"):
        found: FloatArray = scan.positions_mm[scan.first_line] + moment / np.where(flux > 0, flux, np.nan)
    return found


def poisson_error(scan: Scan, curves_w: FloatArray) -> FloatArray:
    """Standard error [n] in mm of the centroids of curves_w [n, window] from counting statistics.

    It is the curve's standard deviation divided by the root of its number of rays. NaN if that number is unknown or 1.
    A ray that lands where lines overlap lights several, whose own spread about it is no noise.
    """
    offset = _offsets(scan)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = curves_w / curves_w.sum(-1, keepdims=True)
        mean = (share * offset).sum(-1)
        variance = (share * offset**2).sum(-1) - mean**2
        if scan.line_width > 1.0:
            variance = variance - (scan.line_width**2 - 1) / 12 * np.diff(scan.positions_mm).mean() ** 2
        # one ray (weighted, so not exactly 1) has no spread
        return np.where(scan.hits > 1.5, np.sqrt(variance / scan.hits), np.nan)


def _offsets(scan: Scan) -> FloatArray:
    """Line positions [n, window] relative to each curve's first line. Small numbers keep the moments exact."""
    return positions(scan) - scan.positions_mm[scan.first_line][:, None]
