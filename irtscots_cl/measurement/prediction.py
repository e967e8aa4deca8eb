"""Predicted errors of a measurement: ray noise and line sampling, from the design and the images only.

Ray noise: counting statistics of each light curve, or the scatter between replicates. Line sampling: the centroid of a
light curve sampled by lines of finite width differs from the centroid of the light; the error depends on the position
of the light between the lines.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.measurement.centroids import poisson_error
from irtscots_cl.measurement.error_bars import ErrorBars, error_bars, slope_derivatives
from irtscots_cl.measurement.light_profiles import sampling_error
from irtscots_cl.measurement.line_edges import uncovered
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.slopes import deconvolve_pixel
from irtscots_cl.measurement.surface_heights import Pair
from irtscots_cl.measurement.systematic_error import SystematicError, systematic_error

SHARPENED = float(np.hypot(7 / 6, 2 / 24))  # by which deconvolve_pixel multiplies the rms of independent noise
LOST_SHARE = 0.02  # of the pixels: as many without a model leave the rms as it is
NOISE_DRAWS = 32  # maps of random slopes for the predicted height noise; its own error is a few percent
FEW_DRAWS, MANY_PIXELS = 8, 2**18  # the same for larger detectors, whose maps take long: twice that error


@dataclass(frozen=True)
class PredictedError:
    """Predicted rms errors: slopes [rad] as (x, y); heights [mm] of height_mask, with piston and tilt removed.

    systematic: of the whole measurement without noise, line sampling included; None where it was not asked for or has
    no model, and then line sampling stands for it. rounding_height_mm: of the device's arithmetic. bound: the height is
    no estimate but a bound, for the reasons in `why`. line_sampling: maps of the slope errors [rad] from it.
    """

    ray_noise_slope: tuple[float, float]
    line_sampling_slope: tuple[float, float]
    ray_noise_height_mm: float
    line_sampling_height_mm: float
    systematic: SystematicError | None = None
    rounding_height_mm: float = 0.0
    unresolved_height_mm: float = 0.0
    why: str = ""
    line_sampling: Pair | None = field(default=None, repr=False, compare=False)

    @property
    def bound(self) -> bool:
        return bool(self.why)

    @property
    def slope(self) -> tuple[float, float]:
        """Root sum square of all contributions, (x, y) in rad."""
        steady = self.line_sampling_slope if self.systematic is None else self.systematic.slope
        x, y = np.hypot(self.ray_noise_slope, steady)
        return float(x), float(y)

    @property
    def systematic_height_mm(self) -> float:
        """What is left without noise and with exact arithmetic, in mm."""
        return self.line_sampling_height_mm if self.systematic is None else self.systematic.height_mm

    @property
    def height_mm(self) -> float:
        """Root sum square of all contributions, in mm."""
        parts = (self.ray_noise_height_mm, self.systematic_height_mm, self.rounding_height_mm,
                 self.unresolved_height_mm)  # fmt: skip
        return float(np.linalg.norm(parts))


def predict_error(
    result: Reconstruction,
    stack: ImageStack,
    *,
    systematic: bool = True,
    rounding_height_mm: float = 0.0,
    bars: ErrorBars | None = None,
) -> PredictedError:
    """Predict the slope and height errors of a reconstruction from the design and from its own light curves.

    Noise comes from the images themselves for signed samples (error_bars.py); else from counting statistics of each
    curve's rays if these are independent, and from the scatter of the replicates for other samplers. The prediction is
    NaN if neither is available. systematic: also predict what is left without noise (systematic_error.py), which costs
    about as much as the measurement; false: line sampling alone. rounding_height_mm: of the trace's arithmetic, for a
    simulation. bars: error_bars(result), where they are there already.
    """
    along_u, along_v = slope_derivatives(result)
    scale = [np.abs(along_u[0]), np.abs(along_v[1])]
    mask = result.mask
    sampled = [_line_sampling(result, scan) for scan in (stack.x, stack.y)]
    bias = [error * factor for error, factor in zip(sampled, scale, strict=True)]
    noise, heights = _noise(result, stack, scale, bars or error_bars(result))
    known = bool(heights)
    unresolved = _unresolved(result, stack, scale)
    steady = systematic_error(result, stack, np.stack(heights) if known else None) if systematic else None
    return PredictedError(
        (rms(noise[0], mask), rms(noise[1], mask)) if known else (np.nan, np.nan),
        (rms(bias[0], mask), rms(bias[1], mask)),
        float(np.sqrt(np.mean([rms(h, result.height_mask) ** 2 for h in heights]))) if known else np.nan,
        rms(_heights(result, *bias)[0], result.height_mask),
        steady,
        rounding_height_mm,
        unresolved,
        _why_bound(result, steady, unresolved) if systematic else "",
        _slopes_of(result, sampled, (along_u, along_v)),
    )


def _noise(
    result: Reconstruction, stack: ImageStack, scale: list[FloatArray], bars: ErrorBars | None
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Standard errors of the slopes [rows, columns], and height maps of such noise, piston and tilt removed; no maps
    where the noise is not known."""
    mask = result.mask
    if bars is not None:
        maps = [remove_terms(result.x_mm, result.y_mm, h, result.height_mask, "piston_tilt") for h in bars.draws_mm]
        return [bars.slope_x, bars.slope_y], maps
    noise = []
    sharpened = 1.0 if result.pixel_average else SHARPENED
    for k, scan in enumerate((stack.x, stack.y)):
        on_grid = np.full(mask.size, np.nan)
        on_grid[scan.pixels] = poisson_error(scan, scan.mean_w())
        counted = on_grid.reshape(mask.shape) * scale[k]
        measured = jackknife_error(result.estimates(f"slope_{scan.axis}")) / sharpened
        noise.append(np.where(np.isfinite(counted), counted, measured))
    if not all(np.isfinite(part[mask]).any() for part in noise):
        return noise, []
    random = np.random.default_rng(0)
    count = NOISE_DRAWS if mask.size <= MANY_PIXELS else FEW_DRAWS
    draws = [np.nan_to_num(part) * random.standard_normal((count, *mask.shape)) for part in noise]
    if not result.pixel_average:  # sharpening makes noise of neighbours differ more, which integration evens out
        draws = [deconvolve_pixel(part, mask) for part in draws]
        noise = [part * sharpened for part in noise]
    return noise, _heights(result, draws[0], draws[1])


