"""The terms of a height error: ray noise, rounding, line sampling, height coupling, pixels, edges, integration.

Heights are linear in the slopes, so the error is a sum of maps. Each error term is the change when the input of one
step is replaced by the exact input: the images by noise-free ones in closed form, their centroids by those of the
light, the measured height by the true one, the slopes by the true ones at the nodes. The maps add up to the whole
error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.centroids import centroids
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import Reconstruction, design_points
from irtscots_cl.measurement.slopes import deconvolve_pixel
from irtscots_cl.measurement.surface_heights import triangulated
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.options import ANALYTIC, TraceOptions, can_smooth
from irtscots_cl.tracing.trace import trace

ROUNDING_RAYS = 1024  # per pixel, smoothed: the same rays in both precisions, so that little noise remains
WHOLE = 1 - 1e-9  # coverage of a pixel that the mirror's rim does not cross


@dataclass(frozen=True)
class ErrorTerm:
    """One term of an error. slope_urad: rms (x, y) over the mask, NaN for a term without slopes. height_mm: map [rows,
    columns] without piston and tilt; height_nm: its rms."""

    name: str
    slope_urad: tuple[float, float]
    height_nm: float
    height_mm: np.ndarray


def error_terms(
    result: Reconstruction,
    scene: Scene | Setup,
    measure: str,
    options: TraceOptions,
    device: Device | Sequence[Device] | None = None,
) -> tuple[ErrorTerm, ...]:
    """The terms of a result's height error against the scene's true mirror, in the order of the measurement.

    measure: the result's method, a name in methods.MEASURES. options: the options of its trace. device: computes the
    term of float rounding. This term is separate for the adjoint estimator in single precision, on a device that also
    has double precision; otherwise it is included in the ray noise. Pixels without light in closed form, if any, have
    their own term.
    """
    setup = Setup.of(scene)
    scene = setup.scene
    free = measure_by(measure, trace(setup, estimator=ANALYTIC).images(LineScan(scene)), result.setup)
    known = result.mask & free.mask
    surface = Surface.of(scene.mirror)
    truth = surface.deviation_at(result.x_mm, result.y_mm)[0]
    first = device if device is None or isinstance(device, Device) else device[0]
    rounding = _rounding(result, setup, options, first)
    if result.updates_nm:
        slopes, heights = _refined(result, free, surface, truth)
    else:
        slopes, heights = _stages(result, free, setup, surface), {}
    if rounding is not None:
        slopes["ray noise"] = slopes["ray noise"] - rounding
        slopes = {"ray noise": slopes.pop("ray noise"), "float rounding": rounding, **slopes}
    slopes = {name: np.where(known, np.nan_to_num(part), 0.0) for name, part in slopes.items()}
    integrated = {name: _integrate(result, part) for name, part in slopes.items()}
    if not result.updates_nm:
        own = np.where(known, np.nan_to_num(np.stack(surface.deviation_at(result.x_mm, result.y_mm)[1:])), 0.0)
        heights = {"integration": _integrate(result, own) - np.where(known, truth, 0.0)}
    elif rounding is not None:
        heights["ray noise"] = heights["ray noise"] - integrated["float rounding"]
    heights = {name: np.where(known, height, 0.0) for name, height in (integrated | heights).items()}
    if not known[result.mask].all():
        heights["pixels without a closed form"] = result.deviation_mm - truth - sum(heights.values())
    return tuple(_part(result, name, slopes.get(name), height) for name, height in heights.items())


def _stages(result: Reconstruction, free: Reconstruction, setup: Setup, surface: Surface) -> dict[str, np.ndarray]:
    """Slope maps [2, rows, columns] of the stages' errors, for a result without refinement."""
    design, x, y = result.setup.chief_rays, result.x_mm, result.y_mm
    true_height = surface.sag(x, y)
    own = np.stack(triangulated(design, x, y, design.surface.sag(x, y), *design_points(result.setup)[2:]))

    def measured(z_mm, u_mm, v_mm) -> np.ndarray:  # measured slopes from centroids and height
        return _averaged(result, np.stack(triangulated(design, x, y, z_mm, u_mm, v_mm)) - own)

    light = setup.pixel_response
    means = np.full((2, result.mask.size), np.nan)
    means[:, light.pixels] = light.means("uv")
    means = means.reshape(2, *result.mask.shape)
    by_curves = measured(true_height, free.centroid_x_mm, free.centroid_y_mm)
    by_light = measured(true_height, *means)
    found = np.stack([free.slope_x, free.slope_y]) - np.stack(design.surface.gradient(x, y))
    pixels = by_light - np.stack(surface.deviation_at(x, y)[1:])
    whole = design.footprint.coverage > WHOLE
    return {
        "ray noise": np.stack([result.slope_x - free.slope_x, result.slope_y - free.slope_y]),
        "line sampling": by_curves - by_light,
        "height coupling": found - by_curves,
        "pixel averaging": np.where(whole, pixels, 0.0),
        "edge pixels": np.where(whole, 0.0, pixels),
    }


