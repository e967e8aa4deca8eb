"""A trace on many machines: the workers of a Dask cluster trace parts of it (tasks.py) and add them up.

Sums go from worker to worker, FAN_IN at a time, and the client fetches one of each replicate: the scheduler sees no
image. As they are whole numbers, results depend neither on how the rays are cut nor on how many workers there are.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from irtscots_cl.execution.dask.run import WAIT_SECONDS, ClusterRun
from irtscots_cl.execution.dask.tasks import CodeError, WorkerError, call_on_device, code_differs, code_hash, greet
from irtscots_cl.execution.executor import RunControl, TraceSums
from irtscots_cl.execution.task import TraceTask
from irtscots_cl.opencl.device import DeviceError, describe_together, merge_descriptions
from irtscots_cl.system.interruption import wait_for

CONNECT_SECONDS = 10.0
log = logging.getLogger(__name__)


def connect(address: str) -> Any:
    """The distributed.Client of a scheduler; ValueError of one line if there is none."""
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise ValueError(f"--dask = {address!r}: needs Dask: pip install 'irtscots-cl[dask]'") from None
    must = "must be the address of a Dask scheduler, such as tcp://host:8786"
    if not address.strip():  # Dask would start a cluster of its own
        raise ValueError(f"--dask = {address!r}: {must}")
    try:
        return wait_for(lambda: Client(address, timeout=CONNECT_SECONDS, set_as_default=False))
    except (OSError, ValueError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"--dask = {address!r}: no scheduler answers: {reason}; {must}") from None


class DaskExecutor:
    """The workers of a Dask cluster as an executor.Executor: those that there are, and those that join.

    A worker whose devices fail is left out and logged. Raises CodeError if a worker runs other code, and DeviceError if
    there is no worker for WAIT_SECONDS, or all have failed.
    """

    def __init__(self, client: Any):
        self.client, self.failed = client, dict[str, str]()
        self._about: dict[str, dict[str, str]] = {}
        self._devices: dict[str, dict[str, object]] = {}
        self._wait_for_workers()
        self._greet_workers()

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

    def submit(self, function: Callable[..., Any], *arguments: Any, only: Iterable[str] | None = None) -> Any:
        """The future of a task on these workers, or on any."""
        return self.client.submit(function, *arguments, pure=False, workers=None if only is None else list(only))

    def usable(self) -> dict[str, int]:
        """Threads of the workers that are there and have not failed; DeviceError if that is not known."""
        if self.client.scheduler is None:
            raise self.lost()
        try:
            found = wait_for(self.client.nthreads)
        except (OSError, TimeoutError) as error:
            raise self.lost(error) from None
        return {address: threads for address, threads in found.items() if address not in self.failed}

    def leave_out(self, error: WorkerError) -> None:
        """No more tasks for that worker; DeviceError if none is left."""
        if error.worker not in self.failed:
            log.warning("left out: worker %s: %s", error.worker, error.line)
        self.failed[error.worker] = error.line
        if not self.usable():
            raise DeviceError(f"--dask: all workers failed: worker {error.worker}: {error.line}")

    def lost(self, reason: object = "") -> DeviceError:
        return DeviceError(f"--dask: the scheduler is gone{f': {reason}' if str(reason) else ''}")

    def _wait_for_workers(self) -> None:
        try:
            wait_for(lambda: self.client.wait_for_workers(1, timeout=WAIT_SECONDS))
        except TimeoutError:
            raise DeviceError(f"--dask: no worker came within {WAIT_SECONDS:g} s") from None

    def _greet_workers(self) -> None:
        greetings = wait_for(lambda: self.client.run(greet, on_error="return"))
        for address, said in greetings.items():
            if isinstance(said, BaseException):
                raise CodeError(f"--dask: worker {address} cannot run irtscots-cl: {type(said).__name__}: {said}")
            if said["code"] != code_hash():
                raise CodeError(code_differs(address))
            if said["unusable"]:
                self.leave_out(WorkerError(address, said["unusable"]))
            else:
                self._about[address], self._devices[address] = said["about"], said["device"]
