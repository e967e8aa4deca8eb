"""The non-sequential estimator: light goes from element to element in any order, and is counted by its path."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np

from irtscots_cl.execution.checkpoint_file import hash_of
from irtscots_cl.execution.device_tracer import DeviceTracer
from irtscots_cl.execution.executor import Executor, RunControl
from irtscots_cl.execution.launch_plan import RayBlock, plan_launches
from irtscots_cl.execution.task import TraceProgram
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.program import Source, check_precision, compose
from irtscots_cl.opencl.structs import (
    MAX_EVENTS,
    PATH_WORDS,
    PRECISIONS,
    SHORT_EVENTS,
    cone_dtype,
    path_dtype,
    stop_sieve_dtype,
)
from irtscots_cl.optics.chief_rays import check_visible
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.emission import Emission
from irtscots_cl.optics.elements.media import check_media
from irtscots_cl.optics.elements.polarisation import LEAST_CHANGE
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system.memory import check_memory
from irtscots_cl.tracing.estimators.path_sums import ENDS, TRACKED_PATHS, PathSums, TrackedPaths, ledger_of
from irtscots_cl.tracing.options import EXTRA_EVENTS, TraceOptions, check_nonsequential
from irtscots_cl.tracing.packing.components import is_rough, pack_elements, pack_scatter, path_job, unit_area
from irtscots_cl.tracing.packing.launch import launch_structure
from irtscots_cl.tracing.packing.scene import pack
from irtscots_cl.tracing.packing.sources import check_screen_memory, cone_emitters, cone_starts
from irtscots_cl.tracing.results.paths import KINDS, NOT_TRACED, LostFlux, PathLight

PILOT_RAYS = 2**22  # that look for paths
PILOT = 2**20  # their replicate, which no run has
FOUND_SIZE = 2**20  # detected rays that a pilot can list
MAX_RAYS_PER_ITEM = 2**16
FIRST_LAUNCH_RAYS = 2**20  # before a launch has been timed
MAX_IMAGE_BYTES = 2**31
NONE_TRACKED = TrackedPaths()
SIEVED = {"sieve": "stop", "mirror": "nominal", "arrival": "plain"}  # files of a trace whose rays are sieved


def trace_by_path(
    setup: Setup, executor: Executor, options: TraceOptions, rays: np.ndarray, control: RunControl, finished=None
) -> PathLight:
    """Look for the paths that reach the detector, then trace rays [replicates] per screen pixel.

    finished: as of trace.trace. Raises SceneError if no path reaches the detector.
    """
    started = time.perf_counter()
    task, scene = PathTask(setup, options), setup.scene
    size = 2 * 8 * len(rays) * int(np.prod(task.sums_shapes[1]))  # as integers and in watts
    check_memory(f"scene {scene.name}: images of {len(rays)} replicates", size)
    codes, weights, given_up = executor.call(find_paths, task)
    tracked = TrackedPaths(tuple(codes), tuple(weights))
    if not tracked.codes:
        raise _no_path(task, given_up)
    task = replace(task, tracked=tracked)
    found = time.perf_counter() - started

    def so_far(sums: tuple[np.ndarray, ...]) -> None:
        seconds = {"build": found, "trace": 0.0, "kernels": 0.0}
        finished(task.result(*sums, rays[: len(sums[0])], executor.describe(), seconds))

    ran = executor.run(task, rays, replace(control, on_replicate=None if finished is None else so_far))
    before = {"build": found} | ({} if control.checkpoint is None else control.checkpoint.seconds)
    seconds = {name: ran.seconds[name] + before.get(name, 0.0) for name in ran.seconds}
    return task.result(*ran.sums, rays, ran.device, seconds)


@dataclass(frozen=True)
class PathTask:
    """A non-sequential trace: an execution.task.TraceTask.

    tracked: paths whose light is counted separately. Raises ValueError or SceneError for a scene that cannot be traced.
    """

    setup: Setup
    options: TraceOptions
    tracked: TrackedPaths = NONE_TRACKED
    max_rays_per_item = MAX_RAYS_PER_ITEM
    first_launch_rays = FIRST_LAUNCH_RAYS

    def __post_init__(self) -> None:
        scene = self.setup.scene
        check_nonsequential(scene)
        check_visible(self.setup.chief_rays, f"scene {scene.name}")
        check_media(scene, self.components)
        _, lines, pixels = self.sums_shapes[1]
        size = 8 * len(KINDS) * lines * pixels
        if size > MAX_IMAGE_BYTES:
            raise ValueError(f"scene {scene.name}: images of {lines} lines with {pixels} "
                             f"pixels take {size} bytes; must be at most {MAX_IMAGE_BYTES}")  # fmt: skip

    def __reduce__(self):
        return type(self).from_json, (self.to_json(),)

    @property
    def components(self) -> tuple[Component, ...]:
        return self.setup.components

    @cached_property
    def bounce_limit(self) -> int:
        """Events after which a ray is given up."""
        if self.options.bounce_limit is not None:
            return self.options.bounce_limit
        return min(max(self.setup.longest_direct_path + EXTRA_EVENTS, SHORT_EVENTS), MAX_EVENTS)

    @property
    def polarised(self) -> bool:
        """Whether rays carry their polarisation."""
        asked = self.options.polarisation
        return asked == "on" or (asked == "auto" and self.setup.polarisation_change > LEAST_CHANGE)

    @property
    def code_length(self) -> str:
        """Of the paths' codes: a name of structs.PATH_WORDS."""
        return "short" if self.bounce_limit <= SHORT_EVENTS else "long"

    @property
    def sources(self) -> int:
        """Screen pixels."""
        return int(np.prod(self.setup.scene.screen.pixels))

    @property
    def sums_shapes(self) -> tuple[tuple[int, ...], ...]:
        """Of the sums of ends, elements and paths, and of the images [kinds, lines, pixels]."""
        scene = self.setup.scene
        images = (len(KINDS), sum(scene.screen.pixels), int(np.prod(scene.camera.detector.pixels)))
        return (len(ENDS) + 2 * len(self.components) + 2 + 2 * TRACKED_PATHS,), images

    @property
    def source_structs(self) -> np.ndarray:
        """The kernel's emitters [sources]."""
        return self._source_structs

    @cached_property
    def _source_structs(self) -> np.ndarray:
        return cone_emitters(self.setup, self.options.precision, self.emission)

    @cached_property
    def emission(self) -> Emission:
        """The directions in which rays leave the screen."""
        check_screen_memory(self.setup.scene)
        return self.setup.emission(self.options.overfill)

    @property
    def _gain(self) -> float:
        return self.setup.scene.screen.radiance * self.setup.scene.screen.pixel_area_mm2

    @property
    def launched_w(self) -> float:
        """Flux that leaves the screen [W]: pi x its radiance x its area."""
        return float(np.pi) * self._gain * self.sources

    @property
    def traced_w(self) -> float:
        """Flux of all rays [W]: of launched_w, what goes into the cones."""
        cones = self.emission.cones
        return self._gain * float(cones[0].area.sum()) if len(cones) == 1 else self.launched_w

    @property
    def light(self) -> PathSums:
        """What the task's sums say."""
        return PathSums(self.components, self.tracked, self.sources, self._gain * self._unit_area)

    @property
    def _unit_area(self) -> float:
        """Of direction cosines: what a ray of weight 1 stands for."""
        if len(self.emission.cones) == 1:
            return float(self.emission.cones[0].area.max())
        return float(np.pi * unit_area(self.source_structs))

    def program(self, device: Device, pilot: bool = False) -> TraceProgram:
        """The task's program on a device. pilot: it lists the detected rays in its scratch memory instead."""
        scene, options, components = self.setup.scene, self.options, self.components
        check_precision(device, options.precision)
        real, packed = PRECISIONS[options.precision], pack(self.setup.chief_rays, options.precision)
        elements = pack_elements(scene, components, real, options.least_chance)
        job = path_job(scene, components, real, self.bounce_limit, self.source_structs, cone_starts(self.emission))
        scatter, structs = pack_scatter(scene, components, real, options.aimed_scatter)
        structs |= {"Element": elements.dtype, "Path": path_dtype(self.code_length), "PathJob": job.dtype,
                    "Emitter": self.source_structs.dtype}  # fmt: skip
        structs = {"Cone": cone_dtype(real), "StopSieve": stop_sieve_dtype(real)} | packed.structs | structs
        files = self._files | (SIEVED if "sieve" in job.dtype.names else {"sieve": "none"})
        source = _compose(packed, components, structs, options, device, files)
        inputs = (packed.scene, packed.tables, self.source_structs, elements, scatter)
        table = self.tracked.table(self.code_length)
        fingerprint = {"code": source.digest, "inputs": hash_of(*inputs, job), "paths": hash_of(table)}
        job["path_count"], job["found_size"] = len(table), FOUND_SIZE if pilot else 0
        found_bytes = 4 * (1 + (PATH_WORDS[self.code_length] + 1) * (FOUND_SIZE if pilot else 1))
        inputs = (*inputs, table)
        return TraceProgram(source, "trace_paths", inputs, self._launch, fingerprint, found_bytes, after=(job,))

    @property
    def _files(self) -> dict[str, str]:
        """Choices of files by the scene's cones, the length of its paths, and whether its rays are polarised."""
        light = "polarised" if self.polarised else "unpolarised"
        return {
            "light": light,
            "carry": light,
            "fresnel": light,
            "path_code": self.code_length,
            "cones": "single" if len(self.emission.cones) == 1 else "several",
        }

    def _launch(self, replicate: int, block: RayBlock, per_item: int) -> np.ndarray:
        return launch_structure(self.setup.scene, self.options, replicate, block, per_item)

    def _losses(self, sums: np.ndarray, rays: np.ndarray) -> tuple[LostFlux, ...]:
        """Light that does not reach the detector; first of all what is not traced."""
        left_w = self.launched_w - self.traced_w
        not_traced = (LostFlux(NOT_TRACED, left_w, 0.0),) if len(self.emission.cones) == 1 else ()
        return (*not_traced, *self.light.losses(sums, rays))

    def to_json(self) -> str:
        return json.dumps({"scene": self.setup.scene.to_toml(), "options": asdict(self.options),
                           "tracked": asdict(self.tracked)})  # fmt: skip

    @classmethod
    def from_json(cls, text: str) -> PathTask:
        data = json.loads(text)
        tracked = TrackedPaths(*(tuple(data["tracked"][key]) for key in ("codes", "weights")))
        return cls(Setup(parse_scene(data["scene"])), TraceOptions(**data["options"]), tracked)

    def result(
        self, sums: np.ndarray, images: np.ndarray, rays: np.ndarray, device: dict, seconds: dict[str, float]
    ) -> PathLight:
        """The trace of rays [replicates] per source from its sums. device: description of where it ran."""
        scene, light = self.setup.scene, self.light
        ends = light.ends(sums, int(rays.sum()) * self.sources)
        images_w = images * (light.unit_w / self.tracked.of_kind)[None, :, None, None] / rays[:, None, None, None]
        return PathLight(
            scene, self.options, device, light.fluxes(sums, rays), self._losses(sums, rays), self.launched_w, images_w,
            rays, ends, ledger_of(ends), seconds, self.bounce_limit,
        )  # fmt: skip


