"""The light curves of a page, from which it also makes the camera's frames."""

from __future__ import annotations

from typing import Any

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.report.page.arrays import packed

MOST_SAMPLES = 600_000  # of both scans: of larger ones every so many pixels along rows and columns


def curve_data(stack: ImageStack) -> dict[str, Any]:
    """Both scans as JSON for report.js."""
    samples = sum(scan.flux_w[0].size for scan in (stack.x, stack.y))
    step = max(1, int(np.ceil(np.sqrt(samples / MOST_SAMPLES))))
    return {"step": step, "scans": [_scan(scan, step) for scan in (stack.x, stack.y)]}


def _scan(scan: Scan, step: int) -> dict[str, Any]:
    """Pixels [n], their first lines [n], their samples [n, window] and the lines' places."""
    rows, columns = np.divmod(scan.pixels, scan.shape[1])
    part = scan.part((rows % step == 0) & (columns % step == 0))
    return {
        "axis": scan.axis,
        "unit": scan.unit,
        "places_mm": [float(v) for v in scan.positions_mm],
        "pixels": packed(np.asarray(part.pixels, np.int32)),
        "first": packed(np.asarray(part.first_line, np.int32)),
        "samples": packed(part.mean_w()),
    }
