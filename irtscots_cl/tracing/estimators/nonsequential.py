"""The non-sequential estimator: light goes from element to element in any order, and is kept by its path."""

from __future__ import annotations

import numpy as np

from irtscots_cl.execution.checkpoint import Checkpoint
from irtscots_cl.execution.checkpoint_file import hash_of
from irtscots_cl.execution.launch_plan import RateMeter, plan_launches
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import Source, check_precision, compose
from irtscots_cl.opencl.structs import PATH, PRECISIONS
from irtscots_cl.optics.chief_rays import chief_rays
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.estimators.path_sums import TRACKED_PATHS, PathSums, TrackedPaths
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.packing.components import pack_elements, pack_scatter, path_job
from irtscots_cl.tracing.packing.launch import launch_structure
from irtscots_cl.tracing.packing.scene import pack
from irtscots_cl.tracing.results.paths import MAX_EVENTS

PILOT_RAYS = 2**22  # that look for paths
PILOT = 2**20  # their replicate, which no run has
FOUND_SIZE = 2**20  # detected rays that a pilot can tell of
MIN_CHANCE = 0.1  # of either branch at an interface
MAX_RAYS_PER_ITEM = 2**16
FIRST_LAUNCH_RAYS = 2**20  # before a launch has been timed


class PathWork(PathSums):
    """The rays of a non-sequential trace: a crew.Work."""

    def __init__(self, scene: Scene, options: TraceOptions, **how):
        super().__init__(scene, options, **how)
        self.max_rays_per_item, self.first_launch_rays = MAX_RAYS_PER_ITEM, FIRST_LAUNCH_RAYS

    def build(self, device: Device) -> PathTracer:
        tracer = PathTracer(self.scene, device, self.options, **self.how, work=self)
        tracer.track(self.tracked)
        return tracer


