"""How errors go together: which sources' height maps are alike, and the covariance of the whole height map.

The covariance of n pixels is an n x n matrix; its largest modes say the same in a few maps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from irtscots_cl.budget.linear import ErrorPart
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.sensitivity import Sensitivity
from irtscots_cl.calibration.height_response import LEFT_AFTER
from irtscots_cl.maths.arrays import FloatArray

LEAST = 1e-12  # of the largest mode's variance: rounding


def map_correlation(design: MeasuredDesign, found: Mapping[str, Sensitivity]) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the sources that have one map each, and the correlation [p, p] of these maps over the mirror.

    Piston and tilt removed. Sources with 1 or -1 do the same: one can make up for the other, and a test cannot tell
    them apart. 0 for a source that does nothing. Processes have no map of their own.
    """
    names = tuple(name for name, one in found.items() if not one.source.kind.is_random)
    maps = np.reshape([found[name].height_mm for name in names], (-1, design.count))
    maps = design.response.without(maps, LEFT_AFTER[0])
    size = np.sqrt(np.sum(maps**2, axis=1, keepdims=True))
    maps = np.divide(maps, size, out=np.zeros_like(maps), where=size > 0)
    return names, maps @ maps.T


def error_modes(design: MeasuredDesign, parts: Sequence[ErrorPart], most: int) -> tuple[FloatArray, float]:
    """Maps [modes, n] in mm, the largest first, whose products M^T M are the covariance of the heights, piston and tilt
    removed; and the share of all variance that is in them. most: number of modes."""
    rows = [np.sqrt(part.share) * design.response.without(part.maps, LEFT_AFTER[0]) for part in parts]
    maps = np.concatenate(rows) if rows else np.zeros((0, design.count))
    variance, turned = np.linalg.eigh(maps @ maps.T)
    order = np.argsort(-variance)[:most]
    order = order[variance[order] > LEAST * variance.max(initial=0.0)]
    modes: FloatArray = turned[:, order].T @ maps
    whole = float(variance.sum())
    return modes, float(variance[order].sum()) / whole if whole > 0 else 1.0
