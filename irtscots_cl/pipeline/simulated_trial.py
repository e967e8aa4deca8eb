"""A trial of an error budget as a real test: its scene is traced and measured, and told beside the trial's height.

The design alone is traced with the same random numbers and its map subtracted: what is left of the measure's own error
and of the rays' noise is what the errors change of them. What a scene cannot hold, such as vibration, is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import binary_erosion

from irtscots_cl.budget.brightness import TERMS, Brightness
from irtscots_cl.budget.geometry import Geometry
from irtscots_cl.budget.mirror_map import MountedMap, mapped
from irtscots_cl.budget.sensitivity import NM
from irtscots_cl.budget.trials import LEAST_SHARE, Trials
from irtscots_cl.calibration.parameters import moved
from irtscots_cl.calibration.seen_pixels import FEWEST
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.recording import line_scan
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.output import version_attributes
from irtscots_cl.report.result_file import write_result
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.system.atomic_files import made_folder, write_text
from irtscots_cl.tracing.defaults import RAYS_PER_PIXEL
from irtscots_cl.tracing.trace import trace

LEAST_FACTOR = 1e-6  # of a map's heights in a scene
NAME_KEPT = 48  # characters of a scene's name, of 64
MEASURE = "paper"  # as the budget measures: trapezoids, and slopes as means over pixels


@dataclass(frozen=True)
class SimulatedTrial:
    """scene: as traced. stack, result: its images, measured with the design's geometry. held: values of the sources
    in it; left_out: names of the others. used: [n] of the design's pixels off the rim that both tests measured.
    predicted_mm, simulated_mm: [used] heights by these errors, without piston and tilt, with compensators fitted
    away. own_nm: rms of the design's map, by the measure and the rays. noise_nm: standard error of simulated_mm by
    the rays, rms. with_rim_nm: rms of the simulated error where pixels that the mirror's rim cuts are measured,
    too: what they see moves, as no chief ray tells.
    """

    trials: Trials = field(repr=False)
    trial: int
    scene: Scene = field(repr=False)
    stack: ImageStack = field(repr=False)
    result: Reconstruction = field(repr=False)
    held: dict[str, float]
    left_out: tuple[str, ...]
    used: BoolArray = field(repr=False)
    predicted_mm: FloatArray = field(repr=False)
    simulated_mm: FloatArray = field(repr=False)
    own_nm: float
    noise_nm: float
    with_rim_nm: float

    @property
    def predicted_nm(self) -> float:
        return _rms(self.predicted_mm) * NM

    @property
    def simulated_nm(self) -> float:
        return _rms(self.simulated_mm) * NM

    @property
    def difference_nm(self) -> float:
        return _rms(self.simulated_mm - self.predicted_mm) * NM


def simulated_facts(found: SimulatedTrial) -> dict[str, Any]:
    """All of it as plain data, without maps."""
    return {
        "trial": found.trial,
        "scene": found.scene.name,
        "held": found.held,
        "left_out": list(found.left_out),
        "pixels": int(found.used.sum()),
        "predicted_nm": found.predicted_nm,
        "simulated_nm": found.simulated_nm,
        "difference_nm": found.difference_nm,
        "rays_nm": found.noise_nm,
        "design_nm": found.own_nm,
        "with_rim_nm": found.with_rim_nm,
    }


def write_simulated(found: SimulatedTrial, folder: Path) -> None:
    """Write the trial's scene.toml, and the images and maps as result.h5; the folder is made if it is not there."""
    toml = found.scene.to_toml()
    attributes = {"scene": toml, "seed": str(found.trials.budget.seed), "measure": MEASURE} | version_attributes()
    with made_folder(folder):
        write_text(folder / "scene.toml", toml)
        write_result(folder / "result.h5", found.stack, found.result, attributes)


def trial_scene(trials: Trials, trial: int) -> tuple[Scene, dict[str, float]]:
    """The scene of a trial, and the sources that are in it with their values.

    Without the scene's own noise and response of the screen, which no budget has. Raises SceneError for a scene that
    cannot be.
    """
    held = {
        source.name: value
        for source in trials.sources
        for value in (trials.values_of(trial)[source.name],)
        if isinstance(source, Geometry | Brightness | MountedMap)
    }
    geometry = {s.name: held[s.name] for s in trials.sources if isinstance(s, Geometry)}
    polynomial = [0.0] * len(TERMS)
    for source in trials.sources:
        if isinstance(source, Brightness):
            polynomial[TERMS.index(source.term)] = held[source.name]
    scene = moved(_plain(trials.design.setup.scene), geometry)
    scene = replace(scene, name=f"{scene.name[:NAME_KEPT]}-trial-{trial}")
    if maps := [
        replace(source.table, factor=source.table.factor * held[source.name])
        for source in trials.sources
        if isinstance(source, MountedMap) and abs(source.table.factor * held[source.name]) > LEAST_FACTOR
    ]:
        scene = mapped(scene, maps)
    if any(polynomial):
        a, b, c, d, e = polynomial
        response = ScreenResponse(brightness_polynomial=(a, b, c, d, e))
        scene = replace(scene, screen=replace(scene.screen, response=response))
    return scene, held


