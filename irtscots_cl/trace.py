"""Trace a scene on a device: scene + device -> Transport, by the forward or the adjoint estimator."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from irtscots_cl.calibration import Calibration, check_visible
from irtscots_cl.device import Device, select_device
from irtscots_cl.execution import LocalMemory, Workspace
from irtscots_cl.interface import LAUNCH, WEIGHT_ONE, Fate
from irtscots_cl.packing import Packed, cosine4, emitters, pack, receivers
from irtscots_cl.program import Source, check_precision, compose
from irtscots_cl.samplers import SAMPLERS
from irtscots_cl.scene import Scene
from irtscots_cl.transport import Transport, gather, ledger_from

ESTIMATORS = ("forward", "adjoint")
MAX_RAYS_PER_ITEM = 2**18  # of one work-item: amortises its tile, and keeps every 32-bit tile bin below 2^32
FIRST_LAUNCH_RAYS = 2**24  # before a launch has been timed
LAUNCH_SECONDS = 0.4  # aimed at, so that progress and interruption stay responsive
MAX_TILE_BYTES = 2**19  # a larger detector tile would leave the core's cache


@dataclass(frozen=True)
class Windows:
    """The transport's windows: pixels [n], origins [n, 2] (column, row), and the size of all of them."""

    pixels: np.ndarray
    origins: np.ndarray
    rows: int
    columns: int


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
    overfill: float = 1.0,
    progress: Callable[[int, int], None] | None = None,
    launch_rays: int | None = None,
) -> Transport:
    """Trace rays_per_pixel rays per screen pixel (forward) or per detector pixel (adjoint).

    device: as select_device gives it; None selects one. replicates: independent parts of the rays, for error bars.
    overfill: forward only, solid angle of the emission over the least that covers the mirror. progress(done, total) is
    called after each launch with ray numbers. launch_rays: rays per launch, instead of timing; no result depends on it.
    Same seed and device, same bits.

    Raises ValueError for an argument out of range, SceneError if no pixel sees the screen, DeviceError if the device
    cannot do it.
    """
    _check(estimator, sampler, rays_per_pixel, replicates, seed, overfill)
    device = device if device is not None else select_device()
    check_precision(device, precision)
    started = time.perf_counter()
    calibration = Calibration(scene)
    check_visible(calibration, f"scene {scene.name}")
    margin = 1
    while True:
        job = _Job(
            calibration, device, estimator, sampler, precision, seed, overfill, place_windows(calibration, margin)
        )
        rays = np.full(replicates, rays_per_pixel // replicates, dtype=np.int64)
        rays[: rays_per_pixel % replicates] += 1
        built = time.perf_counter()
        counts, fates = job.run(rays, progress, launch_rays)
        if fates[Fate.OFF_WINDOW] == 0:
            break
        margin *= 2  # light fell beside a window: wider ones, from the start
    launched = int(rays.sum()) * job.streams
    if estimator == "adjoint":  # its windows hold weights, not counts
        fates[Fate.DETECTED] = launched - int(fates.sum())
    seconds = {"build": built - started, "trace": time.perf_counter() - built}
    return Transport(
        scene,
        estimator,
        sampler,
        precision,
        seed,
        overfill,
        device.describe(),
        job.windows.pixels,
        job.windows.origins,
        counts,
        job.unit_w,
        rays,
        ledger_from(fates, launched),
        seconds,
    )


def _check(estimator, sampler, rays_per_pixel, replicates, seed, overfill) -> None:
    if estimator not in ESTIMATORS:
        raise ValueError(f"--estimator = {estimator!r}: must be one of {', '.join(ESTIMATORS)}")
    if sampler not in SAMPLERS:
        raise ValueError(f"--sampler = {sampler!r}: must be one of {', '.join(SAMPLERS)}")
    if not 1 <= replicates <= 1024:
        raise ValueError(f"--replicates = {replicates}: must be 1 to 1024")
    if not replicates <= rays_per_pixel <= 2**40:
        raise ValueError(
            f"--rays-per-pixel = {rays_per_pixel}: must be at least the {replicates} replicates and at most 2^40"
        )
    if not 0 <= seed < 2**64:
        raise ValueError(f"--seed = {seed}: must be 0 to 2^64 - 1")
    if not 1.0 <= overfill <= 1e4:
        raise ValueError(f"--overfill = {overfill}: must be 1 to 10000")


def place_windows(calibration: Calibration, margin: int) -> Windows:
    """Windows of equal size around what the chief rays say, widened by margin screen pixels and kept on the screen."""
    pixels = np.flatnonzero(calibration.sees_mirror)
    lowest, highest = (edge.reshape(-1, 2)[pixels] for edge in calibration.landing_range())
    size = np.array(calibration.scene.screen.pixels)
    first = np.floor(np.clip(np.nan_to_num(lowest + 0.5, nan=0.0), -1e6, 1e6)).astype(int) - margin
    last = np.floor(np.clip(np.nan_to_num(highest + 0.5, nan=0.0), -1e6, 1e6)).astype(int) + margin
    on_screen = np.all((last >= 0) & (first < size), axis=-1)
    extent = np.clip(last, 0, size - 1) - np.clip(first, 0, size - 1) + 1
    columns, rows = extent[on_screen].max(0)
    origins = np.clip(first, 0, size - [columns, rows])
    return Windows(pixels, origins.astype(np.int32), int(rows), int(columns))


def plan_launches(streams: int, rays: int, launch_rays: Callable[[], int]) -> Iterator[tuple[int, int, int, int]]:
    """Cut streams x rays into launches of about launch_rays() rays: (first stream, streams, first ray, rays)."""
    first_ray = 0
    while first_ray < rays:
        wanted = launch_rays()
        per_stream = min(rays - first_ray, max(MAX_RAYS_PER_ITEM, wanted // streams))
        first_stream = 0
        while first_stream < streams:
            count = min(streams - first_stream, max(1, launch_rays() // per_stream))
            yield first_stream, count, first_ray, per_stream
            first_stream += count
        first_ray += per_stream


class _Job:
    """One estimator's kernel and buffers for one scene and one choice of windows."""

    def __init__(
        self,
        calibration: Calibration,
        device: Device,
        estimator: str,
        sampler: str,
        precision: str,
        seed: int,
        overfill: float,
        windows: Windows,
    ):
        self.windows, self.seed, self.scene = windows, seed, calibration.scene
        self.detector_pixels = int(np.prod(calibration.shape))
        screen, camera, mirror = self.scene.screen, self.scene.camera, self.scene.mirror
        gain = screen.radiance * mirror.reflectance * camera.transmittance
        packed = pack(calibration, precision)
        if estimator == "forward":
            sources, area = emitters(calibration, precision, overfill)
            unit = (gain * screen.pitch_mm**2 * area).reshape(screen.pixels[::-1])
            self.unit_w = gather(unit, windows.origins, windows.rows, windows.columns)
            tile = LocalMemory(4 * self.detector_pixels)
        else:
            sources = receivers(calibration, windows.pixels, windows.origins, precision)
            area = np.pi / 4 * camera.aperture_diameter_mm**2 * camera.detector.pitch_mm**2
            unit = gain * area / camera.image_distance_mm**2 * cosine4(calibration, windows.pixels) / WEIGHT_ONE
            self.unit_w = unit[:, None, None]
            tile = LocalMemory(8 * (windows.rows * windows.columns + len(Fate)))
        self.streams = len(sources)
        tiled = device.kind == "cpu" and tile.nbytes <= min(MAX_TILE_BYTES, device.local_memory_bytes)
        self.source = compose_trace(packed, device, estimator, sampler, precision, "tile" if tiled else "atomic")
        self._workspace = work = Workspace(device, self.source, f"trace_{estimator}")
        self._counts = work.empty(8 * len(windows.pixels) * windows.rows * windows.columns)
        self._ledger = work.empty(8 * len(Fate))
        slots = np.full(self.detector_pixels, -1, np.int32)
        slots[windows.pixels] = np.arange(len(windows.pixels))
        lookup = [work.upload(slots), work.upload(windows.origins)] if estimator == "forward" else []
        self._before = [work.upload(packed.scene)]
        self._after = [work.upload(sources), *lookup, self._counts, self._ledger, tile if tiled else LocalMemory(8)]
        self._rays_per_second = 0.0

    def run(self, rays: np.ndarray, progress, launch_rays: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Trace all replicates: counts [replicates, n, window rows, window columns] and the ledger [Fate]."""
        windows, work = self.windows, self._workspace
        counts = np.empty((len(rays), len(windows.pixels), windows.rows, windows.columns), np.uint64)
        fates = np.zeros(len(Fate), np.uint64)
        done, total = 0, int(rays.sum()) * self.streams
        work.clear(self._ledger)
        for replicate, of_stream in enumerate(rays):
            work.clear(self._counts)
            for part in plan_launches(self.streams, int(of_stream), lambda: launch_rays or self._launch_rays()):
                self._launch(replicate, *part)
                done += part[1] * part[3]
                if progress is not None:
                    progress(done, total)
            work.download(self._counts, counts[replicate])
        return counts, work.download(self._ledger, fates)

    def _launch_rays(self) -> int:
        return int(self._rays_per_second * LAUNCH_SECONDS) or FIRST_LAUNCH_RAYS

    def _launch(self, replicate: int, first_stream: int, streams: int, first_ray: int, rays: int) -> None:
        per_item = min(rays, MAX_RAYS_PER_ITEM)
        launch = np.zeros((), LAUNCH)
        for name, value in {
            "first_ray": first_ray,
            "ray_count": rays,
            "rays_per_item": per_item,
            "first_stream": first_stream,
            "replicate": replicate,
            "seed_low": self.seed & 0xFFFFFFFF,
            "seed_high": self.seed >> 32,
            "screen_columns": self.scene.screen.pixels[0],
            "screen_rows": self.scene.screen.pixels[1],
            "detector_pixels": self.detector_pixels,
            "window_columns": self.windows.columns,
            "window_rows": self.windows.rows,
        }.items():
            launch[name] = value
        seconds = self._workspace.launch((streams, -(-rays // per_item)), [*self._before, launch, *self._after])
        self._rays_per_second = max(streams * rays / max(seconds, 1e-6), 1e6)


def compose_trace(
    packed: Packed, device: Device, estimator: str, sampler: str, precision: str, accumulate: str
) -> Source:
    """The estimator's kernel source for a packed scene on a device; accumulate: "tile" or "atomic"."""
    choices = packed.choices | {"sampler": sampler, "accumulate": accumulate}
    return compose(f"trace_{estimator}.cl", choices, packed.structs, precision, device.vector_width(precision))


def source_for(
    scene: Scene, device: Device, estimator: str = "adjoint", sampler: str = "philox", precision: str = "fp32"
) -> Source:
    """The exact source that `trace` builds for a scene. Raises as trace does."""
    _check(estimator, sampler, rays_per_pixel=1, replicates=1, seed=0, overfill=1.0)
    check_precision(device, precision)
    calibration = Calibration(scene)
    check_visible(calibration, f"scene {scene.name}")
    job = _Job(calibration, device, estimator, sampler, precision, 0, 1.0, place_windows(calibration, 1))
    return job.source
