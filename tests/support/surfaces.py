"""Results of a measurement, made from the true surface without any images."""

from __future__ import annotations

import numpy as np

from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface


def exact(scene, pixels: int = 31) -> Reconstruction:
    """What a measurement without any error would give, on a square grid over the mirror's inner 98 %."""
    radius = scene.mirror.diameter_mm / 2
    grid = np.linspace(-radius, radius, pixels)
    x, y = np.meshgrid(grid, grid)
    mask = np.hypot(x, y) < 0.98 * radius
    x, y = np.where(mask, x, np.nan), np.where(mask, y, np.nan)
    surface = Surface.of(scene.mirror)
    slope_x, slope_y = surface.gradient(x, y)
    deviation = surface.deviation_at(x, y)[0]
    none = np.zeros((0, *mask.shape))
    good = np.zeros(mask.shape, int)
    return Reconstruction(
        setup=Setup(scene.nominal()),
        light_curve="centroid",
        method="southwell",
        pixel_average=True,
        x_mm=x,
        y_mm=y,
        on_mirror=mask,
        mask=mask,
        flags=good,
        centroid_x_mm=x * 0,
        centroid_y_mm=x * 0,
        slope_x=slope_x,
        slope_y=slope_y,
        height_mm=surface.sag(x, y),
        deviation_mm=deviation,
        jackknife_slope_x=none,
        jackknife_slope_y=none,
        jackknife_deviation_mm=none,
    )
