"""How a trace is cut into launches, and how large these are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from irtscots_cl.system.option_error import OptionError

MAX_RAYS_PER_ITEM = 2**18  # of one work-item: amortises its tile, and keeps every 32-bit tile bin below 2^32
FIRST_LAUNCH_RAYS = 2**24  # before a launch has been timed
LAUNCH_SECONDS = 0.4  # aimed at, so that progress and interruption stay responsive


def share_rays(rays_per_pixel: int, replicates: int) -> np.ndarray:
    """Rays per source of each replicate [replicates], as equal as whole numbers allow."""
    if not 1 <= replicates <= 1024:
        raise OptionError(f"--replicates = {replicates}: must be 1 to 1024")
    if not replicates <= rays_per_pixel <= 2**40:
        most = f"must be at least the {replicates} replicates and at most 2^40"
        raise OptionError(f"--rays-per-pixel = {rays_per_pixel}: {most}")
    rays = np.full(replicates, rays_per_pixel // replicates, dtype=np.int64)
    rays[: rays_per_pixel % replicates] += 1
    return rays


class RayBlock(NamedTuple):
    """Consecutive rays of consecutive sources: what one launch traces."""

    first_source: int
    sources: int
    first_ray: int
    rays: int  # of each source

    @property
    def total(self) -> int:
        """Rays of all its sources."""
        return self.sources * self.rays


class Cursor(NamedTuple):
    """Where a trace continues: all rays before it, in the order of plan_launches, are traced.

    first_ray: of a block of rays of all sources. block_rays: of each source in it; 0 where first_source is 0.
    """

    replicate: int = 0
    first_ray: int = 0
    block_rays: int = 0
    first_source: int = 0

    def after(self, block: RayBlock, sources: int, rays: int) -> Cursor:
        """The cursor after a block of this cursor's replicate, which has `rays` rays for each of its sources."""
        next_source, next_ray = block.first_source + block.sources, block.first_ray + block.rays
        if next_source < sources:
            return Cursor(self.replicate, block.first_ray, block.rays, next_source)
        if next_ray < rays:
            return Cursor(self.replicate, next_ray)
        return Cursor(self.replicate + 1)

    def rays_before(self, rays: np.ndarray, sources: int) -> int:
        """Of all sources; rays: [replicates] per source."""
        whole = int(rays[: self.replicate].sum()) + self.first_ray
        return whole * sources + self.first_source * self.block_rays

    def check(self, rays: np.ndarray, sources: int, per_item: int) -> None:
        """ValueError if no trace of rays [replicates] per source can have this cursor."""
        if not all(type(n) is int for n in self) or not 0 <= self.replicate <= len(rays):
            raise ValueError("place")
        left = (int(rays[self.replicate]) if self.replicate < len(rays) else 1) - self.first_ray
        block = 0 < self.block_rays <= left and (self.block_rays % per_item == 0 or self.block_rays == left)
        in_block = block if self.first_source else self.block_rays == 0
        fits = self.first_ray >= 0 and left > 0 and self.first_ray % per_item == 0 and in_block
        at_end = self.replicate < len(rays) or self == Cursor(len(rays))
        if not (fits and at_end and 0 <= self.first_source < sources):
            raise ValueError("place")


def plan_launches(
    sources: int,
    rays: int,
    launch_rays: Callable[[], int],
    per_item: int = MAX_RAYS_PER_ITEM,
    start: Cursor = Cursor(),  # noqa: B008  a tuple
) -> Iterator[RayBlock]:
    """Cut sources x rays into blocks of about launch_rays() rays, one per launch.

    Every launch begins at a multiple of per_item, the rays of a work-item: whole blocks. start: in this replicate.
    """
    _, first_ray, per_source, first_source = start
    while first_ray < rays:
        if not first_source:
            items = max(1, launch_rays() // sources // per_item)
            per_source = min(rays - first_ray, items * per_item)
        while first_source < sources:
            count = min(sources - first_source, max(1, launch_rays() // per_source))
            yield RayBlock(first_source, count, first_ray, per_source)
            first_source += count
        first_source, first_ray = 0, first_ray + per_source


def cut_block(block: RayBlock, launch_rays: Callable[[], int], per_item: int) -> Iterator[RayBlock]:
    """Cut a block into launches of about launch_rays() rays."""
    for piece in plan_launches(block.sources, block.rays, launch_rays, per_item):
        yield piece._replace(
            first_source=block.first_source + piece.first_source, first_ray=block.first_ray + piece.first_ray
        )


class RateMeter:
    """Rays per second of the launches so far, and the seconds spent in kernels."""

    def __init__(self) -> None:
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
