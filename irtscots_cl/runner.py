"""Runs the rays of a trace, launch by launch: a job adds up whole numbers on its device, replicate by replicate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from irtscots_cl.launches import Pace, plan_launches


class Job(Protocol):
    """A built kernel with its buffers, for one scene on one device.

    streams: sources of rays. max_rays_per_item: of a work-item. first_launch_rays: before a launch has been timed.
    pace: of the launches so far.
    """

    streams: int
    max_rays_per_item: int
    first_launch_rays: int
    pace: Pace

    def clear(self) -> None:
        """Set the sums to zero."""

    def launch(self, replicate: int, part: tuple[int, int, int, int]) -> None:
        """Trace a part of a replicate's rays, as plan_launches gives it, into the sums."""

    def sums(self) -> tuple[np.ndarray, ...]:
        """The sums of all launches since the last clear: whole numbers, so they do not depend on the launches."""


def run_rays(
    job: Job,
    rays: np.ndarray,
    progress: Callable[[int, int], None] | None = None,
    launch_rays: int | None = None,
) -> tuple[np.ndarray, ...]:
    """Trace rays [replicates] rays per stream; returns the job's sums, each [replicates, ...].

    progress(done, total) is called after each launch with ray numbers. launch_rays: rays per launch, instead of timing.
    """
    done, total, found = 0, int(rays.sum()) * job.streams, []
    job.pace.kernel_seconds = 0.0
    for replicate, of_stream in enumerate(rays):
        job.clear()
        for part in plan_launches(job.streams, int(of_stream), _pace(job, launch_rays), job.max_rays_per_item):
            job.launch(replicate, part)
            done += part[1] * part[3]
            if progress is not None:
                progress(done, total)
        sums = job.sums()
        found = found or [np.empty((len(rays), *array.shape), array.dtype) for array in sums]
        for all_of, array in zip(found, sums, strict=True):
            all_of[replicate] = array
    return tuple(found)


def _pace(job: Job, launch_rays: int | None) -> Callable[[], int]:
    return lambda: launch_rays or job.pace.launch_rays(job.first_launch_rays)
