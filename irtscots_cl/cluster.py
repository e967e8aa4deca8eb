"""A trace on many machines: the workers of a Dask cluster trace parts of it (tasks.py) and add them up.

Sums go from worker to worker, FAN_IN at a time, and the client fetches one of each replicate: the scheduler sees no
image. As they are whole numbers, results depend neither on how the rays are cut nor on how many workers there are.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Sequence
from queue import Empty, SimpleQueue
from statistics import median
from typing import Any

import numpy as np

from irtscots_cl.crew import Devices, Ran, Site, Work, differing
from irtscots_cl.device import Device, DeviceError, describe_together, select_devices
from irtscots_cl.launches import Place, plan_launches
from irtscots_cl.tasks import (
    CodeError,
    Part,
    WorkerError,
    add_up,
    call_on_device,
    code_differs,
    code_hash,
    facts_of,
    greet,
    merged,
    speed_of,
    trace_part,
)

TASK_SECONDS = 4.0  # of a task: long beside what the scheduler does for it, short beside what a lost worker costs
LEAST_TASK_SECONDS = 0.25  # near the end, when what is left is shared out
SUM_BYTES_PER_SECOND = 1e7  # of a worker's sums: larger ones make longer tasks, so that the network keeps up
SCHEDULER_SECONDS = 0.01  # of a task, for scheduler and client to keep up with: with many workers tasks get longer
FAN_IN = 8  # sums that a worker adds up at a time
TASKS_PER_THREAD = 2  # in flight, so that a worker need not wait for the next one
TIMED_TASKS = 32  # whose speed is asked for
MAX_RETRIES = 16  # of a sum that has to be traced again
CONNECT_SECONDS = 10.0
WAIT_SECONDS = 60.0  # for a worker, where there is none
POLL_SECONDS = 1.0  # between looks at which workers there are
log = logging.getLogger(__name__)



def site_of(device: Device | Sequence[Device] | None, client=None) -> Site:
    """Where to trace: the workers of a distributed.Client or of a Cluster, these devices, or those selected."""
    if client is not None:
        if device is not None:
            raise ValueError("device: must be left out with a client; its workers choose theirs by IRTSCOTS_DEVICE")
        return client if isinstance(client, Cluster) else Cluster(client)
    if device is None:
        return Devices(select_devices())
    return Devices([device] if isinstance(device, Device) else device)


def task_seconds(work: Work, threads: int) -> tuple[float, float]:
    """How long a task with so many threads of workers should take: at least, near the end, and as a rule."""
    bytes_of_sums, for_scheduler = 8 * sum(int(np.prod(s)) for s in work.sums_shapes), threads * SCHEDULER_SECONDS
    rule = max(TASK_SECONDS, bytes_of_sums / SUM_BYTES_PER_SECOND, for_scheduler)
    return max(LEAST_TASK_SECONDS, for_scheduler), rule


def connect(address: str):
    """The distributed.Client of a scheduler; ValueError of one line if there is none."""
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise ValueError(f"--dask = {address!r}: needs Dask: pip install 'irtscots-cl[dask]'") from None
    must = "must be the address of a Dask scheduler, such as tcp://host:8786"
    if not address.strip():  # Dask would start a cluster of its own
        raise ValueError(f"--dask = {address!r}: {must}")
    try:
        return Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"--dask = {address!r}: no scheduler answers: {reason}; {must}") from None


class Cluster:
    """The workers of a Dask cluster as a crew.Site: those that there are, and those that join.

    A worker whose devices fail is left out, and the log says so. Raises CodeError if a worker runs other code, and
    DeviceError if there is no worker for WAIT_SECONDS, or all have failed.
    """

    def __init__(self, client):
        self.client, self.failed, self._about, self._devices = client, {}, {}, {}
        self._wait_for_workers()
        self._greet_workers()

    def run(
        self, work: Work, rays: np.ndarray, progress=None, launch_rays=None, kept=None, finished=None
    ) -> Ran:
        """launch_rays: rays of a task, instead of timing. kept: gets whole replicates, in their order."""
        started = time.perf_counter()
        run = _Run(self, work, rays, progress, launch_rays, kept, finished)
        try:
            run.finish()
        finally:
            run.cancel()
        ran = [{"worker": address} | of_one for address, of_one in sorted(run.ran.items())]
        seconds = {"build": 0.0, "trace": time.perf_counter() - started, "kernels": run.kernel_seconds}
        facts = describe_together([of_one["device"] for of_one in ran]) if ran else self.describe()
        return Ran(run.sums, facts | {"workers": ran}, seconds)

    def describe(self) -> dict[str, object]:
        return describe_together(list(self._devices.values()))

    def about(self) -> dict[str, str]:
        return differing(list(self._about.values()))

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        while True:
            only = self.usable() if self.failed else None
            future = self.submit(call_on_device, code_hash(), function, arguments, only=only)
            try:
                return future.result()
            except WorkerError as error:
                self.leave_out(error)

    def submit(self, function: Callable, *arguments: Any, only: Iterable[str] | None = None):
        """The future of a task on these workers, or on any."""
        return self.client.submit(function, *arguments, pure=False, workers=None if only is None else list(only))

    def usable(self) -> dict[str, int]:
        """Threads of the workers that are there and have not failed; DeviceError if that is not known."""
        if self.client.scheduler is None:
            raise self.lost()
        try:
            found = self.client.nthreads()
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
            self.client.wait_for_workers(1, timeout=WAIT_SECONDS)
        except TimeoutError:
            raise DeviceError(f"--dask: no worker came within {WAIT_SECONDS:g} s") from None

    def _greet_workers(self) -> None:
        for address, said in self.client.run(greet, on_error="return").items():
            if isinstance(said, BaseException):
                raise CodeError(f"--dask: worker {address} cannot run irtscots-cl: {type(said).__name__}: {said}")
            if said["code"] != code_hash():
                raise CodeError(code_differs(address))
            if said["unusable"]:
                self.leave_out(WorkerError(address, said["unusable"]))
            else:
                self._about[address], self._devices[address] = said["about"], said["device"]


class _Run:
    """One run of a work's rays: parts in flight, their partial sums, the replicates' totals.

    sums: the result, as runner.run_rays has it. ran: address -> rays, tasks, seconds, kernels, device.
    """

    def __init__(self, cluster: Cluster, work: Work, rays: np.ndarray, progress, task_rays: int | None, kept, finished):
        self._cluster, self._work, self._progress, self._task_rays = cluster, work, progress, task_rays
        self._finished = finished
        self._code, self._kind, self._wire, self._kept = code_hash(), type(work), work.wire(), kept
        self.sums = tuple(np.zeros((len(rays), *shape), np.uint64) for shape in work.sums_shapes)
        self._place, self._end = Place(), Place(len(rays))  # all before the place is in the sums
        if kept is not None:
            facts = cluster.call(facts_of, self._kind, self._wire)
            self._place = kept.begin(facts, rays, work.streams, work.max_rays_per_item, self.sums)
        self._total, self._speeds, self._again = int(rays.sum()) * work.streams, [], []
        before = self._place.rays_before(rays, work.streams)
        self._to_cut, self._left = self._total - before, []  # rays not yet cut into parts, not yet traced by replicate
        for whole in (int(of_stream) * work.streams for of_stream in rays):
            self._left.append(whole - min(before, whole))
            before -= min(before, whole)
        self._parts = self._cut(rays)
        self._levels: list[list[list]] = [[] for _ in rays]  # of each replicate: sums of FAN_IN^level parts
        self._out: dict[str, tuple[Any, Callable, tuple]] = {}  # key -> future, what then, with what
        self._done, self._polled, self._seen, self._parts_out = SimpleQueue(), 0.0, time.monotonic(), 0
        self._threads: dict[str, int] = {}
        self._only: dict[str, set[str] | None] = {}  # key of a part's task -> the workers that may run it
        self._complete, self._retries, self.ran = set(), 0, {}

    def finish(self) -> None:
        """Run to the end. Raises as Cluster says."""
        if self._progress is not None and self._place != Place():
            self._progress(self._total - sum(self._left), self._total)
        while self._place != self._end:
            if self._kept is not None and self._kept.ends:
                self._kept.launched(self._place, self.kernel_seconds, lambda: None)
            self._look_at_workers()
            self._top_up()
            try:
                key = self._done.get(timeout=POLL_SECONDS)
            except Empty:
                continue
            if key in self._out:
                future, then, arguments = self._out.pop(key)
                then(future, *arguments)
        if self._kept is not None:
            self._kept.ended(self._place, self.kernel_seconds)

    @property
    def kernel_seconds(self) -> float:
        """Mean over the workers."""
        return sum(of_one["kernels"] for of_one in self.ran.values()) / max(1, len(self.ran))

    def cancel(self) -> None:
        """Take back what has not run."""
        futures = [future for future, _, _ in self._out.values()]
        if futures and self._cluster.client.status == "running":
            self._cluster.client.cancel(futures)

    # parts of the rays

    def _cut(self, rays: np.ndarray):
        streams, per_item, start = self._work.streams, self._work.max_rays_per_item, self._place
        for replicate in range(start.replicate, len(rays)):
            for part in plan_launches(streams, int(rays[replicate]), self._next_rays, per_item, start):
                self._to_cut -= part[1] * part[3]
                yield replicate, part
            start = Place()

    def _next_rays(self) -> int:
        """Rays of the next part: some seconds' worth, less near the end, little before a speed is known."""
        if self._task_rays is not None:
            return self._task_rays
        share = self._to_cut // (TASKS_PER_THREAD * max(1, sum(self._threads.values()))) + 1
        if not self._speeds:
            return min(self._work.first_launch_rays, share)
        speed, (least, most) = median(self._speeds), task_seconds(self._work, sum(self._threads.values()))
        return int(min(speed * most, max(share, speed * least))) + 1

    def _top_up(self) -> None:
        threads = sum(self._threads.values())
        most = threads * (TASKS_PER_THREAD if self._speeds else 1)
        while self._parts_out < most:
            entry = self._again.pop() if self._again else next(self._parts, None)
            if entry is None:
                return
            replicate, part = entry
            only = set(self._threads) if self._cluster.failed else None
            future = self._cluster.submit(trace_part, self._code, self._kind, self._wire, replicate, part, only=only)
            self._parts_out += 1
            self._watch(future, self._traced, replicate, part)
            self._only[future.key] = only

    def _watch(self, future, then: Callable, *arguments: Any) -> None:
        self._out[future.key] = future, then, arguments
        future.add_done_callback(lambda done: self._done.put(done.key))

    def _traced(self, future, replicate: int, part: Part) -> None:
        self._parts_out -= 1
        del self._only[future.key]
        if not self._is_well(future):
            self._again.append((replicate, part))
            return
        if len(self._speeds) < TIMED_TASKS and self._task_rays is None:
            self._watch(self._cluster.client.submit(speed_of, future, pure=False, priority=2), self._timed)
        self._left[replicate] -= part[1] * part[3]
        if self._progress is not None:
            self._progress(self._total - sum(self._left), self._total)
        self._add(replicate, 0, future)
        if not self._left[replicate]:
            rest = [of_level for level in self._levels[replicate] for of_level in level]
            self._levels[replicate] = []
            total = self._cluster.client.submit(add_up, *rest, pure=False, priority=1) if len(rest) > 1 else rest[0]
            self._watch(total, self._totalled, replicate)

    def _add(self, replicate: int, level: int, future) -> None:
        """A partial sum more; full levels are added up at once, before further parts are traced."""
        levels = self._levels[replicate]
        if level == len(levels):
            levels.append([])
        levels[level].append(future)
        if len(levels[level]) == FAN_IN:
            full, levels[level] = levels[level], []
            self._add(replicate, level + 1, self._cluster.client.submit(add_up, *full, pure=False, priority=1))

    def _timed(self, future) -> None:
        if future.status == "finished":
            self._speeds.append(future.result())

    def _totalled(self, future, replicate: int) -> None:
        if not self._is_well(future):  # what a lost worker had was traced again, on one that failed: once more
            self._retries += 1
            if self._retries > MAX_RETRIES:
                raise DeviceError(f"--dask: {future.exception().line}, {MAX_RETRIES} times after workers were lost")
            self._cluster.client.retry([future])
            self._watch(future, self._totalled, replicate)
            return
        found = self._cluster.client.gather(future, direct=True)
        for all_of, array in zip(self.sums, found["sums"], strict=True):
            all_of[replicate] += array
        self.ran = merged(self.ran, found["ran"])
        self._complete.add(replicate)
        while self._place.replicate in self._complete:
            self._place = Place(self._place.replicate + 1)
            if self._finished is not None and self._place != self._end:
                self._finished(tuple(array[: self._place.replicate] for array in self.sums))
        if self._kept is not None and self._place != self._end:
            self._kept.launched(self._place, self.kernel_seconds, lambda: None)

    # what goes wrong

    def _is_well(self, future) -> bool:
        """Whether a future has a result; False if its worker failed and is left out. Raises what is worse."""
        if future.status == "finished":
            return True
        if future.status != "error":
            raise self._cluster.lost()
        error = future.exception()
        if isinstance(error, WorkerError):
            self._cluster.leave_out(error)
            self._polled = 0.0
            return False
        if type(error).__name__ == "KilledWorker":
            reason = str(error).splitlines()[0]
            raise DeviceError(f"--dask: workers died one after the other at the same task: {reason}")
        raise error

    def _look_at_workers(self) -> None:
        """Every POLL_SECONDS: which workers are there; DeviceError where none was for WAIT_SECONDS."""
        now = time.monotonic()
        if now - self._polled < POLL_SECONDS:
            return
        self._threads, self._polled = self._cluster.usable(), now
        for key, only in list(self._only.items()):
            if only is not None and only.isdisjoint(self._threads):  # would wait for workers that are gone
                future, _, entry = self._out.pop(key)
                self._cluster.client.cancel(future)
                del self._only[key]
                self._parts_out -= 1
                self._again.append(entry)
        if self._threads:
            self._seen = now
        elif now - self._seen > WAIT_SECONDS:
            raise DeviceError(f"--dask: no worker for {WAIT_SECONDS:g} s")
