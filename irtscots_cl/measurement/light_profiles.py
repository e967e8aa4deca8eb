"""Centroids of the light from light curves and the modelled profile of the light across the lines.

A light curve samples the light by lines of finite width, so its centroid differs slightly from that of the light
(0.1 urad on the paper's sphere). The design gives the profile: the chord of the camera's aperture (paper, Eq. 2) spread
over the pixel's own image. The profile is moved until its sampled centroid is the measured one; its true centroid is
the result.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.light_curves import effective_screen_pixels
from irtscots_cl.measurement.line_edges import line_edges, on_lines
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.pixel.response import PixelResponse

Light = PixelLight | PixelResponse
ROUNDS = 4  # of moving the profile: the first leaves a few percent of the error, a secant far less than it changes
STEEPEST = 0.5  # change of a sampling error with the place, at most, for a secant
SECANT_LEAVES = 10.0  # times CONVERGED: less of a secant's correction needs no further round
ROUNDS_APART = 12  # of lines with gaps or overlaps, whose sampling error depends more on the place
CONVERGED = 1e-6  # mm: 1e-4 urad in the paper's test


def sampling_error(
    positions_mm: FloatArray,
    light: Light,
    output: str,
    centre_mm: FloatArray,
    threshold: float = 0.0,
    line_width: float = 1.0,
) -> FloatArray:
    """Centroid of noise-free light curves minus that of the light: [n] mm, NaN where the model does not hold.

    The light of the n pixels of `light` along output, "u" or "v", is moved so that its centroids are at centre_mm [n].
    It is sampled by lines at positions_mm [lines], and by more lines beyond them if it extends past them.
    threshold: see effective_screen_pixels. line_width: of a line over the lines' distance.
    """
    screen = light.chief.scene.screen
    pitch = np.diff(positions_mm).mean() if len(positions_mm) > 1 else screen.pitch_xy_mm["uv".index(output)]
    moved = np.where(light.valid(), centre_mm - light.means(output)[0], np.nan)
    reach = light.extent(output)[1][np.isfinite(moved)]
    if reach.size == 0:
        return moved
    count = 2 * int(np.ceil(reach.max() / pitch + max(line_width - 1.0, 0.0) / 2)) + 3
    first = np.rint((centre_mm - positions_mm[0]) / pitch) - count // 2
    lines = positions_mm[0] + pitch * (first[:, None] + np.arange(count))
    edges = positions_mm[0] + pitch * line_edges(first, count, line_width)
    flux = on_lines(light.light(output, edges - moved[:, None]), line_width)
    flux = np.where(effective_screen_pixels(flux, threshold), flux, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        error: FloatArray = (flux * (lines - centre_mm[:, None])).sum(1) / flux.sum(1)
    return error


def profile_centroids(scan: Scan, light: Light, centroid_mm: FloatArray, threshold: float = 0.0) -> FloatArray:
    """Centroids [n] in mm of the light, from the centroids [n] of its light curves and the modelled profile.

    light: of the design's pixels. A pixel without a model keeps its centroid.
    """
    known, index, output = _common(scan, light)
    measured = np.full(len(light.pixels), np.nan)
    measured[index] = centroid_mm[known]
    centre = measured
    before = error_before = np.full_like(measured, np.nan)
    for _ in range(ROUNDS if scan.line_width == 1.0 else ROUNDS_APART):
        error = sampling_error(scan.positions_mm, light, output, centre, threshold, scan.line_width)
        plain = measured - error
        with np.errstate(invalid="ignore", divide="ignore"):  # of the first round, and where nothing changes
            steepness = np.nan_to_num((error - error_before) / (centre - before), posinf=0.0, neginf=0.0)
        following = centre + (plain - centre) / (1.0 + np.clip(steepness, -STEEPEST, STEEPEST))
        by_secant = np.abs(following - plain)
        before, error_before, centre = centre, error, following
        if not np.any(np.abs(centre - before) > CONVERGED):
            break
        if steepness.any() and not np.any(by_secant > SECANT_LEAVES * CONVERGED):
            break
    result = np.array(centroid_mm, float)
    result[known] = np.where(np.isfinite(centre[index]), centre[index], result[known])
    return result


def sampled_centroids(scan: Scan, light: Light, threshold: float = 0.0) -> FloatArray:
    """Centroids [n] in mm of the modelled light's curves on the scan's lines; NaN for pixels without a model."""
    known, index, output = _common(scan, light)
    centre = light.means(output)[0]
    result = np.full(len(scan.pixels), np.nan)
    error = sampling_error(scan.positions_mm, light, output, centre, threshold, scan.line_width)
    result[known] = (centre + error)[index]
    return result


def _common(scan: Scan, light: Light) -> tuple[IntArray, IntArray, str]:
    """Indices of the common pixels in scan.pixels and in light.pixels, and the light's coordinate along the scan."""
    _, known, index = np.intersect1d(scan.pixels, light.pixels, assume_unique=True, return_indices=True)
    return known, index, "uv"["xy".index(scan.axis)]
