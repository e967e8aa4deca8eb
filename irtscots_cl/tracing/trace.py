"""The door of the simulation: scene and device to light transport, by any estimator."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from irtscots_cl.execution.checkpoint import Checkpoints
from irtscots_cl.execution.executor import RunControl
from irtscots_cl.execution.launch_plan import share_rays
from irtscots_cl.execution.select import executor_of
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.chief_rays import check_visible
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.tracing.checks.precision import warn_of_rounding
from irtscots_cl.tracing.defaults import RAYS_PER_PIXEL
from irtscots_cl.tracing.estimators.analytic import trace_analytic
from irtscots_cl.tracing.estimators.nonsequential import trace_by_path
from irtscots_cl.tracing.estimators.sequential import trace_rays
from irtscots_cl.tracing.fingerprint import trace_fingerprint
from irtscots_cl.tracing.options import (
    ANALYTIC,
    MAX_SMOOTHED_RAYS,
    MIN_CHANCE,
    NONSEQUENTIAL,
    TraceOptions,
    check_traceable,
)
from irtscots_cl.tracing.results.paths import PathLight
from irtscots_cl.tracing.results.transport import LineLight, Transport


def trace(
    scene: Scene | Setup,
    *,
    device: Device | Sequence[Device] | None = None,
    client=None,
    estimator: str = "adjoint",
    sampler: str = "philox",
    precision: str = "fp32",
    rays_per_pixel: int = RAYS_PER_PIXEL,
    replicates: int = 8,
    seed: int = 1,
    aim: str = "mirror",
    overfill: float = 1.0,
    smoothing: bool = False,
    bounce_limit: int | None = None,
    least_chance: float = MIN_CHANCE,
    branches: str = "random",
    aimed_scatter: bool = True,
    polarisation: str = "auto",
    progress: Callable[[int, int], None] | None = None,
    launch_rays: int | None = None,
    keeper: Checkpoints | None = None,
    finished: Callable[[Transport | LineLight | PathLight], None] | None = None,
) -> Transport | LineLight | PathLight:
    """Trace rays_per_pixel rays per screen pixel (forward, nonsequential) or detector pixel (adjoint), as `run` does.

    The analytic estimator takes no rays and no device, so none of the other arguments, and gives light curves alone.

    scene: the scene, or a Setup of it that is used again. device: from select_device, or several, from select_devices:
    they share the rays, and the result is that of one, to the bit, if they are equal. None selects one. client: a
    dask.distributed.Client, whose workers trace instead. replicates: independent parts of the rays, for error bars.
    estimator to polarisation: see TraceOptions. progress(done, total): called after each launch with numbers of rays.
    launch_rays: rays per launch, instead of timing; no result depends on it. Same seed and device, same bits. keeper:
    saves the sums now and then, and continues from what it has; an interrupted trace that continues gives the bits of
    one that was not. finished: called with the trace so far when a replicate is complete and others are to come.

    Warns by checks.precision.RoundingWarning where single precision costs over 1 nm of height. Raises ValueError for an
    argument out of range, SceneError if no pixel sees the screen, DeviceError, or checkpoint.Interrupted by the keeper.
    """
    setup = Setup.of(scene)
    options = TraceOptions(
        estimator=estimator, sampler=sampler, precision=precision, seed=seed, aim=aim, overfill=overfill,
        smoothing=smoothing, bounce_limit=bounce_limit, least_chance=least_chance, branches=branches,
        aimed_scatter=aimed_scatter, polarisation=polarisation,
    )  # fmt: skip
    if estimator != NONSEQUENTIAL:
        check_traceable(setup.scene, options)
    if estimator == ANALYTIC:
        return trace_analytic(setup)
    rays = share_rays(rays_per_pixel, replicates)
    if smoothing and rays.max() > MAX_SMOOTHED_RAYS:
        raise OptionError(f"--rays-per-pixel = {rays_per_pixel}: with --smoothing, must be at most 2^32 per replicate")
    check_visible(setup.chief_rays, f"scene {setup.scene.name}")
    executor = executor_of(device, client)
    warn_of_rounding(setup, executor.call, precision)
    fingerprint = trace_fingerprint(setup.scene, options, rays, executor.device_identity())
    checkpoint = None if keeper is None else keeper.file_of(fingerprint)
    control = RunControl(progress=progress, checkpoint=checkpoint, launch_rays=launch_rays)
    traced = trace_by_path if estimator == NONSEQUENTIAL else trace_rays
    return traced(setup, executor, options, rays, control, finished)


def trace_paths(scene: Scene | Setup, *, rays_per_pixel: int = 2**16, **options) -> PathLight:
    """`trace` with the non-sequential estimator and 2^16 rays per screen pixel. Raises as `trace` does."""
    return trace(scene, estimator=NONSEQUENTIAL, rays_per_pixel=rays_per_pixel, **options)