def _refined(result: Reconstruction, free: Reconstruction, surface: Surface, truth: np.ndarray):
    """Slope and height maps of a refined result, which is no longer a sum over stages."""
    true_slopes = surface.gradient(result.x_mm, result.y_mm)
    slopes = {
        "ray noise": np.stack([result.slope_x - free.slope_x, result.slope_y - free.slope_y]),
        "left by refinement": np.stack([free.slope_x - true_slopes[0], free.slope_y - true_slopes[1]]),
    }
    heights = {"ray noise": result.deviation_mm - free.deviation_mm, "left by refinement": free.deviation_mm - truth}
    return slopes, heights


def _rounding(result: Reconstruction, setup: Setup, options: TraceOptions, device: Device | None) -> np.ndarray | None:
    """Slopes [2, rows, columns] in single minus double precision, of the same rays; None if not separated."""
    if options.estimator != "adjoint" or options.precision != "fp32" or device is None or not device.has_fp64:
        return None
    design, scene = result.setup.chief_rays, setup.scene
    slopes = []
    for precision in ("fp32", "fp64"):
        run = trace(setup, device=device, precision=precision, sampler=options.sampler, seed=options.seed,
                    smoothing=can_smooth(scene), rays_per_pixel=ROUNDING_RAYS, replicates=1)  # fmt: skip
        stack, landing = run.images(LineScan(scene)), np.full((2, result.mask.size), np.nan)
        for on_grid, scan in zip(landing, (stack.x, stack.y), strict=True):
            on_grid[scan.pixels] = centroids(scan, scan.mean_w())
        landing = landing.reshape(2, *result.mask.shape)
        slopes.append(np.stack(triangulated(design, result.x_mm, result.y_mm, result.height_mm, *landing)))
    return _averaged(result, slopes[0] - slopes[1])


def rounding_height_nm(result: Reconstruction, scene: Scene | Setup, options: TraceOptions, device: Device) -> float:
    """Rms height error of rounding in nm, without piston and tilt, as in error_terms; 0 if it is not separated."""
    slopes = _rounding(result, Setup.of(scene), options, device)
    if slopes is None:
        return 0.0
    return _part(result, "float rounding", None, _integrate(result, np.where(result.mask, slopes, 0.0))).height_nm


def _averaged(result: Reconstruction, slopes: np.ndarray) -> np.ndarray:
    return slopes if result.pixel_average else deconvolve_pixel(slopes, result.mask)


def _integrate(result: Reconstruction, slopes: np.ndarray) -> np.ndarray:
    return integrate_slopes(result.x_mm, result.y_mm, *slopes, result.mask, result.method, result.join)


def _part(result: Reconstruction, name: str, slopes: np.ndarray | None, height: np.ndarray) -> ErrorTerm:
    height = remove_terms(result.x_mm, result.y_mm, height, result.height_mask, "piston_tilt")
    known = slopes if slopes is not None else np.full((2, *result.mask.shape), np.nan)
    slope = tuple(float(np.sqrt(np.mean(s[result.mask] ** 2)) * 1e6) for s in known)
    return ErrorTerm(name, slope, rms(height, result.height_mask) * 1e6, height)
