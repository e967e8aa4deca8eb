"""Speed against error: every kind of trace, from few rays to many, with every measurement method.

Each setting runs with independent seeds, one replicate each. Their scatter is the ray noise. The rest of the error is
the method's floor, which is also the error with noise-free images in closed form.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import numpy as np

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.analysis.error_terms import rounding_height_nm
from irtscots_cl.bench.fits import fit_exponent
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.methods import MEASURES, measure_by
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.options import ANALYTIC, TraceOptions
from irtscots_cl.tracing.samplers import SAMPLERS
from irtscots_cl.tracing.trace import trace

SCENE = "sphere-deviated"
SEEDS = {True: 2, False: 3}  # quick or not
# Rays per pixel: four decades for each estimator, up to about ten seconds on two cores
RAYS = {
    "forward": (1562, 15_625, 156_250, 1_562_500, 15_625_000),
    "adjoint": tuple(16 * 4**k for k in range(8)),
    "smoothed": tuple(4 * 4**k for k in range(8)),
}
QUICK_RAYS = {"forward": (2**15, 2**17), "adjoint": (64, 256), "smoothed": (16, 64)}
MIN_USED = 0.9  # of the pixels on the mirror: with fewer pixels, the errors are not comparable
QUICK_MEASURES = ("paper", "fine")

# The paper's runs of this scene: rays per screen pixel, slope errors x, y in urad and height error in nm (its Table 5).
PAPER = ((156_250, 2.6735, 2.7937, 6.69), (1_562_500, 0.8678, 0.9058, 2.32), (15_625_000, 0.3586, 0.4263, 1.05))
PAPER_RAYS_PER_SECOND = 31_250  # 5 s for 156,250 rays (its section 2.3), of each of 21 x 21 screen pixels


@dataclass(frozen=True)
class Series:
    """A kind of trace and its numbers of rays per pixel. kind: key of RAYS."""

    kind: str
    options: TraceOptions
    rays: tuple[int, ...]
    measures: tuple[str, ...]

    @property
    def name(self) -> str:
        return f"{self.kind}, {self.options.sampler}, {self.options.precision}"


def default_series(device: Device, quick: bool) -> list[Series]:
    """Estimators x samplers in single precision, and Sobol points also in double precision.

    Refinement takes seconds, so it is measured only for the smoothed Sobol points.
    """
    found = []
    for kind in RAYS:
        for sampler in ("sobol",) if quick else SAMPLERS:
            for precision in ("fp32", "fp64") if sampler == "sobol" and device.has_fp64 and not quick else ("fp32",):
                options = TraceOptions("adjoint" if kind == "smoothed" else kind, sampler, precision,
                                       smoothing=kind == "smoothed")  # fmt: skip
                measures = tuple(MEASURES) if kind == "smoothed" and sampler == "sobol" else QUICK_MEASURES
                found.append(Series(kind, options, (QUICK_RAYS if quick else RAYS)[kind],
                                    QUICK_MEASURES if quick else measures))  # fmt: skip
    return found


def run_accuracy(device: Device, quick: bool) -> dict:
    """The sweep as plain data: points (marked if on the front), the series' exponents, floors, the paper's runs."""
    setup = Setup(load_scene(SCENE))  # shared, so that the times are those of tracing and measuring alone
    points, exponents = _analytic(setup, QUICK_MEASURES if quick else tuple(MEASURES)), []
    floors = [{key: point[key] for key in ("measure", "slope_error_urad", "height_error_nm")} for point in points]
    for series in default_series(device, quick):
        found = [_point(setup, device, series, rays, SEEDS[quick]) for rays in series.rays]
        exponents += _exponents(series, found)
        points += [row for rows in found for row in rows]
    return {
        "scene": setup.scene.name,
        "seeds": SEEDS[quick],
        "points": mark_front(points),
        "exponents": exponents,
        "floors": floors,
        "rounding_height_nm": _rounding(setup, device),
        "paper": paper_runs(),
    }


def paper_runs() -> list[dict]:
    """The paper's points."""
    return [{"rays_per_pixel": rays, "seconds": 21 * 21 * rays / PAPER_RAYS_PER_SECOND,
             "slope_error_urad": float(np.hypot(x, y) / np.sqrt(2)), "height_error_nm": nm}
            for rays, x, y, nm in PAPER]  # fmt: skip


def _analytic(setup: Setup, measures: tuple[str, ...]) -> list[dict]:
    """The analytic estimator's points: without noise, they are each method's floor."""
    run = trace(setup, estimator=ANALYTIC)
    stack = run.images(LineScan(setup.scene))
    _measured(measures[0], stack, setup)
    run = trace(setup, estimator=ANALYTIC)  # warm, like all others
    return [_row(setup.scene, "analytic", run.options, 0, [run.seconds["trace"]], name, [_measured(name, stack, setup)])
            for name in measures]  # fmt: skip


