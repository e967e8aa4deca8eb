"""Maps of what ghosts and scattered light do to the places that pixels see: the same rays with and without them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from irtscots_cl.analysis.stray_light import StrayLight
from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.imaging.stray_files import StrayMaps
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.measurement.centroids import centroids
from irtscots_cl.tracing.results.paths import PathLight

NM = 1e6


def stray_maps(light: PathLight, stray: Sequence[StrayLight]) -> dict[str, StrayMaps]:
    """Maps over the detector by kind of path. stray: what the kinds do to the measured height.

    A pixel has no value where it has no direct light in some of the replicates, or where this light makes its curve
    unusable.
    """
    pattern = LineScan(light.scene)
    alone, found = light.only("direct").images(pattern), {}
    for of in stray:
        both = light.only("direct", of.kind).images(pattern)
        change = np.stack([_places(both.x) - _places(alone.x), _places(both.y) - _places(alone.y)], 1)
        ratio = _flux(both.x) / _flux(alone.x) - 1  # of the y scan, too: its lines are made of the same pixels
        none = ~(np.isfinite(change).all((0, 1)) & np.isfinite(ratio).all(0)) | of.lost
        change[..., none] = ratio[:, none] = np.nan
        facts = {
            "of_direct": of.of_direct,
            "height_nm_rms": of.height_nm.value,
            "height_nm_rms_standard_error": of.height_nm.standard_error,
            "lost_pixels": of.lost_pixels,
        }
        heights = (NM * of.height_mm, NM * of.height_error_mm)
        found[of.kind] = StrayMaps(change, ratio[0], jackknife_error(ratio), *heights, facts)
    return found


def _places(scan: Scan) -> FloatArray:
    """Centroids [1 + replicates, rows, columns] in mm; NaN where there is no light."""
    return _on_grid(scan, centroids(scan, scan.jackknife_w()))


def _flux(scan: Scan) -> FloatArray:
    """Flux [1 + replicates, rows, columns] of all lines in W; NaN where there is none."""
    flux = scan.jackknife_w().sum(-1)
    return _on_grid(scan, np.where(flux > 0, flux, np.nan))


def _on_grid(scan: Scan, values: FloatArray) -> FloatArray:
    found = np.full((len(values), scan.shape[0] * scan.shape[1]), np.nan)
    found[:, scan.pixels] = values
    return found.reshape(-1, *scan.shape)
