"""The devices of this machine as an executor."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from irtscots_cl.execution.device_pool import open_pool
from irtscots_cl.execution.device_tracer import DeviceTracer
from irtscots_cl.execution.executor import RunControl, TraceSums
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.execution.task import TraceTask
from irtscots_cl.opencl.device import Device, describe_together, merge_descriptions


class LocalExecutor:
    """The devices of this machine that a user chose, as an executor.Executor."""

    def __init__(self, devices: Sequence[Device]):
        self._devices = tuple(devices)

    def run(self, task: TraceTask, rays: np.ndarray, control: RunControl = RunControl()) -> TraceSums:  # noqa: B008
        started = time.perf_counter()
        with open_pool(self._devices, partial(DeviceTracer, task)) as (tracer, describe):
            built = time.perf_counter()
            sums = run_rays(tracer, rays, control)
            traced = time.perf_counter()
            seconds = {"build": built - started, "trace": traced - built, "kernels": tracer.rate_meter.kernel_seconds}
            return TraceSums(sums, describe(), seconds)

    def describe(self) -> dict[str, object]:
        return describe_together([device.describe() for device in self._devices])

    def device_identity(self) -> dict[str, str]:
        return merge_descriptions([{"device": device.name, "driver": device.driver} for device in self._devices])

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return function(self._devices[0], *arguments)
