"""Runs the rays of a trace, launch by launch: a job adds up whole numbers on its device, replicate by replicate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from irtscots_cl.execution.checkpoint import KeptTrace
from irtscots_cl.execution.job import Job
from irtscots_cl.execution.launch_plan import Place, plan_launches


def run_rays(
    job: Job,
    rays: np.ndarray,
    progress: Callable[[int, int], None] | None = None,
    launch_rays: int | None = None,
    kept: KeptTrace | None = None,
    finished: Callable[[tuple[np.ndarray, ...]], None] | None = None,
) -> tuple[np.ndarray, ...]:
    """Trace rays [replicates] rays per stream; returns the job's sums, each [replicates, ...].

    progress(done, total) is called after each launch with ray numbers. launch_rays: rays per launch, instead of timing.
    kept: where the sums are saved now and then, and what is there is gone on with. finished: called with the sums so
    far when a replicate is complete and others are to come. Raises checkpoint.Interrupted if kept says so.
    """
    total, end, place = int(rays.sum()) * job.streams, Place(len(rays)), Place()
    job.pace.kernel_seconds = 0.0
    job.clear()
    found = tuple(np.zeros((len(rays), *array.shape), array.dtype) for array in job.sums())
    if kept is not None:
        place = kept.begin(job.facts, rays, job.streams, job.max_rays_per_item, found)
    if progress is not None and place != Place():
        progress(place.rays_before(rays, job.streams), total)
    while place != end:
        replicate, of_replicate = place.replicate, int(rays[place.replicate])
        paced = _pace(job, launch_rays)
        for part in plan_launches(job.streams, of_replicate, paced, job.max_rays_per_item, place):
            job.launch(replicate, part)
            place = place.after(part, job.streams, of_replicate)
            if progress is not None:
                progress(place.rays_before(rays, job.streams), total)
            if place.replicate > replicate:
                _collect(job, found, replicate)
                if finished is not None and place != end:
                    finished(tuple(array[: place.replicate] for array in found))
            if kept is not None and place != end:
                kept.launched(place, job.pace.kernel_seconds, lambda at=place.replicate: _collect(job, found, at))
    if kept is not None:
        kept.ended(place, job.pace.kernel_seconds)
    return found


def _collect(job: Job, found: tuple[np.ndarray, ...], replicate: int) -> None:
    """Move the job's sums to the replicate's."""
    for all_of, array in zip(found, job.sums(), strict=True):
        all_of[replicate] += array
    job.clear()


def _pace(job: Job, launch_rays: int | None) -> Callable[[], int]:
    return lambda: launch_rays or job.pace.launch_rays(job.first_launch_rays)
