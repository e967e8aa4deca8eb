"""How a trace is cut into launches, and how large these are."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from irtscots_cl.interface import LAUNCH
from irtscots_cl.options import TraceOptions
from irtscots_cl.scene import Scene

MAX_RAYS_PER_ITEM = 2**18  # of one work-item: amortises its tile, and keeps every 32-bit tile bin below 2^32
FIRST_LAUNCH_RAYS = 2**24  # before a launch has been timed
LAUNCH_SECONDS = 0.4  # aimed at, so that progress and interruption stay responsive


def share_rays(rays_per_pixel: int, replicates: int) -> np.ndarray:
    """Rays per stream of each replicate [replicates], as equal as whole numbers allow."""
    if not 1 <= replicates <= 1024:
        raise ValueError(f"--replicates = {replicates}: must be 1 to 1024")
    if not replicates <= rays_per_pixel <= 2**40:
        most = f"must be at least the {replicates} replicates and at most 2^40"
        raise ValueError(f"--rays-per-pixel = {rays_per_pixel}: {most}")
    rays = np.full(replicates, rays_per_pixel // replicates, dtype=np.int64)
    rays[: rays_per_pixel % replicates] += 1
    return rays


def plan_launches(
    streams: int, rays: int, launch_rays: Callable[[], int], per_item: int = MAX_RAYS_PER_ITEM
) -> Iterator[tuple[int, int, int, int]]:
    """Cut streams x rays into launches of about launch_rays() rays: (first stream, streams, first ray, rays).

    Every launch begins at a multiple of per_item, the rays of a work-item: whole blocks.
    """
    first_ray = 0
    while first_ray < rays:
        items = max(1, launch_rays() // streams // per_item)
        per_stream = min(rays - first_ray, items * per_item)
        first_stream = 0
        while first_stream < streams:
            count = min(streams - first_stream, max(1, launch_rays() // per_stream))
            yield first_stream, count, first_ray, per_stream
            first_stream += count
        first_ray += per_stream


def cut_part(
    part: tuple[int, int, int, int], launch_rays: Callable[[], int], per_item: int
) -> Iterator[tuple[int, int, int, int]]:
    """Cut a part, as plan_launches gives it, into launches of about launch_rays() rays."""
    first_stream, streams, first_ray, rays = part
    for stream, count, ray, of_stream in plan_launches(streams, rays, launch_rays, per_item):
        yield first_stream + stream, count, first_ray + ray, of_stream


class Pace:
    """Rays per second of the launches so far, and the seconds spent in kernels."""

    def __init__(self):
        self.kernel_seconds, self._rays_per_second = 0.0, 0.0

    def launched(self, rays: int, seconds: float) -> None:
        self.kernel_seconds += seconds
        if rays:
            self._rays_per_second = max(rays / max(seconds, 1e-6), 1e6)

    @property
    def rays_per_second(self) -> float:
        """Of the last launch; 0 before any was timed."""
        return self._rays_per_second

    def launch_rays(self, first: int = FIRST_LAUNCH_RAYS) -> int:
        """Rays of the next launch; `first` before any was timed."""
        return int(self._rays_per_second * LAUNCH_SECONDS) or first


def launch_structure(
    scene: Scene, options: TraceOptions, replicate: int, part: tuple[int, int, int, int], per_item: int
) -> np.ndarray:
    """The kernels' Launch [()] of a part as plan_launches gives it; its window's size is left to the caller."""
    first_stream, _, first_ray, rays = part
    columns, rows = scene.camera.detector.pixels
    launch = np.zeros((), LAUNCH)
    for name, value in {
        "first_ray": first_ray,
        "ray_count": rays,
        "rays_per_item": per_item,
        "first_stream": first_stream,
        "replicate": replicate,
        "seed_low": options.seed & 0xFFFFFFFF,
        "seed_high": options.seed >> 32,
        "screen_columns": scene.screen.pixels[0],
        "screen_rows": scene.screen.pixels[1],
        "detector_pixels": rows * columns,
    }.items():
        launch[name] = value
    return launch