def _plain(scene: Scene) -> Scene:
    """A scene without noise of its detector, response of its screen, budget, and what chief rays do not know: its
    elements and what scatters."""
    camera = replace(scene.camera, detector=replace(scene.camera.detector, noise=None), lens="paraxial")
    mirror, screen = replace(scene.mirror, scatter=None), replace(scene.screen, response=None)
    return replace(scene, mirror=mirror, camera=camera, screen=screen, element=(), budget=None, calibration=None)


def simulate_trial(
    trials: Trials,
    trial: int,
    *,
    rays_per_pixel: int = RAYS_PER_PIXEL,
    device: Device | Sequence[Device] | None = None,
    **trace_options,
) -> SimulatedTrial:
    """Trace and measure a trial; the seed is the budget's. trace_options: as of `trace`.

    Raises ValueError for a budget with turns of the mirror, and as `trace` and `measure_by` do.
    """
    if trials.procedure.turns > 1:
        raise ValueError(f"--images: must be left out with budget.mirror_turns = {trials.procedure.turns}: one test")
    scene, held = trial_scene(trials, trial)
    nominal = Setup(_plain(trials.design.setup.scene))
    options = {"rays_per_pixel": rays_per_pixel, "seed": trials.budget.seed, "device": device} | trace_options
    stacks = [trial_images(Setup(one), nominal, options) for one in (nominal.scene, scene)]
    whole = binary_erosion(nominal.chief_rays.footprint.coverage > 1 - 1e-9, np.ones((3, 3)))
    inner = _on_pixels(trials, whole)
    inside = [measure_by(MEASURE, stack.masked(whole), nominal) for stack in stacks]
    own, by_errors, used = _by_errors(inner, inside)
    predicted = _levelled(inner, inner.heights_mm([(trial, held)])[0], used)
    with_rim = [measure_by(MEASURE, stack, nominal) for stack in stacks]
    _, by_errors_with_rim, _ = _by_errors(trials, with_rim)
    left_out = tuple(source.name for source in trials.sources if source.name not in held)
    return SimulatedTrial(
        inner, trial, scene, stacks[1], with_rim[1], held, left_out, used, predicted, by_errors[0], _rms(own) * NM,
        _rms(jackknife_error(by_errors)) * NM, _rms(by_errors_with_rim[0]) * NM,
    )  # fmt: skip


def trial_images(setup: Setup, nominal: Setup, options: dict[str, Any]) -> ImageStack:
    """The images of a scene's screen, where its lines are believed to be. options: of `trace`."""
    believed = replace(nominal.scene, screen=replace(nominal.scene.screen, response=setup.scene.screen.response))
    return trace(setup, **options).images(line_scan(believed))


def _on_pixels(trials: Trials, chosen: BoolArray) -> Trials:
    """The trials on some of the detector's pixels [rows, columns]."""
    seen = trials.design.seen
    mask = seen.mask & chosen[np.ix_(seen.row.astype(int), seen.column.astype(int))]
    if np.count_nonzero(mask) < FEWEST:
        raise ValueError(
            f"--images: {np.count_nonzero(mask)} pixels see the mirror alone, off its rim; must be {FEWEST}"
        )
    return trials.on(trials.design.on(replace(seen, mask=mask)))


def _by_errors(trials: Trials, results: Sequence[Reconstruction]) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Height [used] of the first result, and how the other [1 + replicates, used] differs from it; pixels used [n]."""
    row, column = (values.astype(int) for values in trials.design.seen.pixels)
    maps = []
    for result in results:
        heights = np.where(result.height_mask, result.estimates("deviation_mm"), np.nan)
        maps.append(heights[:, row, column])
    used = np.isfinite(maps[0]).all(0) & np.isfinite(maps[1]).all(0)
    if used.mean() < LEAST_SHARE:
        raise ValueError(f"--images: a test as wrong as this trial measures {used.sum()} of {used.size} pixels")
    return _levelled(trials, maps[0][0], used), _levelled(trials, maps[1] - maps[0], used), used


def _levelled(trials: Trials, heights: FloatArray, used: BoolArray) -> FloatArray:
    """Heights [..., used] of [..., n] without piston, tilt and what compensators take."""
    flat = np.linalg.qr(trials.design.response.basis[used, :3])[0]
    left = trials.procedure.fitted(np.where(used, heights, 0.0), used)[..., used]
    found: FloatArray = left - (left @ flat) @ flat.T
    return found


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
