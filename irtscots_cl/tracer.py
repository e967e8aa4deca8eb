"""Trace a scene: scene + device -> Transport, by the forward or the adjoint estimator; or by the analytic one."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from irtscots_cl.aiming import emitters
from irtscots_cl.analytic import trace_analytic
from irtscots_cl.calibration import Calibration, calibrate, check_visible
from irtscots_cl.device import Device, select_device
from irtscots_cl.execution import LocalMemory, Workspace
from irtscots_cl.interface import WEIGHT_ONE, Fate
from irtscots_cl.launches import MAX_RAYS_PER_ITEM, Pace, launch_structure, plan_launches, share_rays
from irtscots_cl.memory import check_memory
from irtscots_cl.nonsequential import trace_paths
from irtscots_cl.options import ANALYTIC, MAX_SMOOTHED_RAYS, NONSEQUENTIAL, TraceOptions
from irtscots_cl.packing import cosine4, line_receivers, pack, receivers
from irtscots_cl.paths import PathLight
from irtscots_cl.program import check_precision, compose
from irtscots_cl.scene import Scene
from irtscots_cl.transport import LineLight, Transport, ledger_from, line_flux
from irtscots_cl.windows import place_windows

MIN_TIMED_RAYS = 2**14  # of a stream, in a benchmark
MAX_MARGIN = 8  # screen pixels; chief rays that are wrong by more are a bug
MAX_TILE_BYTES = 2**19  # a larger detector tile would leave the core's cache
TILE_BYTES_PER_RAY = 4  # with more, clearing and merging a tile costs more than its rays' atomics


def trace(
    scene: Scene,
    *,
    device: Device | None = None,
    estimator: str = "adjoint",
    sampler: str = "philox",
    precision: str = "fp32",
    rays_per_pixel: int = 1024,
    replicates: int = 8,
    seed: int = 1,
    aim: str = "mirror",
    overfill: float = 1.0,
    smoothing: bool = False,
    progress: Callable[[int, int], None] | None = None,
    launch_rays: int | None = None,
) -> Transport | LineLight | PathLight:
    """Trace rays_per_pixel rays per screen pixel (forward) or per detector pixel (adjoint).

    The analytic estimator takes no rays and no device, so none of the other arguments, and gives light curves alone.

    device: as select_device gives it; None selects one. replicates: independent parts of the rays, for error bars.
    estimator, sampler, precision, seed, aim, overfill, smoothing: see TraceOptions. progress(done, total) is called
    after each launch with ray numbers. launch_rays: rays per launch, instead of timing; no result depends on it. Same
    seed and device, same bits.

    Raises ValueError for an argument out of range, SceneError if no pixel sees the screen, DeviceError if the device
    cannot do it.
    """
    options = TraceOptions(estimator, sampler, precision, seed, aim, overfill, smoothing)
    if estimator == NONSEQUENTIAL:
        return trace_paths(scene, device=device, sampler=sampler, precision=precision, rays_per_pixel=rays_per_pixel,
                           replicates=replicates, seed=seed, overfill=overfill, progress=progress)  # fmt: skip
    check_sequential(scene, estimator)
    if estimator == ANALYTIC:
        return trace_analytic(scene)
    rays = share_rays(rays_per_pixel, replicates)
    if smoothing and rays.max() > MAX_SMOOTHED_RAYS:
        raise ValueError(
            f"--rays-per-pixel = {rays_per_pixel}: with --smoothing, must be at most 2^32 for each replicate"
        )
    device = device if device is not None else select_device()
    return _trace_rays(scene, device, options, rays, progress, launch_rays)


def _trace_rays(scene: Scene, device: Device, options: TraceOptions, rays: np.ndarray, progress, launch_rays):
    """The forward or the adjoint estimator, with windows as wide as it takes."""
    started = time.perf_counter()
    calibration = calibrate(scene)
    check_visible(calibration, f"scene {scene.name}")
    margin = 1
    while True:
        tracer = Tracer(calibration, device, options, margin, rays=int(rays.max()), replicates=len(rays))
        built = time.perf_counter()
        counts, fates = tracer.run(rays, progress, launch_rays)
        if fates[Fate.OFF_WINDOW] == 0:
            break
        margin *= 2  # light fell beside a window: wider ones, from the start
        if margin > MAX_MARGIN:
            raise RuntimeError(f"{fates[Fate.OFF_WINDOW]} rays land where no chief ray says that light can come")
    traced = time.perf_counter()
    ledger = ledger_from(fates, int(rays.sum()) * tracer.streams)
    seconds = {"build": built - started, "trace": traced - built, "kernels": tracer.kernel_seconds}
    windows, facts = tracer.windows, device.describe()
    if options.smoothing:
        flux = line_flux(counts, windows, tracer.unit_w[:, 0], rays)
        return LineLight(scene, options, facts, windows, flux, rays, ledger, seconds)
    return Transport(scene, options, facts, windows, counts, tracer.unit_w, rays, ledger, seconds)


def check_sequential(scene: Scene, estimator: str) -> None:
    """Refuse, with a ValueError, a scene with what only the non-sequential estimator sees."""
    if scene.is_sequential:
        return
    if scene.element:
        what = f"element[0].name = {scene.element[0].name!r}"
    elif scene.mirror.scatter is not None:
        what = f"mirror.scatter.model = {type(scene.mirror.scatter).__name__.lower()!r}"
    else:
        what = f"camera.lens = {scene.camera.lens!r}"
    must = f"must be left out with --estimator {estimator}, or --estimator be {NONSEQUENTIAL}"
    raise ValueError(f"scene {scene.name}: {what}: {must}")


class Tracer:
    """One estimator's kernel and buffers for one scene on one device, built and warm.

    margin: screen pixels that the windows are wider than the chief rays say. rays: that a stream is about to get, which
    decides how they are best added up. width: rays side by side in a work-item,
    None: the device's. accumulate: member of the accumulate_* kernel files, None: the device's. replicates: that `run`
    is to keep; their memory is checked before anything is made. streams: sources of
    rays (screen or detector pixels). unit_w: flux [W] of one count in a run of one ray per stream, broadcasting to
    [n, window rows, window columns]. source: what was built. kernel_seconds: spent in kernels by `run` so far.

    Raises DeviceError if the device cannot build or hold it, ValueError if the memory cannot.
    """

    def __init__(
        self,
        calibration: Calibration,
        device: Device,
        options: TraceOptions,
        margin: int = 1,
        rays: int = MAX_RAYS_PER_ITEM,
        width: int | None = None,
        accumulate: str | None = None,
        replicates: int = 1,
    ):
        check_precision(device, options.precision)
        check_sequential(calibration.scene, options.estimator)
        self.options, self.scene, self.windows = options, calibration.scene, place_windows(calibration, margin)
        self._detector_pixels = int(np.prod(calibration.shape))
        rows, columns = self.windows.rows, self.windows.columns
        self._bins = (columns + 2 + rows + 2,) if options.smoothing else (rows, columns)  # of a slot
        self._check_memory(1 + replicates)
        packed = pack(calibration, options.precision)
        sources, self.unit_w = self._sources(calibration)
        self.streams, self._pace = len(sources), Pace()
        tile = LocalMemory(self._tile_bytes())
        if accumulate is None:
            fits = tile.nbytes <= min(MAX_TILE_BYTES, device.local_memory_bytes, rays * TILE_BYTES_PER_RAY)
            accumulate = "tile" if device.kind == "cpu" and fits else "atomic"
        choices = packed.choices | {"sampler": options.sampler, "accumulate": accumulate}
        width = width or device.vector_width(options.precision)
        entry = "trace_lines" if options.smoothing else f"trace_{options.estimator}"
        self.source = compose(f"{entry}.cl", choices, packed.structs, options.precision, width, packed.constants)
        self._workspace = work = Workspace(device, self.source, entry)
        self._counts = work.empty(self._counts_bytes())
        self._ledger = work.empty(8 * len(Fate))
        lookup = [work.upload(array) for array in self._lookup()]
        self._before = [work.upload(packed.scene)]
        tile = tile if accumulate == "tile" else LocalMemory(8)
        self._after = [work.upload(sources), *lookup, self._counts, self._ledger, tile]
        work.clear(self._ledger)
        self._launch(0, 0, 1, 0, 0)  # no rays: some drivers compile at the first launch

    def _counts_bytes(self) -> int:
        return 8 * len(self.windows.pixels) * int(np.prod(self._bins))

    def _check_memory(self, copies: int) -> None:
        """Refuse, with a ValueError, windows that do not fit the memory so often: on the device, and of replicates."""
        windows = f"{len(self.windows.pixels)} windows of {self.windows.columns} x {self.windows.rows} screen pixels"
        check_memory(f"scene {self.scene.name}: {windows}", copies * self._counts_bytes())

    def _sources(self, calibration: Calibration) -> tuple[np.ndarray, np.ndarray]:
        """The kernel's emitters or receivers, and unit_w."""
        screen, camera, mirror = self.scene.screen, self.scene.camera, self.scene.mirror
        gain = screen.radiance * mirror.reflectance * camera.transmittance
        if self.options.estimator == "forward":
            sources, area = emitters(
                calibration, self.options.precision, self.options.overfill, self.options.aim
            )
            unit = (gain * screen.pitch_mm**2 * area).reshape(screen.pixels[::-1])
            return sources, self.windows.gather(unit)
        pixels, origins = self.windows.pixels, self.windows.origins
        area = np.pi / 4 * camera.aperture_diameter_mm**2 * camera.detector.pitch_mm**2
        unit = gain * area / camera.image_distance_mm**2 * cosine4(calibration, pixels) / WEIGHT_ONE
        made = line_receivers if self.options.smoothing else receivers
        return made(calibration, pixels, origins, self.options.precision), unit[:, None, None]

    def _tile_bytes(self) -> int:
        """Local memory of a work-item that accumulates in a tile of its own."""
        if self.options.estimator == "forward":
            return 4 * self._detector_pixels
        return 8 * (int(np.prod(self._bins)) + len(Fate))

    def _lookup(self) -> list[np.ndarray]:
        """Forward: where a detector pixel's window is. An adjoint receiver knows."""
        if self.options.estimator == "adjoint":
            return []
        slots = np.full(self._detector_pixels, -1, np.int32)
        slots[self.windows.pixels] = np.arange(len(self.windows.pixels))
        return [slots, self.windows.origins]

    def run(self, rays: np.ndarray, progress=None, launch_rays: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Trace rays [replicates] rays per stream: counts [replicates, n, window rows, window columns], rays [Fate].

        With smoothing, counts are second differences (see kernels/trace_lines.cl).
        """
        work = self._workspace
        counts = np.empty((len(rays), len(self.windows.pixels), *self._bins), np.uint64)
        done, total = 0, int(rays.sum()) * self.streams
        self._pace.kernel_seconds = 0.0
        work.clear(self._ledger)
        for replicate, of_stream in enumerate(rays):
            work.clear(self._counts)
            pace = (lambda: launch_rays) if launch_rays else self._pace.launch_rays
            for part in plan_launches(self.streams, int(of_stream), pace, MAX_RAYS_PER_ITEM):
                self._launch(replicate, *part)
                done += part[1] * part[3]
                if progress is not None:
                    progress(done, total)
            work.download(self._counts, counts[replicate])
        fates = work.download(self._ledger, np.zeros(len(Fate), np.uint64))
        if self.options.estimator == "adjoint":  # its windows hold weights, so the kernel counts only the others
            fates[Fate.DETECTED] = total - int(fates.sum())
        return counts, fates

    def throughput(self, rays: int) -> float:
        """Rays per second of one launch of about that many rays, from its kernel's time.

        Every stream gets enough rays that what is done once per work-item does not count; with many streams, only those
        in the middle take part.
        """
        of_stream = max(rays // self.streams, MIN_TIMED_RAYS)
        streams = max(1, min(self.streams, rays // of_stream))
        self._pace.kernel_seconds = 0.0
        self._workspace.clear(self._counts)
        self._launch(0, (self.streams - streams) // 2, streams, 0, of_stream)
        return of_stream * streams / self.kernel_seconds

    @property
    def kernel_seconds(self) -> float:
        return self._pace.kernel_seconds

    def _launch(self, replicate: int, first_stream: int, streams: int, first_ray: int, rays: int) -> None:
        per_item = max(1, min(rays, MAX_RAYS_PER_ITEM))
        part = (first_stream, streams, first_ray, rays)
        launch = launch_structure(self.scene, self.options, replicate, part, per_item)
        launch["window_columns"], launch["window_rows"] = self.windows.columns, self.windows.rows
        parts = max(1, -(-rays // per_item))
        seconds = self._workspace.launch((streams, parts), [*self._before, launch, *self._after])
        self._pace.launched(streams * rays, seconds)
