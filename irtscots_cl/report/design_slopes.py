"""Slopes less those of the design, whose own are thousands of times what a test is about."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.reconstruction import Reconstruction


def slopes_from_design(result: Reconstruction) -> dict[str, FloatArray]:
    """By axis "x" and "y": slope [rows, columns] less the design's at the same mirror point; NaN outside the mask."""
    design = result.setup.nominal.chief_rays.surface.gradient(result.x_mm, result.y_mm)
    both = {"x": (result.slope_x, design[0]), "y": (result.slope_y, design[1])}
    return {axis: np.where(result.mask, slope - own, np.nan) for axis, (slope, own) in both.items()}
