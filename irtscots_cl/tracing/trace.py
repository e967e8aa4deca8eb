"""The door of the simulation: scene and device to light transport, by any estimator."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from irtscots_cl.execution.checkpoint import Checkpoints
from irtscots_cl.execution.launch_plan import share_rays
from irtscots_cl.execution.select import executor_of
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.chief_rays import check_visible, chief_rays
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError
from irtscots_cl.system.memory import check_memory
from irtscots_cl.tracing.estimators.analytic import trace_analytic
from irtscots_cl.tracing.estimators.nonsequential import MIN_CHANCE, PILOT_RAYS, PathWork
from irtscots_cl.tracing.estimators.path_sums import TrackedPaths
from irtscots_cl.tracing.estimators.sequential import trace_rays
from irtscots_cl.tracing.fingerprint import trace_fingerprint
from irtscots_cl.tracing.options import (
    ANALYTIC,
    BRANCHES,
    MAX_SMOOTHED_RAYS,
    NONSEQUENTIAL,
    TraceOptions,
    check_sequential,
)
from irtscots_cl.tracing.results.paths import MAX_EVENTS, PathLight
from irtscots_cl.tracing.results.transport import LineLight, Transport


def trace(
    scene: Scene,
    *,
    device: Device | Sequence[Device] | None = None,
    client=None,
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
    keeper: Checkpoints | None = None,
    finished: Callable[[Transport | LineLight | PathLight], None] | None = None,
) -> Transport | LineLight | PathLight:
    """Trace rays_per_pixel rays per screen pixel (forward) or per detector pixel (adjoint).

    The analytic estimator takes no rays and no device, so none of the other arguments, and gives light curves alone.

    device: as select_device gives it, or several, as select_devices does: they share the rays, and results are the same
    bits as those of one if they are equal. None selects. client: a dask.distributed.Client, whose workers trace instead
    (cluster.py). replicates: independent parts of the rays, for error bars.
    estimator, sampler, precision, seed, aim, overfill, smoothing: see TraceOptions. progress(done, total) is called
    after each launch with ray numbers. launch_rays: rays per launch, instead of timing; no result depends on it. Same
    seed and device, same bits. keeper: saves the sums now and then, and goes on from what it has; an interrupted trace
    that goes on gives the bits of one that was not. finished: called with the trace so far when a replicate is complete
    and others are to come.

    Raises ValueError for an argument out of range, SceneError if no pixel sees the screen, DeviceError if the device
    cannot do it, checkpoint.Interrupted if the keeper ends it.
    """
    options = TraceOptions(estimator, sampler, precision, seed, aim, overfill, smoothing)
    if estimator == NONSEQUENTIAL:
        return trace_paths(scene, device=device, sampler=sampler, precision=precision, rays_per_pixel=rays_per_pixel,
                           replicates=replicates, seed=seed, overfill=overfill, progress=progress,
                           client=client, keeper=keeper, finished=finished)  # fmt: skip
    check_sequential(scene, estimator)
    if estimator == ANALYTIC:
        return trace_analytic(scene)
    rays = share_rays(rays_per_pixel, replicates)
    if smoothing and rays.max() > MAX_SMOOTHED_RAYS:
        raise ValueError(
            f"--rays-per-pixel = {rays_per_pixel}: with --smoothing, must be at most 2^32 for each replicate"
        )
    check_visible(chief_rays(scene), f"scene {scene.name}")
    executor = executor_of(device, client)
    tracked = (
        None if keeper is None else keeper.file_of(trace_fingerprint(scene, options, rays, executor.device_identity()))
    )
    return trace_rays(scene, executor, options, rays, progress, launch_rays, tracked, finished)


def trace_paths(
    scene: Scene,
    *,
    device: Device | Sequence[Device] | None = None,
    client=None,
    sampler: str = "philox",
    precision: str = "fp32",
    rays_per_pixel: int = 2**16,
    replicates: int = 8,
    seed: int = 1,
    overfill: float = 1.0,
    bounce_limit: int = MAX_EVENTS,
    least_chance: float = MIN_CHANCE,
    branches: str = "roulette",
    aimed_scatter: bool = True,
    progress: Callable[[int, int], None] | None = None,
    keeper: Checkpoints | None = None,
    finished: Callable[[PathLight], None] | None = None,
) -> PathLight:
    """Trace rays_per_pixel rays per screen pixel, aimed at the mirror, from element to element to their ends.

    bounce_limit: events after which a ray is given up (and counted). least_chance: with which a ray is reflected or
    refracted at an interface however small that share of its light is; its weight makes up for it. branches: "roulette"
    follows one of them, "both" both, as long as the weaker one weighs a thousandth of a ray and not too many rays wait
    to be followed. aimed_scatter: scattered rays are also aimed at the camera (parts.targets_of); without, only what
    finds it by chance counts. The rest as in tracer.trace. Raises as that does.
    """
    options = TraceOptions(NONSEQUENTIAL, sampler, precision, seed, overfill=overfill)
    if not 1 <= bounce_limit <= MAX_EVENTS:
        raise ValueError(f"--bounce-limit = {bounce_limit}: must be 1 to {MAX_EVENTS}")
    if not 0 <= least_chance <= 0.5:
        raise ValueError(f"--least-chance = {least_chance}: must be 0 to 0.5")
    if branches not in BRANCHES:
        raise ValueError(f"--branches = {branches!r}: must be one of {', '.join(BRANCHES)}")
    rays = share_rays(rays_per_pixel, replicates)
    how = {"bounce_limit": bounce_limit, "least_chance": least_chance, "branches": branches,
           "aimed_scatter": aimed_scatter}  # fmt: skip
    started = time.perf_counter()
    work, executor = PathWork(scene, options, **how), executor_of(device, client)
    size = 2 * 8 * len(rays) * int(np.prod(work.sums_shapes[0]))  # as whole numbers and in watts
    check_memory(f"scene {scene.name}: images of {len(rays)} replicates", size)
    work = work.tracking(TrackedPaths(*map(tuple, executor.call(find_paths, work.to_json()))))
    if not work.tracked.codes:
        raise SceneError(
            f"scene {scene.name}: detector: no path from the screen reaches it; must be reached by one of "
            f"{max(PILOT_RAYS // work.sources, 16) * work.sources} rays that look for paths"
        )
    found = time.perf_counter() - started
    file = (
        None
        if keeper is None
        else keeper.file_of(trace_fingerprint(scene, options, rays, executor.device_identity(), **how))
    )

    def so_far(sums: tuple[np.ndarray, ...]) -> None:
        seconds = {"build": found, "trace": 0.0, "kernels": 0.0}
        finished(work.result(*sums, rays[: len(sums[0])], executor.describe(), seconds))

    ran = executor.run(work, rays, progress, kept=file, finished=None if finished is None else so_far)
    before = {"build": found} | ({} if file is None else file.seconds)
    seconds = {name: ran.seconds[name] + before.get(name, 0.0) for name in ran.seconds}
    return work.result(*ran.sums, rays, ran.device, seconds)


def find_paths(device: Device, wire: str) -> tuple[list[int], list[float]]:
    """PathTracer.find on a device, of PathSums.wire, in plain lists."""
    tracked = PathWork.from_json(wire).build(device).find()
    return list(tracked.codes), list(tracked.weights)