def _why_bound(result: Reconstruction, steady: SystematicError | None, unresolved_mm: float) -> str:
    """Why the predicted height is a bound and no estimate; "" for an estimate."""
    reasons = []
    if unresolved_mm > 0:
        reasons.append("light narrower than the lines")
    if steady is None or steady.lost > LOST_SHARE * int(result.height_mask.sum()):
        reasons.append("pixels without a model")
    if steady is not None and not steady.settled:
        reasons.append("the measured surface does not explain its own images")
    return ", ".join(reasons)


def _unresolved(result: Reconstruction, stack: ImageStack, scale: list[FloatArray]) -> float:
    """Rms height in mm, piston and tilt removed, that light narrower than a line may hide; 0 if it hides nothing.

    A line does not tell where in it such light falls, nor a gap between lines: the slopes are uncertain by the rest of
    the width, evenly. All pixels may err alike where their light covers no more than a line together, and then as
    power, which makes the most height; over many lines such errors alternate.
    """
    light, mask, slopes = result.setup.pixel_light, result.mask, []
    x, y = (np.where(mask, v - np.mean(v[mask]), 0.0) for v in (result.x_mm, result.y_mm))
    radius = np.hypot(x, y).max() or 1.0
    found = ((result.centroid_x_mm, x), (result.centroid_y_mm, y))
    for k, (scan, (centroid, place)) in enumerate(zip((stack.x, stack.y), found, strict=True)):
        pitch = np.diff(scan.positions_mm).mean() if len(scan.positions_mm) > 1 else 0.0
        extent = np.full(mask.size, np.nan)
        extent[light.pixels] = 2 * light.extent("uv"[k])[1]
        rest = np.maximum(np.nan_to_num(pitch * uncovered(scan.line_width) - extent.reshape(mask.shape)), 0.0)
        alike = min(1.0, pitch / max(float(np.ptp(centroid[mask])), 1e-12))
        # rms of a slope that grows evenly from the middle of a disk is half of the rim's
        slopes.append(np.where(mask, rest / np.sqrt(12) * scale[k] * alike * 2 * place / radius, 0.0))
    return rms(_heights(result, *slopes)[0], mask) if np.any(slopes) else 0.0


def _line_sampling(result: Reconstruction, scan: Scan) -> FloatArray:
    """Error [rows, columns] in mm of the centroids from sampling by lines; 0 where the model removes it."""
    left = np.where(result.mask, 0.0, np.nan)
    if result.light_curve != "centroid" or result.updates_nm:
        return left
    light, axis = result.setup.pixel_light, "xy".index(scan.axis)
    centroid = (result.centroid_x_mm, result.centroid_y_mm)[axis].ravel()[light.pixels]
    error = sampling_error(scan.positions_mm, light, "uv"[axis], centroid, line_width=scan.line_width)
    left.ravel()[light.pixels] += np.nan_to_num(error)
    return left


def _slopes_of(result: Reconstruction, places: list[FloatArray], derivatives: tuple[Pair, Pair]) -> Pair | None:
    """Errors of slope_x, slope_y [rows, columns] in rad from errors of the centroids in mm; None if there are none.

    derivatives: error_bars.slope_derivatives(result).
    """
    if not np.any(np.nan_to_num(places)):
        return None
    x, y = (places[0] * by_u + places[1] * by_v for by_u, by_v in zip(*derivatives, strict=True))
    return (x, y) if result.pixel_average else (deconvolve_pixel(x, result.mask), deconvolve_pixel(y, result.mask))


def _heights(result: Reconstruction, slope_x: FloatArray, slope_y: FloatArray) -> list[FloatArray]:
    """Heights of slope maps [..., rows, columns], piston and tilt removed, as a list of maps."""
    heights = integrate_slopes(result.x_mm, result.y_mm, slope_x, slope_y, result.mask, result.method, result.join)
    return [
        remove_terms(result.x_mm, result.y_mm, h, result.height_mask, "piston_tilt")
        for h in heights.reshape(-1, *result.mask.shape)
    ]
