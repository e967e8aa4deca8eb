"""A job without a device: its sums tell whether every ray was traced once."""

from __future__ import annotations

import numpy as np

from irtscots_cl.execution.launch_plan import RateMeter
from irtscots_cl.execution.task import add_to

SOURCES, PER_ITEM = 5, 4
RAYS = np.array([13, 13, 12])  # of each replicate


class CountingJob:
    """A task.Tracer. Every ray adds a word of its own, modulo 2^64, to its stream's sum and to all streams'."""

    sources, max_rays_per_item, first_launch_rays = SOURCES, PER_ITEM, 16

    def __init__(self, seed: int = 1, size: int = 1):
        """size: of a stream's sums, all alike but in what each ray adds."""
        self.rate_meter, self.fingerprint, self.launches = RateMeter(), {"code": "ab" * 16}, []
        self._words = np.arange(1, size + 1, dtype=np.uint64)
        self.sums_shapes = (SOURCES, size), (3,)
        self._seed = np.uint64(seed)
        self.clear()

    def clear(self):
        self._of_stream, self._of_all = (np.zeros(shape, np.uint64) for shape in self.sums_shapes)

    def begin(self, sums):
        self._into = sums
        self.clear()

    def collect(self):
        add_to(self._into, self.sums())
        self.clear()

    def launch(self, replicate, block):
        first_source, sources, first_ray, rays = block
        assert first_ray % PER_ITEM == 0
        self.launches.append((replicate, *block))
        for source in range(first_source, first_source + sources):
            for ray in range(first_ray, first_ray + rays):
                word = np.uint64(hash((replicate, source, ray)) & (2**64 - 1)) + self._seed
                self._of_stream[source] += word * self._words
                self._of_all += np.array([1, source, ray], np.uint64)

    def sums(self):
        return self._of_stream.copy(), self._of_all.copy()


def same(a, b) -> bool:
    """The same arrays, bit by bit."""
    return all(x.dtype == y.dtype and x.tobytes() == y.tobytes() for x, y in zip(a, b, strict=True))
