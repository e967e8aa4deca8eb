"""What error a measurement must have: ray noise and line sampling, from the design and the images alone.

Ray noise: counting statistics of each light curve, or the scatter between replicates. Line sampling: the centroid of a
light curve sampled at lines of finite width is not exactly the centroid of the light; the error depends on where the
light falls between the lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.calibration import Calibration, calibrate
from irtscots_cl.centroids import poisson_error
from irtscots_cl.images import ImageStack, jackknife_error
from irtscots_cl.integration import integrate_slopes
from irtscots_cl.reconstruction import Reconstruction
from irtscots_cl.slopes import half_vector_slopes
from irtscots_cl.zonal import remove_terms, rms

NOISE_DRAWS = 32  # maps of random slopes behind the predicted height noise: its own error is a few percent
PIXEL_NODES = 4  # Gauss-Legendre nodes per axis over a detector pixel


@dataclass(frozen=True)
class PredictedError:
    """Predicted rms errors: slopes [rad] as (x, y); heights [mm] with piston and tilt removed."""

    ray_noise_slope: tuple[float, float]
    line_sampling_slope: tuple[float, float]
    ray_noise_height_mm: float
    line_sampling_height_mm: float

    @property
    def slope(self) -> tuple[float, float]:
        """Both parts together, root sum square (x, y) [rad]."""
        x, y = np.hypot(self.ray_noise_slope, self.line_sampling_slope)
        return float(x), float(y)

    @property
    def height_mm(self) -> float:
        """Both parts together, root sum square [mm]."""
        return float(np.hypot(self.ray_noise_height_mm, self.line_sampling_height_mm))


def predict_error(result: Reconstruction, stack: ImageStack) -> PredictedError:
    """Predict the slope and height errors of a reconstruction from its own light curves.

    Ray noise is that of counting the rays behind each curve where they are independent; for other samplers and for lab
    images it is the scatter of the replicates. Where there is neither, the prediction is NaN.
    """
    calibration = calibrate(result.nominal)
    scale = _slope_per_mm(calibration, result)
    mask, noise, bias = result.mask, [], []
    for k, scan in enumerate((stack.x, stack.y)):
        on_grid = np.full(mask.size, np.nan)
        on_grid[scan.pixels] = poisson_error(scan, scan.mean_w())
        counted = on_grid.reshape(mask.shape) * scale[k]
        measured = jackknife_error(result.estimates(f"slope_{scan.axis}"))
        noise.append(np.where(np.isfinite(counted), counted, measured))
        centroid = (result.centroid_x_mm, result.centroid_y_mm)[k]
        bias.append(line_sampling_error(calibration, scan.positions_mm, centroid, mask, k) * scale[k])
    random = np.random.default_rng(0)
    known = all(np.isfinite(part[mask]).any() for part in noise)
    draws = [np.nan_to_num(part) * random.standard_normal((NOISE_DRAWS, *mask.shape)) for part in noise]
    heights = _heights(result, draws[0], draws[1])
    return PredictedError(
        (rms(noise[0], mask), rms(noise[1], mask)) if known else (np.nan, np.nan),
        (rms(bias[0], mask), rms(bias[1], mask)),
        float(np.sqrt(np.mean([rms(h, mask) ** 2 for h in heights]))) if known else np.nan,
        rms(_heights(result, *bias)[0], mask),
    )


def _heights(result: Reconstruction, slope_x: np.ndarray, slope_y: np.ndarray) -> list[np.ndarray]:
    """Heights of slope maps [..., rows, columns], piston and tilt removed, as a list of maps."""
    heights = integrate_slopes(result.x_mm, result.y_mm, slope_x, slope_y, result.mask, result.method)
    return [
        remove_terms(result.x_mm, result.y_mm, h, result.mask, "piston_tilt")
        for h in heights.reshape(-1, *result.mask.shape)
    ]


def _slope_per_mm(calibration: Calibration, result: Reconstruction, step_mm: float = 1e-3) -> list[np.ndarray]:
    """|d slope / d centroid| [rad/mm] of every pixel, along x and y."""
    points = np.stack([result.x_mm, result.y_mm, result.height_mm], -1)
    camera, to_world = calibration.camera_frame.position_mm, calibration.screen_frame.to_world
    centre = half_vector_slopes(points, to_world(result.centroid_x_mm, result.centroid_y_mm), camera)
    x = half_vector_slopes(points, to_world(result.centroid_x_mm + step_mm, result.centroid_y_mm), camera)
    y = half_vector_slopes(points, to_world(result.centroid_x_mm, result.centroid_y_mm + step_mm), camera)
    return [np.abs(x[0] - centre[0]) / step_mm, np.abs(y[1] - centre[1]) / step_mm]


def line_sampling_error(
    calibration: Calibration, positions_mm: np.ndarray, centroid_mm: np.ndarray, mask: np.ndarray, k: int
) -> np.ndarray:
    """Centroid of a noise-free light curve sampled at the lines, less its true centre: [rows, columns] mm.

    k: 0 for the x scan, 1 for the y scan. The light on the screen is the aperture's image (an ellipse under the pixel's
    local linear map, so its profile is the chord of paper Eq. 2) spread over the pixel's own image.
    """
    half_width, box_row, box_column = calibration.light_shape(k)
    half_width, box_row, box_column, centre = (v[mask] for v in (half_width, box_row, box_column, centroid_mm))
    pitch = positions_mm[1] - positions_mm[0] if len(positions_mm) > 1 else calibration.scene.screen.pitch_mm
    reach = int(np.ceil(np.max(half_width + (box_row + box_column) / 2) / pitch)) + 1
    nearest = np.rint((centre - positions_mm[0]) / pitch)
    lines = positions_mm[0] + pitch * (nearest[:, None] + np.arange(-reach, reach + 1))  # [n, lines]
    node, weight = np.polynomial.legendre.leggauss(PIXEL_NODES)
    flux = np.zeros(lines.shape)
    for a, weight_a in zip(node / 2, weight / 2, strict=True):
        for b, weight_b in zip(node / 2, weight / 2, strict=True):
            shifted = lines - (centre + a * box_row + b * box_column)[:, None]
            upper, lower = (chord_cdf((shifted + side * pitch / 2) / half_width[:, None]) for side in (1, -1))
            flux += weight_a * weight_b * (upper - lower)
    error = np.full(mask.shape, np.nan)
    error[mask] = (flux * (lines - centre[:, None])).sum(1) / flux.sum(1)
    return error


def chord_cdf(t: np.ndarray) -> np.ndarray:
    """Share of a unit disk's area at x < t: paper Eq. 2, (t sqrt(1 - t^2) + asin t) / pi + 1/2, t cut to [-1, 1]."""
    t = np.clip(t, -1.0, 1.0)
    return 0.5 + (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / np.pi
