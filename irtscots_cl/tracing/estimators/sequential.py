"""Trace a scene: scene + device -> Transport, by the forward or the adjoint estimator; or by the analytic one."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, replace
from functools import partial

import numpy as np

from irtscots_cl.execution.checkpoint import Checkpoint
from irtscots_cl.execution.checkpoint_file import hash_of
from irtscots_cl.execution.job import Executor
from irtscots_cl.execution.launch_plan import FIRST_LAUNCH_RAYS, MAX_RAYS_PER_ITEM, RateMeter
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import LocalMemory, Workspace
from irtscots_cl.opencl.program import check_precision, compose
from irtscots_cl.opencl.structs import WEIGHT_ONE, Fate
from irtscots_cl.optics.chief_rays import ChiefRays, chief_rays
from irtscots_cl.optics.screen_windows import place_windows
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.system.memory import check_memory
from irtscots_cl.tracing.options import TraceOptions, check_sequential
from irtscots_cl.tracing.packing.launch import launch_structure
from irtscots_cl.tracing.packing.scene import pack
from irtscots_cl.tracing.packing.sources import cosine4, emitters, line_receivers, receivers
from irtscots_cl.tracing.results.transport import LineLight, Transport, ledger_from, line_flux

MIN_TIMED_RAYS = 2**14  # of a stream, in a benchmark
MAX_MARGIN = 8  # screen pixels; chief rays that are wrong by more are a bug
MAX_TILE_BYTES = 2**19  # a larger detector tile would leave the core's cache
TILE_BYTES_PER_RAY = 4  # with more, clearing and merging a tile costs more than its rays' atomics


def trace_rays(
    scene: Scene, executor: Executor, options: TraceOptions, rays: np.ndarray, progress, launch_rays, kept, finished
) -> Transport | LineLight:
    """The forward or the adjoint estimator, with windows as wide as it takes."""
    margin = 1 if kept is None else kept.margin()
    while True:
        started = time.perf_counter()
        work = TraceWork(scene, options, margin, int(rays.max()), len(rays))
        prepared = time.perf_counter() - started
        so_far = None if finished is None else partial(_pass_on, finished, work, executor, rays)
        ran = executor.run(work, rays, progress, launch_rays, kept, so_far)
        counts, fates = work.totals(ran.sums, rays)
        if fates[Fate.OFF_WINDOW] == 0:
            break
        if kept is not None:
            kept.discard()
        margin *= 2  # light fell beside a window: wider ones, from the start
        if margin > MAX_MARGIN:
            raise RuntimeError(f"{fates[Fate.OFF_WINDOW]} rays land where no chief ray says that light can come")
    before = {"build": prepared} | ({} if kept is None else kept.seconds)
    seconds = {name: ran.seconds[name] + before.get(name, 0.0) for name in ran.seconds}
    return replace(work.result(counts, fates, rays, ran.device, seconds), scene=scene)  # the caller's own, not an equal


def _pass_on(finished, work: TraceWork, executor: Executor, rays: np.ndarray, sums: tuple[np.ndarray, ...]) -> None:
    """Give `finished` the trace so far, unless it is one that begins again."""
    rays = rays[: len(sums[0])]
    counts, fates = work.totals(sums, rays)
    if fates[Fate.OFF_WINDOW] == 0:
        finished(work.result(counts, fates, rays, executor.describe(), {"build": 0.0, "trace": 0.0, "kernels": 0.0}))


class TraceWork:
    """The rays of a forward or adjoint trace and what they fill, known without a device: a crew.Work.

    margin, rays, streams, unit_w: as of Tracer. sources: the kernel's emitters or receivers. replicates: to be kept;
    ValueError where the memory cannot hold them.
    """

    def __init__(
        self, scene: Scene, options: TraceOptions, margin: int = 1, rays: int = MAX_RAYS_PER_ITEM, replicates: int = 1
    ):
        check_sequential(scene, options.estimator)
        chief = chief_rays(scene)
        self.scene, self.options, self.margin, self.rays = scene, options, margin, rays
        self.max_rays_per_item, self.first_launch_rays = MAX_RAYS_PER_ITEM, FIRST_LAUNCH_RAYS
        self.windows = windows = place_windows(chief, margin)
        rows, columns, visible_pixels = windows.rows, windows.columns, len(windows.pixels)
        self.bins = (columns + 2 + rows + 2,) if options.smoothing else (rows, columns)  # of a slot
        size = 8 * visible_pixels * int(np.prod(self.bins))  # on the device, and of every replicate
        what = f"scene {scene.name}: {visible_pixels} windows of {columns} x {rows} screen pixels"
        check_memory(what, (1 + replicates) * size)
        self.source_structs, self.unit_w = self._sources(chief)
        self.sources = len(self.source_structs)
        self.sums_shapes = ((len(self.windows.pixels), *self.bins), (len(Fate),))

    def build(self, device: Device) -> Tracer:
        return Tracer(chief_rays(self.scene), device, self.options, self.margin, self.rays, work=self)

    def to_json(self) -> str:
        return json.dumps({"scene": self.scene.to_toml(), "options": asdict(self.options), "margin": self.margin,
                           "rays": self.rays})  # fmt: skip

    @classmethod
    def from_json(cls, text: str) -> TraceWork:
        data = json.loads(text)
        return cls(parse_scene(data["scene"]), TraceOptions(**data["options"]), data["margin"], data["rays"])

    def totals(self, sums: tuple[np.ndarray, ...], rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Counts, and the fates of all replicates together, of a run of rays [replicates]."""
        counts, fates = sums[0], sums[1].sum(0)
        if self.options.estimator == "adjoint":  # its windows hold weights, so the kernel counts only the others
            fates[Fate.DETECTED] = int(rays.sum()) * self.sources - int(fates.sum())
        return counts, fates

    def result(
        self, counts: np.ndarray, fates: np.ndarray, rays: np.ndarray, device: dict, seconds: dict[str, float]
    ) -> Transport | LineLight:
        """The trace of rays [replicates] per stream from its totals. device: facts of where it ran."""
        ledger = ledger_from(fates, int(rays.sum()) * self.sources)
        if self.options.smoothing:
            flux = line_flux(counts, self.windows, self.unit_w[:, 0], rays)
            return LineLight(self.scene, self.options, device, self.windows, flux, rays, ledger, seconds)
        return Transport(self.scene, self.options, device, self.windows, counts, self.unit_w, rays, ledger, seconds)

    def _sources(self, chief: ChiefRays) -> tuple[np.ndarray, np.ndarray]:
        """The kernel's emitters or receivers, and unit_w."""
        screen, camera, mirror = self.scene.screen, self.scene.camera, self.scene.mirror
        gain = screen.radiance * mirror.reflectance * camera.transmittance
        if self.options.estimator == "forward":
            structs, area = emitters(
                chief, self.options.precision, self.options.overfill, self.options.aim
            )
            unit = (gain * screen.pitch_mm**2 * area).reshape(screen.pixels[::-1])
            return structs, self.windows.gather(unit)
        pixels, origins = self.windows.pixels, self.windows.origins
        area = np.pi / 4 * camera.aperture_diameter_mm**2 * camera.detector.pitch_mm**2
        unit = gain * area / camera.image_distance_mm**2 * cosine4(chief, pixels) / WEIGHT_ONE
        made = line_receivers if self.options.smoothing else receivers
        return made(chief, pixels, origins, self.options.precision), unit[:, None, None]


