"""Lines that begin within a pixel of the screen, which shows that pixel grey: the images that sharp lines would give.

A pixel that a line covers by a third shines at a third of its light everywhere, not on a third of its width. The
design's light, moved to where the pixel's light was found, tells what that changes: a small part of the light's
curvature over a pixel of the screen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.measurement.one_scan import ScanEstimate
from irtscots_cl.measurement.scan_estimates import estimate_centroids
from irtscots_cl.optics.setup import Setup
from irtscots_cl.system import interruption

ROUNDS = 3  # of finding the light and sharpening: each takes the error of the places down by more than ten


def sharp_lines(stack: ImageStack, setup: Setup, parts: int, way: str) -> ImageStack:
    """The images of sharp lines. setup: of the design, its screen `parts` times as fine as the real one.

    way: of estimate_centroids. Samples at the saturation stay there. Raises ValueError where the light is not found.
    """
    sharp = stack
    for _ in range(ROUNDS):
        interruption.check()
        x, y = estimate_centroids(sharp, setup, way)
        sharp = replace(stack, x=_sharpened(stack.x, setup, parts, x), y=_sharpened(stack.y, setup, parts, y))
    return sharp


def _sharpened(scan: Scan, setup: Setup, parts: int, found: ScanEstimate) -> Scan:
    light = setup.pixel_light
    place = np.full(scan.shape[0] * scan.shape[1], np.nan)
    flux = place.copy()
    place[found.scan.pixels], flux[found.scan.pixels] = found.centroid_mm[0], found.flux
    change, first = grey_difference(setup, scan.axis, parts, place[light.pixels])
    curves = np.zeros((len(light.pixels), len(scan.positions_mm)))
    lines = first[:, None] + np.arange(change.shape[1])
    np.put_along_axis(curves, lines, change, axis=1)
    curves *= np.nan_to_num(flux[light.pixels])[:, None]
    row = np.full(len(place), -1)
    row[scan.pixels] = np.arange(len(scan.pixels))
    own = row[light.pixels]
    seen = own >= 0
    values = scan.flux_w.copy()
    full = values >= scan.saturation_w
    offset = scan.lines[own[seen]]
    values[:, own[seen]] -= np.take_along_axis(curves[seen], offset, axis=1)
    return replace(scan, flux_w=np.where(full, scan.flux_w, values))


def grey_difference(setup: Setup, axis: str, parts: int, place_mm: FloatArray) -> tuple[FloatArray, IntArray]:
    """Light on grey lines less that on sharp ones, as shares of a pixel's light: [n, window], first lines [n].

    place_mm: [n] centroids of the light of setup.pixel_light.pixels; 0 where the light is not known.
    """
    light, screen, k = setup.pixel_light, setup.scene.screen, "xy".index(axis)
    output, pitch, count = "uv"[k], screen.pitch_xy_mm[k], screen.pixels[k]
    own, (middle, half) = light.means(output)[0], light.extent(output)
    known = light.valid() & np.isfinite(own) & np.isfinite(middle) & np.isfinite(half) & np.isfinite(place_mm)
    moved = np.where(known, place_mm - own, 0.0)
    start_mm = screen.centre_offset_mm[k] - count * pitch / 2
    whole = int(np.ceil(2 * half[known].max(initial=0.0) / (pitch * parts))) + 2
    whole = min(whole, count // parts)
    first = np.floor((np.where(known, middle + moved - half, 0.0) - start_mm) / (pitch * parts)).astype(np.int64)
    first = np.clip(first, 0, count // parts - whole) * parts
    edges = start_mm + pitch * (first[:, None] + np.arange(whole * parts + 1)) - moved[:, None]
    sharp = np.where(known[:, None], light.light(output, edges), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        sharp = np.nan_to_num(sharp / sharp.sum(1, keepdims=True))
    grey = np.repeat(sharp.reshape(len(sharp), whole, parts).mean(-1), parts, axis=1)
    curves, lines = LineScan(setup.scene).joined(axis, (grey - sharp)[None], first)
    return curves[0], lines
