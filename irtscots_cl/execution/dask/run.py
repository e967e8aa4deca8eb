"""One trace on a cluster, from its first task to its sums."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from queue import Empty, SimpleQueue
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from irtscots_cl.execution.dask.cluster import DaskExecutor
from irtscots_cl.execution.dask.same_code import code_hash
from irtscots_cl.execution.dask.tasks import WorkerError, add_up, fingerprint_of, merged, speed_of, trace_block
from irtscots_cl.execution.dask.workers import POLL_SECONDS, TASKS_PER_THREAD, WorkerWatch
from irtscots_cl.execution.executor import RunControl
from irtscots_cl.execution.launch_plan import Cursor, RayBlock, plan_launches
from irtscots_cl.execution.task import TraceTask
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.system import interruption

TASK_SECONDS = 4.0  # of a task: much longer than the scheduler's work for it, and little is lost with a worker
MIN_TASK_SECONDS = 0.25  # near the end, when the remaining rays are divided among all
SUM_BYTES_PER_SECOND = 1e7  # of a worker's sums: larger ones make longer tasks, so that the network keeps up
SCHEDULER_SECONDS = 0.01  # of a task, for scheduler and client to keep up with: with many workers tasks get longer
FAN_IN = 8  # sums that a worker adds up at a time
TIMED_TASKS = 32  # whose speed is asked for
MAX_RETRIES = 16  # of a sum that has to be traced again


def task_seconds(task: TraceTask, threads: int) -> tuple[float, float]:
    """How long a task with so many threads of workers should take: at least, near the end, and as a rule."""
    bytes_of_sums, for_scheduler = 8 * sum(int(np.prod(s)) for s in task.sums_shapes), threads * SCHEDULER_SECONDS
    rule = max(TASK_SECONDS, bytes_of_sums / SUM_BYTES_PER_SECOND, for_scheduler)
    return max(MIN_TASK_SECONDS, for_scheduler), rule


class ClusterRun:
    """One run of a task's rays: blocks in flight, their partial sums, the replicates' totals.

    sums: the result, as run_loop.run_rays returns it. ran: address -> rays, tasks, seconds, kernels, device.
    """

    def __init__(self, cluster: DaskExecutor, task: TraceTask, rays: np.ndarray, control: RunControl):
        self._cluster, self._task, self._control = cluster, task, control
        self._code, self._kind, self._task_json = code_hash(), type(task), task.to_json()
        checkpoint = control.checkpoint
        self.sums = tuple(np.zeros((len(rays), *shape), np.uint64) for shape in task.sums_shapes)
        self._place, self._end = Cursor(), Cursor(len(rays))  # all before the place is in the sums
        if checkpoint is not None:
            facts = cluster.call(fingerprint_of, self._kind, self._task_json)
            self._place = checkpoint.begin(facts, rays, task.sources, task.max_rays_per_item, self.sums)
        self._total = int(rays.sum()) * task.sources
        self._speeds: list[float] = []
        self._again: list[tuple[int, RayBlock]] = []
        before = self._place.rays_before(rays, task.sources)
        self._to_cut, self._left = self._total - before, []  # rays not yet cut into parts, not yet traced by replicate
        for whole in (int(per_source) * task.sources for per_source in rays):
            self._left.append(whole - min(before, whole))
            before -= min(before, whole)
        self._parts = self._cut(rays)
        self._levels: list[list[list[Any]]] = [[] for _ in rays]  # of each replicate: sums of FAN_IN^level parts
        # key -> future, what then, with what
        self._out: dict[str, tuple[Any, Callable[..., None], tuple[Any, ...]]] = {}
        self._done: SimpleQueue[str] = SimpleQueue()
        self._watch, self._parts_out = WorkerWatch(cluster), 0
        self._threads: dict[str, int] = {}
        self._only: dict[str, set[str] | None] = {}  # key of a part's task -> the workers that may run it
        self._complete: set[int] = set()
        self._retries, self.ran = 0, dict[str, Any]()

    def finish(self) -> None:
        """Run to the end. Raises as Cluster says."""
        if self._control.progress is not None and self._place != Cursor():
            self._control.progress(self._total - sum(self._left), self._total)
        with interruption.waking(lambda: self._done.put("")):
            while self._place != self._end:
                self._step()
        if self._control.checkpoint is not None:
            self._control.checkpoint.ended(self._place, self.kernel_seconds)

    def _step(self) -> None:
        """Hand out parts, and take the next finished one, if there is one within POLL_SECONDS."""
        if self._control.checkpoint is None:
            interruption.check()
        elif self._control.checkpoint.ends:
            self._control.checkpoint.launched(self._place, self.kernel_seconds, lambda: None)
        self._look_at_workers()
        self._top_up()
        try:
            key = self._done.get(timeout=POLL_SECONDS)
        except Empty:
            return
        if key in self._out:
            future, then, arguments = self._out.pop(key)
            then(future, *arguments)

    @property
    def kernel_seconds(self) -> float:
        """Mean over the workers."""
        return float(sum(of_one["kernels"] for of_one in self.ran.values()) / max(1, len(self.ran)))

    def cancel(self) -> None:
        """Cancel all tasks that have not run."""
        self._cluster.cancel(future for future, _, _ in self._out.values())

    # parts of the rays

    def _cut(self, rays: np.ndarray) -> Iterator[tuple[int, RayBlock]]:
        sources, per_item, start = self._task.sources, self._task.max_rays_per_item, self._place
        for replicate in range(start.replicate, len(rays)):
            for block in plan_launches(sources, int(rays[replicate]), self._next_rays, per_item, start):
                self._to_cut -= block.total
                yield replicate, block
            start = Cursor()

    def _next_rays(self) -> int:
        """Rays of the next part: some seconds' worth, less near the end, little before a speed is known."""
        if self._control.launch_rays is not None:
            return self._control.launch_rays
        share = self._to_cut // (TASKS_PER_THREAD * max(1, sum(self._threads.values()))) + 1
        if not self._speeds:
            return min(self._task.first_launch_rays, share)
        speed, (least, most) = median(self._speeds), task_seconds(self._task, sum(self._threads.values()))
        return int(min(speed * most, max(share, speed * least))) + 1

    def _top_up(self) -> None:
        threads = sum(self._threads.values())
        most = threads * (TASKS_PER_THREAD if self._speeds else 1)
        while self._parts_out < most:
            entry = self._again.pop() if self._again else next(self._parts, None)
            if entry is None:
                return
            replicate, block = entry
            only = set(self._threads) if self._cluster.failed else None
            future = self._cluster.submit(
                trace_block, self._code, self._kind, self._task_json, replicate, block, only=only
            )
            self._parts_out += 1
            self._await(future, self._traced, replicate, block)
            self._only[future.key] = only

    def _await(self, future: Any, then: Callable[..., None], *arguments: Any) -> None:
        self._out[future.key] = future, then, arguments
        future.add_done_callback(lambda done: self._done.put(done.key))

    def _traced(self, future: Any, replicate: int, block: RayBlock) -> None:
        self._parts_out -= 1
        del self._only[future.key]
        if not self._is_well(future):
            self._again.append((replicate, block))
            return
        if len(self._speeds) < TIMED_TASKS and self._control.launch_rays is None:
            self._await(self._cluster.client.submit(speed_of, future, pure=False, priority=2), self._timed)
        self._left[replicate] -= block.total
        if self._control.progress is not None:
            self._control.progress(self._total - sum(self._left), self._total)
        self._add(replicate, 0, future)
        if not self._left[replicate]:
            rest = [of_level for level in self._levels[replicate] for of_level in level]
            self._levels[replicate] = []
            total = self._cluster.client.submit(add_up, *rest, pure=False, priority=1) if len(rest) > 1 else rest[0]
            self._await(total, self._totalled, replicate)

    def _add(self, replicate: int, level: int, future: Any) -> None:
        """A partial sum more; full levels are added up at once, before further parts are traced."""
        levels = self._levels[replicate]
        if level == len(levels):
            levels.append([])
        levels[level].append(future)
        if len(levels[level]) == FAN_IN:
            full, levels[level] = levels[level], []
            self._add(replicate, level + 1, self._cluster.client.submit(add_up, *full, pure=False, priority=1))

    def _timed(self, future: Any) -> None:
        if future.status == "finished":
            self._speeds.append(future.result())

    def _totalled(self, future: Any, replicate: int) -> None:
        if not self._is_well(future):  # rays of a lost worker were traced again, on a worker that failed: once more
            self._retries += 1
            if self._retries > MAX_RETRIES:
                raise DeviceError(f"--dask: {future.exception().line}, {MAX_RETRIES} times after workers were lost")
            self._cluster.client.retry([future])
            self._await(future, self._totalled, replicate)
            return
        found = self._cluster.fetch(future)
        for all_of, array in zip(self.sums, found["sums"], strict=True):
            all_of[replicate] += array
        self.ran = merged(self.ran, found["ran"])
        self._complete.add(replicate)
        while self._place.replicate in self._complete:
            self._place = Cursor(self._place.replicate + 1)
            if self._control.on_replicate is not None and self._place != self._end:
                self._control.on_replicate(tuple(array[: self._place.replicate] for array in self.sums))
        if self._control.checkpoint is not None and self._place != self._end:
            self._control.checkpoint.launched(self._place, self.kernel_seconds, lambda: None)

    # what goes wrong

    def _is_well(self, future: Any) -> bool:
        """Whether a future has a result; False if its worker failed and is left out. Raises any other failure."""
        error = self._cluster.failure(future)
        if error is None:
            return True
        if not isinstance(error, WorkerError):
            raise error
        self._cluster.leave_out(error)
        self._watch.ask_again()
        return False

    def _look_at_workers(self) -> None:
        """Which workers are there; DeviceError where none was for long."""
        if not self._watch.look():
            return
        self._threads = self._watch.threads
        for key, only in list(self._only.items()):
            if only is not None and only.isdisjoint(self._threads):  # would wait for workers that are gone
                future, _, entry = self._out.pop(key)
                self._cluster.client.cancel(future)
                del self._only[key]
                self._parts_out -= 1
                self._again.append(entry)
