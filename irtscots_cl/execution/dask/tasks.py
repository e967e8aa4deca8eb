"""Tasks for the workers of a Dask cluster: parts of a trace, and functions that need a device, or none.

A task of a trace is a function of plain values: the scene as TOML, how to trace it, a replicate and a part of its
rays. Its result is whole numbers, so tasks may run anywhere, again and in any order.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

from irtscots_cl.execution.checkpoint_file import Fingerprint
from irtscots_cl.execution.dask.same_code import check_code, greet
from irtscots_cl.execution.device_pool import open_pool
from irtscots_cl.execution.device_tracer import DeviceTracer
from irtscots_cl.execution.launch_plan import RayBlock, cut_block
from irtscots_cl.execution.local import LocalExecutor
from irtscots_cl.execution.task import Tracer, TraceTask
from irtscots_cl.opencl.device import Device, DeviceError, describe_together, select_devices
from irtscots_cl.system.option_error import on_command_line


class WorkerError(RuntimeError):
    """A worker's devices failed. worker: its address. line: the DeviceError's."""

    def __init__(self, worker: str, line: str):
        super().__init__(worker, line)
        self.worker, self.line = worker, line


def greet_with_devices() -> dict[str, Any]:
    """A worker's facts: its code; why it cannot be used, "" if it can; its devices' identity and description."""
    try:
        devices = select_devices()
    except DeviceError as error:
        return greet() | {"unusable": str(error)}
    facts = describe_together([device.describe() for device in devices])
    return greet() | {"unusable": "", "about": LocalExecutor(devices).device_identity(), "device": facts}


def fingerprint_of(device: Device, kind: type[TraceTask], task_json: str) -> Fingerprint:
    """What the sums of a task on a device depend on."""
    return kind.from_json(task_json).program(device).fingerprint


def trace_block(code: str, kind: type[TraceTask], task_json: str, replicate: int, block: RayBlock) -> dict[str, Any]:
    """The task: sums of a block's rays, and on which worker ("ran": address -> rays, tasks, seconds, device).

    code: the caller's code_hash(). kind, wire: the work. Raises WorkerError, CodeError.
    """
    address = check_code(code)
    try:
        with _guard:  # one at a time, also where a worker has many threads: they would share a device's buffers
            tracer, describe = _tracer(kind, task_json)
            tracer.clear()
            tracer.rate_meter.kernel_seconds, started = 0.0, time.perf_counter()
            meter, first = tracer.rate_meter, tracer.first_launch_rays
            pieces = cut_block(block, lambda: meter.launch_rays(first), tracer.max_rays_per_item)
            for piece in pieces:
                tracer.launch(replicate, piece)
            sums, seconds = tracer.sums(), time.perf_counter() - started
    except DeviceError as error:
        _forget_tracer()
        raise WorkerError(address, str(error)) from None
    ran = {"rays": block.total, "tasks": 1, "seconds": seconds, "kernels": tracer.rate_meter.kernel_seconds}
    return {"sums": list(sums), "ran": {address: ran | {"device": describe()}}}


def add_up(*found: dict[str, Any]) -> dict[str, Any]:
    """The task that adds results of trace_block and of itself."""
    sums = [array.copy() for array in found[0]["sums"]]  # a task's input is not its to change
    for other in found[1:]:
        for array, more in zip(sums, other["sums"], strict=True):
            array += more
    return {"sums": sums, "ran": merged(*(each["ran"] for each in found))}


def speed_of(found: dict[str, Any]) -> float:
    """Rays per second of a result of trace_block."""
    (ran,) = found["ran"].values()
    return float(ran["rays"] / max(ran["seconds"], 1e-6))


def call_on_device(code: str, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """The task that is Site.call."""
    address = check_code(code)
    try:
        with _guard:
            return function(select_devices()[0], *arguments)
    except DeviceError as error:
        raise WorkerError(address, str(error)) from None


def call(code: str, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """The task that is a function of plain values; no device. Raises CodeError; a ValueError says which worker's."""
    address = check_code(code)
    try:
        with _guard:
            return function(*arguments)
    except ValueError as error:
        raise ValueError(f"--dask: worker {address}: {on_command_line(error)}") from None


_guard = threading.Lock()
# The last task's tracer: warm for the next block.
_warm: dict[tuple[type[TraceTask], str], tuple[ExitStack, Tracer, Callable[[], dict[str, object]]]] = {}


def _tracer(kind: type[TraceTask], task_json: str) -> tuple[Tracer, Callable[[], dict[str, object]]]:
    if (kind, task_json) not in _warm:
        _forget_tracer()
        stack = ExitStack()
        pool = open_pool(select_devices(), partial(DeviceTracer, kind.from_json(task_json)))
        tracer, describe = stack.enter_context(pool)
        _warm[kind, task_json] = stack, tracer, describe
    _, tracer, describe = _warm[kind, task_json]
    return tracer, describe


def _forget_tracer() -> None:
    for stack, _, _ in _warm.values():
        stack.close()
    _warm.clear()


def merged(*several: dict[str, Any]) -> dict[str, Any]:
    """The "ran" of many results as one."""
    merged: dict[str, Any] = {}
    for ran in several:
        for address, more in ran.items():
            so_far = merged.get(address, {})
            counted = {key: so_far.get(key, 0) + more[key] for key in ("rays", "tasks", "seconds", "kernels")}
            merged[address] = counted | {"device": more["device"]}
    return merged
