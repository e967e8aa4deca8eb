"""Tasks of a trace on many machines: what the workers of a Dask cluster run.

A task is a function of plain values: the scene as TOML, how to trace it, a replicate and a part of its rays. Its result
is whole numbers, so tasks may run anywhere, again and in any order.
"""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from irtscots_cl.execution.checkpoint_file import Fingerprint
from irtscots_cl.execution.device_pool import open_pool
from irtscots_cl.execution.job import Job, Work
from irtscots_cl.execution.launch_plan import cut_part
from irtscots_cl.execution.local import LocalExecutor
from irtscots_cl.opencl.device import Device, DeviceError, describe_together, select_devices
from irtscots_cl.opencl.program import kernels_folder

RayBlock = tuple[int, int, int, int]  # first stream, streams, first ray, rays: as launches.plan_launches gives it


class WorkerError(RuntimeError):
    """A worker's devices failed. worker: its address. line: the DeviceError's."""

    def __init__(self, worker: str, line: str):
        super().__init__(worker, line)
        self.worker, self.line = worker, line


class CodeError(ValueError):
    """A worker runs another version of this package; the message is one line."""


@lru_cache
def code_hash() -> str:
    """Of the package's Python and kernel files: what decides about a trace's bits, but for device and libraries."""
    package, digest = Path(str(files("irtscots_cl"))), hashlib.sha256()
    for folder, pattern in ((package, "*.py"), (kernels_folder(), "*.cl")):
        for path in sorted(folder.rglob(pattern)):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def greet() -> dict[str, Any]:
    """What a worker is: code; why it cannot be used, "" if it can; what about() and device facts say of its devices."""
    try:
        devices = select_devices()
    except DeviceError as error:
        return {"code": code_hash(), "unusable": str(error)}
    facts = describe_together([device.describe() for device in devices])
    return {"code": code_hash(), "unusable": "", "about": LocalExecutor(devices).device_identity(), "device": facts}


def fingerprint_of(device: Device, kind: type[Work], task_json: str) -> Fingerprint:
    """The facts of the work's job on a device."""
    return kind.from_json(task_json).build(device).facts


def trace_part(code: str, kind: type[Work], task_json: str, replicate: int, part: RayBlock) -> dict[str, Any]:
    """The task: sums of a part's rays, and on which worker ("ran": address -> rays, tasks, seconds, device).

    code: the caller's code_hash(). kind, wire: the work. Raises WorkerError, CodeError.
    """
    address = _check_code(code)
    try:
        with _guard:  # one at a time, also where a worker has many threads: they would share a device's buffers
            job, facts = _job(kind, task_json)
            job.clear()
            job.rate_meter.kernel_seconds, started = 0.0, time.perf_counter()
            pieces = cut_part(part, lambda: job.rate_meter.launch_rays(job.first_launch_rays), job.max_rays_per_item)
            for piece in pieces:
                job.launch(replicate, piece)
            sums, seconds = job.sums(), time.perf_counter() - started
    except DeviceError as error:
        _forget_job()
        raise WorkerError(address, str(error)) from None
    ran = {"rays": part[1] * part[3], "tasks": 1, "seconds": seconds, "kernels": job.rate_meter.kernel_seconds}
    return {"sums": list(sums), "ran": {address: ran | {"device": facts()}}}


def add_up(*found: dict[str, Any]) -> dict[str, Any]:
    """The task that adds results of trace_part and of itself."""
    sums = [array.copy() for array in found[0]["sums"]]  # a task's input is not its to change
    for other in found[1:]:
        for array, more in zip(sums, other["sums"], strict=True):
            array += more
    return {"sums": sums, "ran": merged(*(each["ran"] for each in found))}


def speed_of(found: dict[str, Any]) -> float:
    """Rays per second of a result of trace_part."""
    (ran,) = found["ran"].values()
    return ran["rays"] / max(ran["seconds"], 1e-6)


def call_on_device(code: str, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """The task that is Site.call."""
    address = _check_code(code)
    try:
        with _guard:
            return function(select_devices()[0], *arguments)
    except DeviceError as error:
        raise WorkerError(address, str(error)) from None


def _check_code(code: str) -> str:
    """The worker's address."""
    from distributed import get_worker

    address = get_worker().address
    if code != code_hash():
        raise CodeError(code_differs(address))
    return address


_guard = threading.Lock()
_warm: dict[tuple[type, str], tuple[ExitStack, Job, Callable[[], dict]]] = {}  # the last job: warm for the next part


def _job(kind: type[Work], task_json: str) -> tuple[Job, Callable[[], dict]]:
    if (kind, task_json) not in _warm:
        _forget_job()
        stack = ExitStack()
        job, facts = stack.enter_context(open_pool(select_devices(), kind.from_json(task_json).build))
        _warm[kind, task_json] = stack, job, facts
    _, job, facts = _warm[kind, task_json]
    return job, facts


def _forget_job() -> None:
    for stack, _, _ in _warm.values():
        stack.close()
    _warm.clear()


def merged(*several: dict[str, dict]) -> dict[str, dict]:
    """The "ran" of many results as one."""
    merged: dict[str, dict] = {}
    for ran in several:
        for address, more in ran.items():
            so_far = merged.get(address, {})
            counted = {key: so_far.get(key, 0) + more[key] for key in ("rays", "tasks", "seconds", "kernels")}
            merged[address] = counted | {"device": more["device"]}
    return merged


def code_differs(address: str) -> str:
    return f"--dask: worker {address} runs other code than this irtscots-cl: must be the same version on both sides"
