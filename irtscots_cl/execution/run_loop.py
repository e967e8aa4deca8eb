"""Runs the rays of a trace launch by launch; the sums are taken replicate by replicate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from irtscots_cl.execution.executor import RunControl
from irtscots_cl.execution.launch_plan import Cursor, plan_launches
from irtscots_cl.execution.task import Tracer
from irtscots_cl.system import interruption


def run_rays(tracer: Tracer, rays: np.ndarray, control: RunControl = RunControl()) -> tuple[np.ndarray, ...]:  # noqa: B008  frozen
    """Trace rays [replicates] rays per source; returns the sums, each [replicates, ...].

    Raises checkpoint.Interrupted if the checkpoint ends the run.
    """
    checkpoint, progress = control.checkpoint, control.progress
    total, end, cursor = int(rays.sum()) * tracer.sources, Cursor(len(rays)), Cursor()
    tracer.rate_meter.kernel_seconds = 0.0
    found = tuple(np.zeros((len(rays), *shape), np.uint64) for shape in tracer.sums_shapes)
    if checkpoint is not None:
        cursor = checkpoint.begin(tracer.fingerprint, rays, tracer.sources, tracer.max_rays_per_item, found)
    if progress is not None and cursor != Cursor():
        progress(cursor.rays_before(rays, tracer.sources), total)
    while cursor != end:
        replicate, of_replicate = cursor.replicate, int(rays[cursor.replicate])
        size = _launch_size(tracer, control.launch_rays)
        tracer.begin(tuple(array[replicate] for array in found))
        for block in plan_launches(tracer.sources, of_replicate, size, tracer.max_rays_per_item, cursor):
            tracer.launch(replicate, block)
            cursor = cursor.after(block, tracer.sources, of_replicate)
            if progress is not None:
                progress(cursor.rays_before(rays, tracer.sources), total)
            if cursor.replicate > replicate:
                tracer.collect()
                if control.on_replicate is not None and cursor != end:
                    control.on_replicate(tuple(array[: cursor.replicate] for array in found))
            if checkpoint is None:
                interruption.check()
            elif cursor != end:
                seconds = tracer.rate_meter.kernel_seconds
                checkpoint.launched(cursor, seconds, tracer.collect)
    if checkpoint is not None:
        checkpoint.ended(cursor, tracer.rate_meter.kernel_seconds)
    return found


def _launch_size(tracer: Tracer, launch_rays: int | None) -> Callable[[], int]:
    return lambda: launch_rays or tracer.rate_meter.launch_rays(tracer.first_launch_rays)
