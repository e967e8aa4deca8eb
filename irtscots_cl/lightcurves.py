"""Light curves of the detector pixels: which of their samples belong to them, and which curves can be used."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from irtscots_cl.images import Scan

EDGE_TOLERANCE = 0.05  # lines: the light that is lost there shifts the centroid by about 0.8 um, 0.1 urad


class Flag(IntEnum):
    """Why a light curve is not used."""

    GOOD = 0
    EMPTY = 1  # no light at all, or none without one of the replicates
    CLIPPED = 2  # reaches past the screen's first or last line: its centroid would be wrong


def effective_screen_pixels(curves_w: np.ndarray, threshold: float = 0.0) -> np.ndarray:
    """Samples [..., n, window] of light curves that count for the centroid: above threshold x their peak.

    The effective screen pixel is the screen area that lights a detector pixel (paper, section 2.2). The default takes
    every sample with light, which is right for images without background.
    """
    return curves_w > threshold * np.max(curves_w, axis=-1, keepdims=True, initial=0.0)


def flag_curves(scan: Scan, curves_w: np.ndarray, centroid_mm: np.ndarray, reach_mm: np.ndarray) -> np.ndarray:
    """A Flag [n] for each light curve curves_w [n, window] of the scan.

    centroid_mm: [n] of the curves. reach_mm: [n] how far from its centre the light of a pixel reaches on the screen by
    the design's geometry. A curve is clipped if its first or last line on the screen is lit and its light reaches past
    it by more than EDGE_TOLERANCE: less shifts the centroid by no more than the sampling by lines does anyway.
    """
    pitch = np.diff(scan.positions_mm).mean() if len(scan.positions_mm) > 1 else 0.0  # one line holds no curve whole
    first, last = scan.positions_mm[0] - pitch / 2, scan.positions_mm[-1] + pitch / 2
    lit = curves_w > 0
    lit_edge = (lit & ((scan.lines == 0) | (scan.lines == len(scan.positions_mm) - 1))).any(-1)
    beyond = np.maximum(first - (centroid_mm - reach_mm), centroid_mm + reach_mm - last)
    flags = np.where(lit_edge & (beyond > EDGE_TOLERANCE * pitch), Flag.CLIPPED, Flag.GOOD)
    return np.where(lit.any(-1), flags, Flag.EMPTY)
