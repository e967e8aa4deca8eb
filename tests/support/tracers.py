"""Tracers of scenes on a device, and set-ups that many tests ask for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from irtscots_cl.execution.device_tracer import DeviceTracer
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.opencl.device import Device
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.estimators.nonsequential import PathTask
from irtscots_cl.tracing.estimators.sequential import SequentialTask
from irtscots_cl.tracing.options import TraceOptions


@lru_cache(maxsize=8)
def setup_of(scene: Scene) -> Setup:
    """The set-up of a scene, shared by the tests of a process."""
    return Setup(scene)


def tracer_of(scene: Scene, device: Device, options: TraceOptions, **choices) -> DeviceTracer:
    """The forward or the adjoint estimator. choices: of SequentialTask."""
    return DeviceTracer(SequentialTask(setup_of(scene), options, **choices), device)


def path_tracer_of(scene: Scene, device: Device, options: TraceOptions) -> DeviceTracer:
    """The non-sequential estimator, without paths that are tracked."""
    return DeviceTracer(PathTask(setup_of(scene), options), device)


def totals(tracer: DeviceTracer, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Counts, and rays by fate, of rays [replicates] per source."""
    return tracer.task.totals(run_rays(tracer, rays), rays)