def pilot_rays(task: PathTask) -> int:
    """Rays of each source that look for paths."""
    return max(PILOT_RAYS // task.sources, 16)


def _no_path(task: PathTask, given_up: list[float]) -> SceneError:
    """The error that no path was found. given_up: as of find_paths."""
    scene, (count, flux_w) = task.setup.scene, given_up
    cut = ""
    if count:
        limit = f"{int(count)} of them were given up after {task.bounce_limit} events, with {flux_w:.3g} W"
        cut = f"; {limit} (--bounce-limit goes up to {MAX_EVENTS})"
    return SceneError(
        f"scene {scene.name}: detector: no path from the screen reaches it; must be reached by one of "
        f"{pilot_rays(task) * task.sources} rays that look for paths{cut}"
    )


def find_paths(device: Device, task: PathTask) -> tuple[list[int], list[float], list[float]]:
    """Codes and largest weights of the paths that reach the detector in a pilot run, the most powerful first.

    And the number of rays that it gave up at the bounce limit, with their flux [W].
    """
    tracer = DeviceTracer(task, device, task.program(device, pilot=True))
    for block in plan_launches(task.sources, pilot_rays(task), lambda: task.first_launch_rays, task.max_rays_per_item):
        tracer.launch(PILOT, block)
    words = PATH_WORDS[task.code_length]
    found = tracer.read_scratch(np.zeros(1 + (words + 1) * FOUND_SIZE, np.uint32))
    rows = found[1:].reshape(-1, words + 1)[: min(int(found[0]), FOUND_SIZE)]
    # by code, then by weight: rays are found in any order, and sums in floating point depend on it
    rows = rows[np.lexsort((rows[:, words], *rows[:, :words].T))]
    weights = rows[:, words].copy().view(np.float32).astype(float)
    starts = np.any(rows[1:, :words] != rows[:-1, :words], axis=1)
    index = np.concatenate([np.zeros(min(len(rows), 1), int), np.cumsum(starts)])
    first = rows[np.flatnonzero(np.concatenate([np.ones(min(len(rows), 1), bool), starts])), :words]
    codes = [sum(int(word) << 32 * k for k, word in enumerate(row)) for row in first]
    largest, power = np.zeros(len(codes)), np.bincount(index, weights, len(codes))
    np.maximum.at(largest, index, weights)
    best = [k for k in np.argsort(-power, kind="stable")[: TRACKED_PATHS - 1] if largest[k] > 0]
    sums = tracer.sums()[0][None].astype(np.int64)
    lost = task.light.losses(sums, np.array([pilot_rays(task)]))[-1]
    given_up = [float(sums[0, ENDS.index("bounce limit")]), lost.flux_w]
    return [codes[k] for k in best], [float(largest[k]) for k in best], given_up


def _compose(
    packed, components: tuple[Component, ...], structs, options: TraceOptions, device: Device, chosen: dict[str, str]
) -> Source:
    """The kernel's source, with the given choices of files.

    It has the shapes and kinds of elements and the scatter models that there are, no others.
    """
    kinds, models = (
        {component.kind for component in components},
        {_model(component) for component in components} - {"none"},
    )
    refracts = any(component.refracts for component in components)
    choices = (
        packed.choices
        | chosen
        | {
            "sampler": options.sampler,
            "path_rng": "philox" if refracts or models else "none",
            "ray_stack": "list" if models or (refracts and options.branches == "split") else "none",
            "branch": options.branches,
        }
    )
    # made of the program's own words: no text of a scene comes into a source
    calls = " ".join(
        f"DO({component.shape}, {component.kind}, {_model(component)}, {k})" for k, component in enumerate(components)
    )
    deviated = ("element_deviated.cl",) if any(component.shape == "deviated" for component in components) else ()
    tallies = ("tally_random.cl" if options.branches == "random" else "tally_split.cl",) * refracts
    first = (*deviated, *(f"interact_{kind}.cl" for kind in sorted(kinds)), *tallies,
             *(f"scatter_{model}.cl" for model in sorted(models)))  # fmt: skip
    width = device.vector_width(options.precision)
    return compose("trace_paths.cl", choices, structs, options.precision, width, packed.constants,
                   {"ELEMENTS(DO)": calls}, first)  # fmt: skip


def _model(component: Component) -> str:
    """Name of a kernels/scatter/scatter_*.cl file, or none."""
    if is_rough(component.scatter):
        return "rough"
    return "none" if component.scatter is None else type(component.scatter).__name__.lower()
