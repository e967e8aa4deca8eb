"""A trace on many machines: the workers of a Dask cluster trace parts of it (tasks.py) and add them up.

Sums go from worker to worker, FAN_IN at a time, and the client fetches one of each replicate: the scheduler sees no
image. As they are whole numbers, results depend neither on how the rays are cut nor on how many workers there are.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from irtscots_cl.execution.dask.run import ClusterRun
from irtscots_cl.execution.dask.same_code import code_hash
from irtscots_cl.execution.dask.tasks import WorkerError, call_on_device, greet_with_devices
from irtscots_cl.execution.dask.workers import Workers
from irtscots_cl.execution.executor import RunControl, TraceSums
from irtscots_cl.execution.task import TraceTask
from irtscots_cl.opencl.device import DeviceError, describe_together, merge_descriptions
from irtscots_cl.system.interruption import wait_for

log = logging.getLogger(__name__)


class DaskExecutor(Workers):
    """The workers of a Dask cluster as an executor.Executor.

    A worker whose devices fail is left out and logged. Raises the errors of Workers, and DeviceError if all have
    failed.
    """

    def __init__(self, client: Any):
        super().__init__(client, greet_with_devices)
        self._about: dict[str, dict[str, str]] = {}
        self._devices: dict[str, dict[str, object]] = {}
        for address, said in self.greetings.items():
            if said["unusable"]:
                self.leave_out(WorkerError(address, said["unusable"]))
            else:
                self._about[address], self._devices[address] = said["about"], said["device"]

    def run(self, task: TraceTask, rays: np.ndarray, control: RunControl = RunControl()) -> TraceSums:  # noqa: B008
        """control.launch_rays: rays of a task, instead of timing. Its checkpoint gets whole replicates, in order."""
        started = time.perf_counter()
        run = ClusterRun(self, task, rays, control)
        try:
            run.finish()
        finally:
            run.cancel()
        ran = [{"worker": address} | of_one for address, of_one in sorted(run.ran.items())]
        seconds = {"build": 0.0, "trace": time.perf_counter() - started, "kernels": run.kernel_seconds}
        facts = describe_together([of_one["device"] for of_one in ran]) if ran else self.describe()
        return TraceSums(run.sums, facts | {"workers": ran}, seconds)

    def describe(self) -> dict[str, object]:
        return describe_together(list(self._devices.values()))

    def device_identity(self) -> dict[str, str]:
        return merge_descriptions(list(self._about.values()))

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        while True:
            only = self.usable() if self.failed else None
            future = self.submit(call_on_device, code_hash(), function, arguments, only=only)
            try:
                return wait_for(future.result)
            except WorkerError as error:
                self.leave_out(error)

    def leave_out(self, error: WorkerError) -> None:
        """No more tasks for that worker; DeviceError if none is left."""
        if error.worker not in self.failed:
            log.warning("left out: worker %s: %s", error.worker, error.line)
        self.failed[error.worker] = error.line
        if not self.usable():
            raise DeviceError(f"--dask: all workers failed: worker {error.worker}: {error.line}")
