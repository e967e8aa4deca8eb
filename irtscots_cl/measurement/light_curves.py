"""Light curves of the detector pixels: the samples that count, and the curves that can be used."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray

EDGE_TOLERANCE = 0.05  # lines: light lost there shifts the centroid by about 0.8 um, 0.1 urad
DARK_EDGE_TOLERANCE = 0.5  # lines, if the edge line is dark: noise moves the centroid of a few rays
STRAY_SHARE = 0.1  # of a curve's light: largest share farther from its centroid than the geometry allows


class Flag(IntEnum):
    """Why a light curve is not used."""

    GOOD = 0
    EMPTY = 1  # no light at all, or all light in a single replicate
    CLIPPED = 2  # reaches past the screen's first or last line: its centroid would be wrong
    STRAY = 3  # much light where the geometry allows none: background, a second peak, another scene
    SATURATED = 4  # a sample of some exposure is at the camera's limit: a flat top hides the centre
    MASKED = 5  # samples are missing (NaN in the images)


def effective_screen_pixels(curves_w: FloatArray, threshold: float = 0.0) -> BoolArray:
    """Samples [..., n, window] of light curves that count for the centroid: those above threshold x peak.

    The effective screen pixel is the screen area that lights a detector pixel (paper, section 2.2). The default
    uses every sample with light, which suits images without background.
    """
    counts: BoolArray = curves_w > threshold * np.max(curves_w, axis=-1, keepdims=True, initial=0.0)
    return counts


def positions(scan: Scan) -> FloatArray:
    """Line positions [n, window] in mm of a scan's samples.

    In a window wider than the scan, samples past the last line are dark, so their positions do not matter.
    """
    return scan.positions_mm[np.minimum(scan.lines, len(scan.positions_mm) - 1)]


def whole_range(scan: Scan, pitch: float) -> tuple[float, float]:
    """Ends in mm of the part of the screen whose light falls on as many lines as if the scan went on without end.

    pitch: distance of the lines. Where they touch, these are the outer edges of the first and the last.
    """
    margin = pitch * (1 - scan.line_width / 2)
    return float(scan.positions_mm[0]) - margin, float(scan.positions_mm[-1]) + margin


def flag_curves(scan: Scan, curves_w: FloatArray, centroid_mm: FloatArray, reach_mm: FloatArray) -> IntArray:
    """A Flag [n] for each light curve curves_w [n, window] of the scan.

    centroid_mm: [n] of the curves. reach_mm: [n] half-extent of a pixel's light on the screen, from the design's
    geometry. A curve is clipped if its light would extend past the first or last line of the screen by more than
    EDGE_TOLERANCE if that line is lit, or by more than DARK_EDGE_TOLERANCE otherwise. A smaller excess shifts the
    centroid no more than the sampling by lines does.
    """
    pitch = np.diff(scan.positions_mm).mean() if len(scan.positions_mm) > 1 else 0.0  # one line clips every curve
    first, last = whole_range(scan, pitch)
    lit = curves_w > 0
    lit_edge = (lit & ((scan.lines == 0) | (scan.lines == len(scan.positions_mm) - 1))).any(-1)
    beyond = np.maximum(first - (centroid_mm - reach_mm), centroid_mm + reach_mm - last)
    distance = np.abs(positions(scan) - centroid_mm[:, None])
    reached = reach_mm[:, None] + pitch * (1 + scan.line_width) / 2
    stray = np.where(distance > reached, np.maximum(curves_w, 0.0), 0.0).sum(-1)
    flags = np.where(stray > STRAY_SHARE * np.maximum(curves_w, 0.0).sum(-1), Flag.STRAY, Flag.GOOD)
    tolerance = np.where(lit_edge, EDGE_TOLERANCE, DARK_EDGE_TOLERANCE) * pitch
    flags = np.where(beyond > tolerance, Flag.CLIPPED, flags)
    flags = np.where((scan.flux_w >= scan.saturation_w).any((0, -1)), Flag.SATURATED, flags)
    flags = np.where(lit.any(-1), flags, Flag.EMPTY)
    return np.where(np.isnan(curves_w).any(-1), Flag.MASKED, flags)