def _point(setup: Setup, device: Device, series: Series, rays: int, seeds: int) -> list[dict]:
    """One setting: a row for each method."""
    o, runs = series.options, []
    for seed in range(1, 1 + seeds):
        runs.append(trace(setup, device=device, estimator=o.estimator, sampler=o.sampler, precision=o.precision,
                          smoothing=o.smoothing, rays_per_pixel=rays, replicates=1, seed=seed))  # fmt: skip
    seconds = [run.seconds["trace"] for run in runs]
    rows = []
    for name in series.measures:
        try:
            found = [_measured(name, run.images(LineScan(setup.scene)), setup) for run in runs]
        except ValueError:  # too few rays: hardly any pixel has light
            continue
        if min(result.pixels_used / result.on_mirror.sum() for result, _ in found) < MIN_USED:
            continue
        rows.append(_row(setup.scene, series.kind, o, rays, seconds, name, found) | {"rays": runs[0].rays_total})
    return rows


def _measured(name: str, stack: ImageStack, setup: Setup) -> tuple[Reconstruction, float]:
    started = time.perf_counter()
    result = measure_by(name, stack, setup.nominal)
    return result, time.perf_counter() - started


def _row(scene, kind, options, rays_per_pixel, trace_seconds, measure, found) -> dict:
    """A point as plain data, from the results of all seeds."""
    results, seconds = zip(*found, strict=True)
    errors = [compare(result, scene) for result in results]
    slope = [np.sqrt(np.mean([e.value**2 for e in error.slope_error_urad.values()])) for error in errors]
    height = [error.height_error_nm["piston_tilt"].value for error in errors]
    return {
        "kind": kind, "sampler": options.sampler, "precision": options.precision, "measure": measure,
        "rays_per_pixel": rays_per_pixel, "rays": 0, "pixels_used": min(r.pixels_used for r in results),
        "trace_seconds": _spread(trace_seconds), "measure_seconds": _spread(seconds),
        "slope_error_urad": _mean(slope), "height_error_nm": _mean(height),
        "slope_noise_urad": _noise(results, _slopes), "height_noise_nm": _noise(results, _height),
    }  # fmt: skip


def _spread(seconds) -> dict[str, float]:
    return {"median": statistics.median(seconds), "lowest": min(seconds), "highest": max(seconds)}


def _mean(values: list[float]) -> dict[str, float]:
    """Mean over the seeds and its standard error, NaN for a single seed."""
    error = np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    return {"value": float(np.mean(values)), "standard_error": float(error)}


def _slopes(result: Reconstruction) -> np.ndarray:
    return np.stack([result.slope_x, result.slope_y]) * 1e6


def _height(result: Reconstruction) -> np.ndarray:
    return remove_terms(result.x_mm, result.y_mm, result.deviation_mm, result.height_mask, "piston_tilt")[None] * 1e6


def _noise(results: tuple[Reconstruction, ...], quantity) -> float:
    """Rms scatter between the seeds, over the pixels that all results have; 0 without rays (a single result)."""
    if len(results) == 1:
        return 0.0
    mask = np.all([r.height_mask for r in results], axis=0)
    variance = np.var([quantity(r) for r in results], axis=0, ddof=1)
    return float(np.sqrt(np.mean([rms(np.sqrt(v), mask) ** 2 for v in variance])))


def _exponents(series: Series, found: list[list[dict]]) -> list[dict]:
    """How the noise falls with the number of rays, for each method: noise ~ rays^exponent over the whole range."""
    rows = [row for of_rays in found for row in of_rays]
    out = []
    for name in series.measures:
        mine = [row for row in rows if row["measure"] == name]
        if len(mine) < 2:
            continue
        fits = {
            key: fit_exponent(
                [row["rays_per_pixel"] for row in mine], np.array([[row[f"{key}_noise_{unit}"]] for row in mine])
            )
            for key, unit in (("slope", "urad"), ("height", "nm"))
        }
        out.append({"kind": series.kind, "sampler": series.options.sampler, "precision": series.options.precision,
                    "measure": name, **fits})  # fmt: skip
    return out


def _rounding(setup: Setup, device: Device) -> float:
    """Height error in nm of single precision, for any number of rays; 0 if it cannot be determined."""
    options = TraceOptions("adjoint", "sobol", smoothing=True)
    run = trace(setup, device=device, sampler="sobol", smoothing=True, rays_per_pixel=64, replicates=1)
    result = measure_by("paper", run.images(LineScan(setup.scene)), setup.nominal)
    return rounding_height_nm(result, setup, options, device)


def seconds_of(point: dict) -> float:
    """Seconds of tracing and measuring together."""
    return point["trace_seconds"]["median"] + point["measure_seconds"]["median"]


def mark_front(points: list[dict]) -> list[dict]:
    """The points, each with "on_front": whether no other point is both faster and more accurate in height."""
    best, front = np.inf, set()
    for k in sorted(range(len(points)), key=lambda k: (seconds_of(points[k]), points[k]["height_error_nm"]["value"])):
        if points[k]["height_error_nm"]["value"] < best:
            best = points[k]["height_error_nm"]["value"]
            front.add(k)
    return [point | {"on_front": k in front} for k, point in enumerate(points)]