class PathTracer:
    """The kernel and buffers of one scene on one device.

    source: what was built. work: of the same, made where there is none. streams: screen pixels. kernel_seconds: of
    `run` so far. A runner.Job. Raises DeviceError if the device cannot build or hold it.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        options: TraceOptions,
        bounce_limit: int = MAX_EVENTS,
        least_chance: float = MIN_CHANCE,
        branches: str = "roulette",
        aimed_scatter: bool = True,
        work: PathWork | None = None,
    ):
        check_precision(device, options.precision)
        self.work = of = work or PathWork(
            scene, options, bounce_limit=bounce_limit, least_chance=least_chance, branches=branches,
            aimed_scatter=aimed_scatter,
        )  # fmt: skip
        self.scene, self.options, self.sources, self.rate_meter = scene, options, of.sources, RateMeter()
        self.max_rays_per_item, self.first_launch_rays = of.max_rays_per_item, of.first_launch_rays
        real, packed = PRECISIONS[options.precision], pack(chief_rays(scene), options.precision)
        elements = pack_elements(scene, of.components, real, least_chance)
        self._job = path_job(scene, of.components, real, bounce_limit, of.source_structs)
        scatter, structs = pack_scatter(scene, of.components, real, aimed_scatter)
        structs |= {"Element": elements.dtype, "Path": PATH, "PathJob": self._job.dtype}
        self.source = _compose(packed, of.components, structs, options, branches, device)
        self._image_shape, self._sums_shape = of.sums_shapes
        self._facts = {
            "code": hash_of(self.source.text.encode(), *(option.encode() for option in self.source.options)),
            "inputs": hash_of(packed.scene, of.source_structs, elements, scatter, self._job),
        }
        self._workspace = space = Workspace(device, self.source, "trace_paths")
        self._before = [space.upload(array) for array in (packed.scene, of.source_structs, elements, scatter)]
        self._sums, self._images = (space.empty(8 * int(np.prod(s))) for s in (self._sums_shape, self._image_shape))
        self._found = space.empty(4 * (1 + 3 * FOUND_SIZE))

    def find(self) -> TrackedPaths:
        """The paths that reach the detector in a pilot run."""
        found = np.zeros(1 + 3 * FOUND_SIZE, np.uint32)
        self._workspace.clear(self._found)
        self.clear()
        self.track(TrackedPaths((), ()), FOUND_SIZE)
        rays = max(PILOT_RAYS // self.sources, 16)
        for component in plan_launches(self.sources, rays, lambda: self.first_launch_rays, self.max_rays_per_item):
            self.launch(PILOT, component)
        self._workspace.download(self._found, found)
        low, high, bits = found[1:].reshape(-1, 3)[: min(int(found[0]), FOUND_SIZE)].T
        weights = bits.copy().view(np.float32).astype(float)
        order = np.lexsort((bits, low, high))  # rays are found in any order; sums in floating point depend on it
        low, high, weights = low[order], high[order], weights[order]
        codes, index = np.unique(high.astype(np.uint64) << np.uint64(32) | low.astype(np.uint64), return_inverse=True)
        largest, power = np.zeros(len(codes)), np.bincount(index, weights, len(codes))
        np.maximum.at(largest, index, weights)
        best = [k for k in np.argsort(-power, kind="stable")[: TRACKED_PATHS - 1] if largest[k] > 0]
        return TrackedPaths(tuple(int(codes[k]) for k in best), tuple(float(largest[k]) for k in best))

    def run(
        self, rays: np.ndarray, tracked: TrackedPaths, progress=None, file: Checkpoint | None = None, finished=None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Images [replicates, kinds, lines, pixels] and sums [replicates, ends + elements + 2 paths]: whole numbers."""
        self.track(tracked)
        return run_rays(self, rays, progress, kept=file, finished=finished)

    def clear(self) -> None:
        for buffer in (self._images, self._sums):
            self._workspace.clear(buffer)

    def sums(self) -> tuple[np.ndarray, np.ndarray]:
        """Images and sums, without their replicates, of the launches since the last clear."""
        work = self._workspace
        return (work.download(self._images, np.empty(self._image_shape, np.uint64)),
                work.download(self._sums, np.empty(self._sums_shape, np.uint64)))  # fmt: skip

    def throughput(self, rays: int) -> float:
        """Rays per second of one launch of about that many rays, from its kernel's time; paths are not told apart."""
        per_source = max(rays // self.sources, 1)
        self.track(TrackedPaths((), ()))
        self.clear()
        self.rate_meter.kernel_seconds = 0.0
        self.launch(0, (0, self.sources, 0, per_source))
        return per_source * self.sources / self.kernel_seconds

    @property
    def kernel_seconds(self) -> float:
        return self.rate_meter.kernel_seconds

    def track(self, tracked: TrackedPaths, found_size: int = 0) -> None:
        """What the next launches tell apart; with found_size above 0 they list what is detected instead."""
        table = tracked.table()
        self._paths = self._workspace.upload(table)
        self.facts = self._facts | {"paths": hash_of(table)}
        self._job["path_count"], self._job["found_size"] = len(table), found_size

    def launch(self, replicate: int, component: tuple[int, int, int, int]) -> None:
        _, sources, _, rays = component
        per_item = max(1, min(rays, self.max_rays_per_item))
        launch = launch_structure(self.scene, self.options, replicate, component, per_item)
        scene, *tables = self._before
        arguments = [scene, launch, *tables, self._paths, self._sums, self._images, self._found, self._job]
        seconds = self._workspace.launch((sources, max(1, -(-rays // per_item))), arguments)
        self.rate_meter.launched(sources * rays, seconds)


def _compose(
    packed, components: tuple[Component, ...], structs, options: TraceOptions, branches: str, device: Device
) -> Source:
    """The kernel's source, with the shapes and kinds of elements and the scatter models that there are, no others."""
    kinds, models = (
        {component.kind for component in components},
        {_model(component) for component in components} - {"none"},
    )
    refracts = any(component.refracts for component in components)
    choices = packed.choices | {
        "sampler": options.sampler,
        "path_rng": "philox" if refracts or models else "none",
        "ray_stack": "list" if models or (refracts and branches == "both") else "none",
        "branch": {"roulette": "random", "both": "split"}[branches],
    }
    # made of the program's own words: no text of a scene comes into a source
    calls = " ".join(
        f"DO({component.shape}, {component.kind}, {_model(component)}, {k})" for k, component in enumerate(components)
    )
    deviated = ("element_deviated.cl",) if any(component.shape == "deviated" for component in components) else ()
    tallies = ("tally_random.cl" if branches == "roulette" else "tally_split.cl",) * refracts
    first = (*deviated, *(f"interact_{kind}.cl" for kind in sorted(kinds)), *tallies,
             *(f"scatter_{model}.cl" for model in sorted(models)))  # fmt: skip
    width = device.vector_width(options.precision)
    return compose("trace_paths.cl", choices, packed.structs | structs, options.precision, width, packed.constants,
                   {"ELEMENTS(DO)": calls}, first)  # fmt: skip


def _model(component: Component) -> str:
    return "none" if component.scatter is None else type(component.scatter).__name__.lower()
