"""Runs the rays of a trace, launch by launch: a job adds up whole numbers on its device, replicate by replicate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from irtscots_cl.execution.checkpoint import Checkpoint
from irtscots_cl.execution.job import Job
from irtscots_cl.execution.launch_plan import Cursor, plan_launches


def run_rays(
    job: Job,
    rays: np.ndarray,
    progress: Callable[[int, int], None] | None = None,
    launch_rays: int | None = None,
    kept: Checkpoint | None = None,
    finished: Callable[[tuple[np.ndarray, ...]], None] | None = None,
) -> tuple[np.ndarray, ...]:
    """Trace rays [replicates] rays per stream; returns the job's sums, each [replicates, ...].

    progress(done, total) is called after each launch with ray numbers. launch_rays: rays per launch, instead of timing.
    kept: where the sums are saved now and then, and what is there is gone on with. finished: called with the sums so
    far when a replicate is complete and others are to come. Raises checkpoint.Interrupted if kept says so.
    """
    total, end, cursor = int(rays.sum()) * job.sources, Cursor(len(rays)), Cursor()
    job.rate_meter.kernel_seconds = 0.0
    job.clear()
    found = tuple(np.zeros((len(rays), *array.shape), array.dtype) for array in job.sums())
    if kept is not None:
        cursor = kept.begin(job.facts, rays, job.sources, job.max_rays_per_item, found)
    if progress is not None and cursor != Cursor():
        progress(cursor.rays_before(rays, job.sources), total)
    while cursor != end:
        replicate, of_replicate = cursor.replicate, int(rays[cursor.replicate])
        paced = _pace(job, launch_rays)
        for part in plan_launches(job.sources, of_replicate, paced, job.max_rays_per_item, cursor):
            job.launch(replicate, part)
            cursor = cursor.after(part, job.sources, of_replicate)
            if progress is not None:
                progress(cursor.rays_before(rays, job.sources), total)
            if cursor.replicate > replicate:
                _collect(job, found, replicate)
                if finished is not None and cursor != end:
                    finished(tuple(array[: cursor.replicate] for array in found))
            if kept is not None and cursor != end:
                kept.launched(
                    cursor, job.rate_meter.kernel_seconds, lambda at=cursor.replicate: _collect(job, found, at)
                )
    if kept is not None:
        kept.ended(cursor, job.rate_meter.kernel_seconds)
    return found


def _collect(job: Job, found: tuple[np.ndarray, ...], replicate: int) -> None:
    """Move the job's sums to the replicate's."""
    for all_of, array in zip(found, job.sums(), strict=True):
        all_of[replicate] += array
    job.clear()


def _pace(job: Job, launch_rays: int | None) -> Callable[[], int]:
    return lambda: launch_rays or job.rate_meter.launch_rays(job.first_launch_rays)
