"""Standard errors of slopes and heights from those of the centroids: no replicates are needed.

The centroids' errors of different pixels are independent, since each comes from its own samples. Slopes depend on them
through the triangulation's derivatives, heights through the integration; both are linear in such small changes. The
heights' errors come from random draws, since integration couples all pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.slopes import deconvolve_pixel, half_vector_slopes

STEP_MM = 1e-3  # on the screen, for derivatives
MAX_DRAWS = 400  # the standard errors are then known to 3.5 %
VALUES = 1_000_000  # pixels times draws: larger maps get fewer draws,
MIN_DRAWS = 100  # at least so many: 7 %
AT_ONCE = 50


@dataclass(frozen=True)
class ErrorBars:
    """Standard errors from the noise of the images. slope_x, slope_y: [rows, columns] rad. height_mm: [rows, columns],
    piston and tilt removed, with the stated errors of joined islands. draws_mm: [draws, rows, columns] height maps of
    such noise, for the errors of what is computed from a height map."""

    slope_x: FloatArray = field(repr=False)
    slope_y: FloatArray = field(repr=False)
    height_mm: FloatArray = field(repr=False)
    draws_mm: FloatArray = field(repr=False)


def error_bars(result: Reconstruction, seed: int = 0) -> ErrorBars | None:
    """The standard errors of a result from its centroids' errors; None where the measure does not give those."""
    mask = result.mask
    errors = _place_errors(result)
    if errors is None:
        return None
    (x_by_u, y_by_u), (x_by_v, y_by_v) = slope_derivatives(result)
    random = np.random.default_rng(seed)
    count = int(np.clip(VALUES // max(int(mask.sum()), 1), MIN_DRAWS, MAX_DRAWS))
    draws, squares = [], np.zeros((2, *mask.shape))
    for first in range(0, count, AT_ONCE):
        u, v = (error * random.standard_normal((min(AT_ONCE, count - first), *mask.shape)) for error in errors)
        slopes = [np.where(mask, by_u * u + by_v * v, 0.0) for by_u, by_v in ((x_by_u, x_by_v), (y_by_u, y_by_v))]
        if not result.pixel_average:
            slopes = [deconvolve_pixel(slope, mask) for slope in slopes]
        x, y = slopes
        squares += [np.sum(slope**2, axis=0) for slope in slopes]
        draws.append(integrate_slopes(result.x_mm, result.y_mm, x, y, mask, result.method, result.join))
    heights = np.concatenate(draws)
    joining = result.joining_errors_mm()
    bare, steps = (
        sum(remove_terms(result.x_mm, result.y_mm, h, result.height_mask, "piston_tilt") ** 2 for h in maps)
        / max(len(maps), 1)
        for maps in (heights, joining)
    )
    slope_x, slope_y = np.where(mask, np.sqrt(squares / count), np.nan)
    return ErrorBars(slope_x, slope_y, np.sqrt(bare + steps), heights)


def _place_errors(result: Reconstruction) -> list[FloatArray] | None:
    """Standard errors [rows, columns] in mm of the places u, v on the screen, 0 outside the mask; None if unknown."""
    mask = result.mask
    if result.place_errors_mm is not None:
        return [np.where(mask, error, 0.0) for error in result.place_errors_mm]
    if result.estimates_of_scans is None:
        return None
    errors = []
    for estimate in result.estimates_of_scans:
        on_grid = np.full(mask.size, np.nan)
        on_grid[estimate.scan.pixels] = estimate.error_mm
        errors.append(np.where(mask, on_grid.reshape(mask.shape), 0.0))
    return errors


def slope_derivatives(result: Reconstruction) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Derivatives [rows, columns] in rad/mm of the slopes (x, y) by the centroid's u, and those by its v."""
    chief = result.setup.chief_rays
    points = np.stack([result.x_mm, result.y_mm, result.height_mm], -1)
    camera, u, v = chief.camera_frame.position_mm, result.centroid_x_mm, result.centroid_y_mm

    def slopes(du: float, dv: float) -> tuple[FloatArray, FloatArray]:
        return half_vector_slopes(points, chief.screen_model.seen_from(points, u + du, v + dv), camera)

    x, y = slopes(0.0, 0.0)
    along_u, along_v = slopes(STEP_MM, 0.0), slopes(0.0, STEP_MM)
    return (
        ((along_u[0] - x) / STEP_MM, (along_u[1] - y) / STEP_MM),
        ((along_v[0] - x) / STEP_MM, (along_v[1] - y) / STEP_MM),
    )