class Tracer:
    """One estimator's kernel and buffers for one scene on one device, built and warm.

    margin: screen pixels that the windows are wider than the chief rays say. rays: that a stream is about to get, which
    decides how they are best added up. width: rays side by side in a work-item, None: the device's. accumulate: member
    of the accumulate_* kernel files, None: the device's. work: of the same, where there is one. streams: sources of
    rays (screen or detector pixels). unit_w: flux [W] of one count in a run of one ray per stream, broadcasting to
    [n, window rows, window columns]. source: what was built. kernel_seconds: spent in kernels by `run` so far.

    A runner.Job. Raises DeviceError if the device cannot build or hold it.
    """

    def __init__(
        self,
        chief: ChiefRays,
        device: Device,
        options: TraceOptions,
        margin: int = 1,
        rays: int = MAX_RAYS_PER_ITEM,
        width: int | None = None,
        accumulate: str | None = None,
        work: TraceWork | None = None,
    ):
        check_precision(device, options.precision)
        self._work = work or TraceWork(chief.scene, options, margin, rays)
        self.options, self.scene, self.windows = options, chief.scene, self._work.windows
        self._detector_pixels = int(np.prod(chief.shape))
        packed = pack(chief, options.precision)
        self.unit_w, self._bins, self.sources = self._work.unit_w, self._work.bins, self._work.sources
        self.rate_meter = RateMeter()
        self.max_rays_per_item, self.first_launch_rays = self._work.max_rays_per_item, self._work.first_launch_rays
        tile = LocalMemory(self._tile_bytes())
        if accumulate is None:
            fits = tile.nbytes <= min(MAX_TILE_BYTES, device.local_memory_bytes, rays * TILE_BYTES_PER_RAY)
            accumulate = "tile" if device.kind == "cpu" and fits else "atomic"
        choices = packed.choices | {"sampler": options.sampler, "accumulate": accumulate}
        width = width or device.vector_width(options.precision)
        entry = "trace_lines" if options.smoothing else f"trace_{options.estimator}"
        self.source = compose(f"{entry}.cl", choices, packed.structs, options.precision, width, packed.constants)
        self._workspace = work = Workspace(device, self.source, entry)
        self._counts = work.empty(8 * int(np.prod(self._work.sums_shapes[0])))
        self._ledger = work.empty(8 * len(Fate))
        lookup = [work.upload(array) for array in self._lookup()]
        self._before = [work.upload(packed.scene)]
        tile = tile if accumulate == "tile" else LocalMemory(8)
        self.facts = {
            "margin": margin,
            "code": hash_of(self.source.text.encode(), *(option.encode() for option in self.source.options)),
            "inputs": hash_of(packed.scene, self._work.source_structs, *self._lookup()),
        }
        self._after = [work.upload(self._work.source_structs), *lookup, self._counts, self._ledger, tile]
        self.clear()
        self.launch(0, (0, 1, 0, 0))  # no rays: some drivers compile at the first launch

    def _tile_bytes(self) -> int:
        """Local memory of a work-item that accumulates in a tile of its own."""
        if self.options.estimator == "forward":
            return 4 * self._detector_pixels
        return 8 * (int(np.prod(self._bins)) + len(Fate))

    def _lookup(self) -> list[np.ndarray]:
        """Forward: where a detector pixel's window is. An adjoint receiver knows."""
        if self.options.estimator == "adjoint":
            return []
        visible_pixels = np.full(self._detector_pixels, -1, np.int32)
        visible_pixels[self.windows.pixels] = np.arange(len(self.windows.pixels))
        return [visible_pixels, self.windows.origins]

    def run(
        self, rays: np.ndarray, progress=None, launch_rays: int | None = None, kept: Checkpoint | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Trace rays [replicates] rays per stream: counts [replicates, n, window rows, window columns], rays [Fate].

        With smoothing, counts are second differences (see kernels/entry/trace_lines.cl).
        """
        return self._work.totals(run_rays(self, rays, progress, launch_rays, kept), rays)

    def clear(self) -> None:
        for buffer in (self._counts, self._ledger):
            self._workspace.clear(buffer)

    def sums(self) -> tuple[np.ndarray, np.ndarray]:
        """Counts [n, window rows, window columns] and rays [Fate] of the launches since the last clear."""
        work, counts = self._workspace, np.empty((len(self.windows.pixels), *self._bins), np.uint64)
        return work.download(self._counts, counts), work.download(self._ledger, np.zeros(len(Fate), np.uint64))

    def throughput(self, rays: int) -> float:
        """Rays per second of one launch of about that many rays, from its kernel's time.

        Every stream gets enough rays that what is done once per work-item does not count; with many streams, only those
        in the middle take part.
        """
        per_source = max(rays // self.sources, MIN_TIMED_RAYS)
        sources = max(1, min(self.sources, rays // per_source))
        self.rate_meter.kernel_seconds = 0.0
        self.clear()
        self.launch(0, ((self.sources - sources) // 2, sources, 0, per_source))
        return per_source * sources / self.kernel_seconds

    @property
    def kernel_seconds(self) -> float:
        return self.rate_meter.kernel_seconds

    def launch(self, replicate: int, part: tuple[int, int, int, int]) -> None:
        _, sources, _, rays = part
        per_item = max(1, min(rays, self.max_rays_per_item))
        launch = launch_structure(self.scene, self.options, replicate, part, per_item)
        launch["window_columns"], launch["window_rows"] = self.windows.columns, self.windows.rows
        parts = max(1, -(-rays // per_item))
        seconds = self._workspace.launch((sources, parts), [*self._before, launch, *self._after])
        self.rate_meter.launched(sources * rays, seconds)
