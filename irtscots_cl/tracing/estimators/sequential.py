"""The forward and the adjoint estimator: rays from the screen or from the detector, by way of the mirror."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial

import numpy as np

from irtscots_cl.execution.checkpoint_file import hash_of
from irtscots_cl.execution.executor import Executor, RunControl
from irtscots_cl.execution.launch_plan import FIRST_LAUNCH_RAYS, MAX_RAYS_PER_ITEM, RayBlock
from irtscots_cl.execution.task import TraceProgram
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import LocalMemory
from irtscots_cl.opencl.program import BLOCK, LEAST_BLOCK, check_precision, compose
from irtscots_cl.opencl.structs import LINE_WEIGHT_ONE, WEIGHT_ONE, Fate
from irtscots_cl.optics.aim import mirror_rings, screen_corners
from irtscots_cl.optics.screen_facets import ScreenFacets
from irtscots_cl.optics.screen_windows import Windows
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import parse_scene
from irtscots_cl.system.memory import check_memory
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.tracing.options import TraceOptions, check_traceable
from irtscots_cl.tracing.packing.launch import launch_structure
from irtscots_cl.tracing.packing.scene import Packed, pack
from irtscots_cl.tracing.packing.sources import emitters, line_receivers, receivers, relative_flux
from irtscots_cl.tracing.results.transport import LineLight, Transport, ledger_from, line_flux

MAX_EDGES = 64  # lines of a window: with more, a ray is added by its ends instead of at every line's edge
MARGINS = tuple(2**k for k in range(11))  # screen pixels
MOST_MARGIN, MOST_SHARE = 8, 1 / 16  # screen pixels, or of a window of many: a larger error of the chief rays is a bug
MAX_TILE_BYTES = 2**19  # a larger detector tile would leave the core's cache
RINGS = 4  # on the mirror, of points that are compared with the screen's plane
TILE_BYTES_PER_RAY = 4  # with more, clearing and merging a tile costs more than its rays' atomics
ADDS_OF_LINES = 8  # of a smoothed ray


def trace_rays(
    setup: Setup,
    executor: Executor,
    options: TraceOptions,
    rays: np.ndarray,
    control: RunControl,
    finished=None,
) -> Transport | LineLight:
    """Trace rays [replicates] per source, with windows as wide as it takes.

    finished: as of trace.trace.
    """
    checkpoint = control.checkpoint
    margin = MARGINS[0] if checkpoint is None else checkpoint.saved("margin", MARGINS)
    while True:
        started = time.perf_counter()
        task = SequentialTask(setup, options, margin, int(rays.max()))
        task.check_memory(len(rays))
        prepared = time.perf_counter() - started
        so_far = None if finished is None else partial(_pass_on, finished, task, executor, rays)
        ran = executor.run(task, rays, replace(control, on_replicate=so_far))
        counts, fates = task.totals(ran.sums, rays)
        if fates[Fate.OFF_WINDOW] == 0:
            break
        if checkpoint is not None:
            checkpoint.discard()
        margin *= 2  # light fell outside a window: wider ones, from the start
        if margin > max(MOST_MARGIN, MOST_SHARE * max(task.windows.rows, task.windows.columns)):
            raise RuntimeError(f"{fates[Fate.OFF_WINDOW]} rays land outside all windows of the chief rays")
    before = {"build": prepared} | ({} if checkpoint is None else checkpoint.seconds)
    seconds = {name: ran.seconds[name] + before.get(name, 0.0) for name in ran.seconds}
    return task.result(counts, fates, rays, ran.device, seconds)


def _check_in_front(setup: Setup) -> None:
    """Raise ValueError if part of the mirror is behind the plane of a screen pixel, where none of its rays go, or not
    below the screen: the kernels follow light that falls onto the mirror."""
    chief = setup.chief_rays
    facets, points = ScreenFacets.of(chief), mirror_rings(chief.surface, RINGS).reshape(-1, 3)
    ends = screen_corners(chief) if facets.is_flat else facets.points
    lowest, highest = float(ends[:, 2].min()), max(float(points[:, 2].max()), 0.0)
    if not lowest > highest:
        raise OptionError(
            f"scene {setup.scene.name}: --estimator forward: pixels of the screen are at z = {lowest:.6g} mm; must be "
            f"above the whole mirror, which is up to {highest:.6g} mm high, or another --estimator"
        )
    if not facets.sees(points):
        raise OptionError(
            f"scene {setup.scene.name}: --estimator forward: part of the mirror is behind the screen's plane, and its "
            "rays are aimed at the whole mirror; must be all in front of it, or another --estimator"
        )


def _pass_on(finished, task: SequentialTask, executor: Executor, rays: np.ndarray, sums) -> None:
    """Give `finished` the trace so far, unless the trace will start again with wider windows."""
    rays = rays[: len(sums[0])]
    counts, fates = task.totals(sums, rays)
    if fates[Fate.OFF_WINDOW] == 0:
        finished(task.result(counts, fates, rays, executor.describe(), {"build": 0.0, "trace": 0.0, "kernels": 0.0}))


@dataclass(frozen=True)
class SequentialTask:
    """A forward or adjoint trace: an execution.task.TraceTask.

    margin: screen pixels by which windows are wider than the chief rays require. rays: that a source is about to get,
    which decides how they are best added up. width: rays per vector of a work-item, accumulate: member of the
    accumulate_* kernel files; None: the device's best.
    """

    setup: Setup
    options: TraceOptions
    margin: int = 1
    rays: int = MAX_RAYS_PER_ITEM
    width: int | None = None
    accumulate: str | None = None
    max_rays_per_item = MAX_RAYS_PER_ITEM
    first_launch_rays = FIRST_LAUNCH_RAYS

    def __post_init__(self) -> None:
        check_traceable(self.setup.scene, self.options)

    def __reduce__(self):
        return type(self).from_json, (self.to_json(),)

    def check_memory(self, replicates: int) -> None:
        """ValueError if the memory cannot hold the windows of so many replicates."""
        scene, windows = self.setup.scene, self.windows
        size = 8 * int(np.prod(self.sums_shapes[0]))  # on the device, and of every replicate
        what = f"{len(windows.pixels)} windows of {windows.columns} x {windows.rows} screen pixels"
        check_memory(f"scene {scene.name}: {what}", (1 + replicates) * size)

    @property
    def windows(self) -> Windows:
        return self.setup.windows(self.margin)

    @property
    def bins(self) -> tuple[int, ...]:
        """Shape of the sums of one visible pixel."""
        rows, columns = self.windows.rows, self.windows.columns
        return (columns + 2 + rows + 2,) if self.options.smoothing else (rows, columns)

    @property
    def sources(self) -> int:
        """Screen pixels (forward) or detector pixels that see the screen (adjoint)."""
        return len(self.source_structs)

    @property
    def sums_shapes(self) -> tuple[tuple[int, ...], ...]:
        """Of the counts [visible pixels, *bins] and of the rays by fate."""
        return (len(self.windows.pixels), *self.bins), (len(Fate),)

    @property
    def source_structs(self) -> np.ndarray:
        """The kernel's emitters or receivers [sources]."""
        return self._sources[0]

    @property
    def unit_w(self) -> np.ndarray:
        """Flux [W] of one count in a run of one ray per source; broadcasts to [n, window rows, window columns]."""
        return self._sources[1]

    @cached_property
    def _sources(self) -> tuple[np.ndarray, np.ndarray]:
        scene, options, windows = self.setup.scene, self.options, self.windows
        screen, camera = scene.screen, scene.camera
        gain = screen.radiance * scene.mirror.reflectance * camera.transmittance
        if options.estimator == "forward":
            _check_in_front(self.setup)
            structs, area = emitters(self.setup, options.precision, options.overfill, options.aim)
            unit = (gain * screen.pixel_area_mm2 * area).reshape(screen.pixels[::-1])
            return structs, windows.gather(unit)
        chief = self.setup.chief_rays
        area = np.pi / 4 * camera.aperture_diameter_mm**2 * chief.camera_model.pixel_area_mm2
        one = LINE_WEIGHT_ONE if options.smoothing else WEIGHT_ONE
        unit = gain * area / camera.image_distance_mm**2 * relative_flux(chief, windows.pixels) / one
        if options.smoothing:
            structs = line_receivers(self.setup, windows.pixels, windows.origins, options.precision)
        else:
            structs = receivers(chief, windows.pixels, windows.origins, options.precision)
        return structs, unit[:, None, None]

    def program(self, device: Device) -> TraceProgram:
        options, precision = self.options, self.options.precision
        check_precision(device, precision)
        packed = pack(self.setup.chief_rays, precision)
        tile = LocalMemory(self._tile_bytes())
        accumulate = self.accumulate or self._accumulate(device, tile)
        width = self.width or device.vector_width(precision)
        choices = packed.choices | {"sampler": options.sampler, "accumulate": accumulate}
        if options.smoothing:
            choices["ramps"] = "edges" if self._at_edges and accumulate != "atomic" and width > 1 else "steps"
        entry = "trace_lines" if options.smoothing else f"trace_{options.estimator}"
        source = compose(f"{entry}.cl", choices, packed.structs, precision, width, packed.constants, block=self._block)
        inputs = self._inputs(packed)
        fingerprint = {"margin": self.margin, "code": source.digest, "inputs": hash_of(*inputs)}
        after = (tile if accumulate == "tile" else LocalMemory(8),)
        return TraceProgram(source, entry, inputs, self._launch, fingerprint, after=after)

    def _inputs(self, packed: Packed) -> tuple[np.ndarray, ...]:
        """Scene, tables, sources; forward, where a detector pixel's window is. An adjoint receiver knows its own."""
        if self.options.estimator == "adjoint":
            return packed.scene, packed.tables, self.source_structs
        visible_pixels = np.full(self._detector_pixels, -1, np.int32)
        visible_pixels[self.windows.pixels] = np.arange(len(self.windows.pixels))
        return packed.scene, packed.tables, self.source_structs, visible_pixels, self.windows.origins

    @property
    def _detector_pixels(self) -> int:
        return int(np.prod(self.setup.chief_rays.shape))

    def _tile_bytes(self) -> int:
        """Local memory of a work-item that accumulates in a tile of its own."""
        if self.options.estimator == "forward":
            return 4 * self._detector_pixels
        return 8 * (int(np.prod(self.bins)) + len(Fate))

    @property
    def _block(self) -> int:
        """Rays that a work-item traces from stage to stage: no more than there are, of the few of an adjoint source."""
        if self.options.estimator == "forward":
            return BLOCK
        return min(BLOCK, max(LEAST_BLOCK, 1 << (self.rays - 1).bit_length()))

    @property
    def _at_edges(self) -> bool:
        """Whether smoothed rays are best added at the edges of a window's lines, in a tile, however few they are."""
        return self.options.smoothing and max(self.windows.columns, self.windows.rows) <= MAX_EDGES

    def _accumulate(self, device: Device, tile: LocalMemory) -> str:
        most, adds = min(MAX_TILE_BYTES, device.local_memory_bytes), self.rays
        if self.options.smoothing:
            adds *= ADDS_OF_LINES
        fits = tile.nbytes <= (most if self._at_edges else min(most, adds * TILE_BYTES_PER_RAY))
        return "tile" if device.kind == "cpu" and fits else "atomic"

    def _launch(self, replicate: int, block: RayBlock, per_item: int) -> np.ndarray:
        launch = launch_structure(self.setup.scene, self.options, replicate, block, per_item)
        launch["window_columns"], launch["window_rows"] = self.windows.columns, self.windows.rows
        return launch

    def to_json(self) -> str:
        more = {name: getattr(self, name) for name in ("margin", "rays", "width", "accumulate")}
        return json.dumps({"scene": self.setup.scene.to_toml(), "options": asdict(self.options)} | more)

    @classmethod
    def from_json(cls, text: str) -> SequentialTask:
        data = json.loads(text)
        setup, options = Setup(parse_scene(data.pop("scene"))), TraceOptions(**data.pop("options"))
        return cls(setup, options, **data)

    def totals(self, sums: tuple[np.ndarray, ...], rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Counts, and the fates of all replicates together, of a run of rays [replicates]."""
        counts, fates = sums[0], sums[1].sum(0)
        if self.options.estimator == "adjoint":  # its windows hold weights, so the kernel counts only the others
            fates[Fate.DETECTED] = int(rays.sum()) * self.sources - int(fates.sum())
        return counts, fates

    def result(
        self, counts: np.ndarray, fates: np.ndarray, rays: np.ndarray, device: dict, seconds: dict[str, float]
    ) -> Transport | LineLight:
        """The trace of rays [replicates] per source from its totals. device: description of where it ran."""
        scene, ledger = self.setup.scene, ledger_from(fates, int(rays.sum()) * self.sources)
        if self.options.smoothing:
            flux = line_flux(counts, self.windows, self.unit_w[:, 0], rays)
            return LineLight(scene, self.options, device, self.windows, flux, rays, ledger, seconds)
        return Transport(scene, self.options, device, self.windows, counts, self.unit_w, rays, ledger, seconds)
