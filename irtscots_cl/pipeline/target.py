"""The cheapest way to a wanted height error: settings predicted from small pilot runs, then run and checked.

A setting's error has a part that no number of rays removes: its measure's error on noise-free images, and rounding.
Ray noise is added to it and falls as a power of the rays. Pilot runs give both, and the time of a ray.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.analysis.error_terms import rounding_height_nm
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.measurement.methods import MEASURES, NOISE_FREE, measure_by
from irtscots_cl.measurement.prediction import predict_error
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.simulate import Run, simulate
from irtscots_cl.report.types import SettingFacts, Target
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.tracing.options import ANALYTIC, ESTIMATORS, TraceOptions, can_smooth
from irtscots_cl.tracing.trace import trace

REPLICATES = 8
PILOT_RAYS = {"adjoint": (128, 512), "forward": (2**14, 2**16)}  # per pixel: two runs show how fast noise falls
EXPONENTS = (-1.0, -0.5)  # of the noise in the rays: the best possible, and that of independent rays
MARGIN = 0.85  # of the target is planned for: pilots give the noise to some percent
CHEAP_SECONDS = 5.0  # refinement alone takes about as long: it is considered only if nothing is cheaper
RERUNS = 2  # with four times the rays each, if a run misses the target
MAX_RAYS = 2**40


@dataclass(frozen=True)
class Setting:
    """A way to trace and to measure, and its prediction by the pilots. height_nm: piston and tilt removed."""

    estimator: str
    sampler: str
    precision: str
    smoothing: bool
    measure: str
    rays_per_pixel: int
    height_nm: float
    floor_nm: float
    seconds: float


@dataclass(frozen=True)
class _Noise:
    """Ray noise of heights in nm at so many rays per pixel, by measure; how it falls; seconds of a ray per pixel."""

    rays: int
    height_nm: dict[str, float]
    exponent: float
    rounding_nm: float
    seconds: float


def check_target(target_nm: float, estimator: str) -> None:
    """Refuse a target that is no number above 0, or an estimator without rays, with a ValueError."""
    if not 0 < target_nm < np.inf:
        raise OptionError(f"--target-nm = {target_nm}: must be above 0 and finite")
    if estimator not in ESTIMATORS:
        raise OptionError(f"--target-nm: --estimator = {estimator!r}: must be one of {', '.join(ESTIMATORS)}")


def check_without_noise(scene: Scene) -> None:
    """Refuse, with a ValueError, a scene whose camera or screen has noise, which no number of rays removes."""
    tables = {"camera.detector.noise": scene.camera.detector.noise, "screen.response": scene.screen.response}
    for key, table in tables.items():
        if table is not None:
            must = f"must be left out with a table [{key}]: it chooses rays, for images without noise"
            raise OptionError(f"--target-nm: {must}")


def plan(scene: Scene | Setup, target_nm: float, device: Device, **fixed: Any) -> list[Setting]:
    """Settings that are predicted to meet the target, the cheapest first.

    fixed: estimator, sampler, precision, smoothing, measure where the choice is not free. Raises ValueError if none
    meets the target, or for a choice that is out of range.
    """
    check_target(target_nm, fixed.get("estimator", "adjoint"))
    measures = [fixed["measure"]] if "measure" in fixed else list(NOISE_FREE)
    setup = Setup.of(scene)
    noise_free, scene = _noise_free(setup), setup.scene
    pilots = [(way, _pilot(setup, device, way, measures)) for way in _ways(scene, device, fixed)]
    found: list[Setting] = []
    usable: list[Setting] = []
    for name in measures:
        if MEASURES[name].rounds and usable and usable[0].seconds < CHEAP_SECONDS:
            continue
        floor_nm, seconds = _floor(setup, noise_free, name)
        found += [_setting(way, name, noise, floor_nm, seconds, target_nm) for way, noise in pilots]
        usable = sorted((s for s in found if s.rays_per_pixel <= MAX_RAYS), key=lambda s: s.seconds)
    if not usable:
        least = min(found, key=lambda s: s.floor_nm)
        raise OptionError(
            f"--target-nm = {target_nm}: scene {scene.name}: no setting gets there; must be above "
            f"{least.floor_nm / MARGIN:.2g}, the error without ray noise by --measure {least.measure} "
            f"--precision {least.precision}"
        )
    return usable


def _ways(scene: Scene, device: Device, fixed: dict[str, Any]) -> list[TraceOptions]:
    """The ways to trace that are considered: Sobol rays, smoothed if they can be, unless something else was fixed."""
    estimator = fixed.get("estimator", "adjoint")
    precisions = [fixed["precision"]] if "precision" in fixed else ["fp32", "fp64"][: 1 + device.has_fp64]
    sampler, smoothing = (
        fixed.get("sampler", "sobol"),
        fixed.get("smoothing", estimator == "adjoint" and can_smooth(scene)),
    )
    return [TraceOptions(estimator, sampler, precision, smoothing=smoothing) for precision in precisions]


def _noise_free(setup: Setup) -> ImageStack:
    """Images in closed form, the same for all measures."""
    return trace(setup, estimator=ANALYTIC).images(LineScan(setup.scene))


def _floor(setup: Setup, stack: ImageStack, measure: str) -> tuple[float, float]:
    """Height error in nm of a measure on images without noise, and its seconds."""
    started = time.perf_counter()
    result = measure_by(measure, stack, setup.nominal)
    seconds = time.perf_counter() - started
    return compare(result, setup.scene).height_error_nm["piston_tilt"].value, seconds


def _pilot(setup: Setup, device: Device, way: TraceOptions, measures: list[str]) -> _Noise:
    """Two small runs: the noise that the larger one has under each measure, and how it fell from the smaller."""
    simple = {name: "fine" if name == "refined" else name for name in measures}  # refinement leaves noise as it is
    few, many = PILOT_RAYS[way.estimator]
    heights = []
    for rays in (few, many):
        run = trace(setup, device=device, estimator=way.estimator, sampler=way.sampler, precision=way.precision,
                    smoothing=way.smoothing, rays_per_pixel=rays, replicates=REPLICATES)  # fmt: skip
        stack = run.images(LineScan(setup.scene))
        results = {name: measure_by(name, stack, setup.nominal) for name in dict.fromkeys(simple.values())}
        predicted = {name: predict_error(r, stack, systematic=False) for name, r in results.items()}
        heights.append({name: error.ray_noise_height_mm * 1e6 for name, error in predicted.items()})
    any_measure = next(iter(results))
    fell = np.log(heights[1][any_measure] / heights[0][any_measure]) / np.log(many / few)
    return _Noise(
        many,
        {name: heights[1][simple[name]] for name in measures},
        float(np.clip(fell, *EXPONENTS)),
        rounding_height_nm(results[any_measure], setup, way, device),
        run.seconds["trace"] / many,
    )


def _setting(way: TraceOptions, measure: str, noise: _Noise, floor_nm: float, seconds: float, target: float) -> Setting:
    """The rays that a way and a measure need; more than MAX_RAYS if no number of rays is enough."""
    floor_nm = float(np.hypot(floor_nm, noise.rounding_nm))
    room = (MARGIN * target) ** 2 - floor_nm**2
    rays = MAX_RAYS + 1
    if room > 0:
        wanted = noise.rays * (np.sqrt(room) / noise.height_nm[measure]) ** (1 / noise.exponent)
        rays = REPLICATES * 2 ** int(np.ceil(np.log2(max(wanted / REPLICATES, 1.0))))  # Sobol points like powers of two
    left = noise.height_nm[measure] * (rays / noise.rays) ** noise.exponent
    return Setting(way.estimator, way.sampler, way.precision, way.smoothing, measure, rays,
                   float(np.hypot(floor_nm, left)), floor_nm, seconds + rays * noise.seconds)  # fmt: skip


def run_to_target(
    scene: Scene | Setup,
    target_nm: float,
    *,
    device: Device,
    seed: int = 1,
    parts: bool = False,
    zernike: str = "circular",
    progress: Callable[[int, int], None] | None = None,
    **fixed: Any,
) -> Run:
    """Run the cheapest setting that is predicted to meet the target, with more rays if it misses.

    fixed: see `plan`. The run's report has under "target" the wanted, the predicted and the reached error. Raises
    ValueError as `plan` does, and for a scene with noise.
    """
    setup = Setup.of(scene)
    check_without_noise(setup.scene)
    chosen = plan(setup, target_nm, device, **fixed)[0]
    for attempt in range(1 + RERUNS):
        run = simulate(
            setup, device=device, seed=seed, parts=parts, zernike=zernike, progress=progress, replicates=REPLICATES,
            estimator=chosen.estimator, sampler=chosen.sampler, precision=chosen.precision,
            smoothing=chosen.smoothing, measure=chosen.measure, rays_per_pixel=chosen.rays_per_pixel,
        )  # fmt: skip
        reached = run.comparison.height_error_nm["piston_tilt"].value
        if reached <= target_nm or attempt == RERUNS:
            break
        chosen = dataclasses.replace(chosen, rays_per_pixel=4 * chosen.rays_per_pixel)
    facts: Target = {
        "target_nm": target_nm,
        "reached_nm": reached,
        "met": reached <= target_nm,
        "attempts": attempt + 1,
        "predicted": cast("SettingFacts", dataclasses.asdict(chosen)),
    }
    return dataclasses.replace(run, report={**run.report, "target": facts})
