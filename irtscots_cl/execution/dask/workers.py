"""The workers of a Dask cluster: which there are, whether they run the same code, and tasks for them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import CancelledError
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

from irtscots_cl.execution.dask.same_code import CodeError, code_differs, code_hash, greet
from irtscots_cl.execution.dask.tasks import call
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.system import interruption
from irtscots_cl.system.interruption import wait_for

CONNECT_SECONDS = 10.0
WAIT_SECONDS = 60.0  # for a worker, where there is none
POLL_SECONDS = 1.0  # between looks at which workers there are
TASKS_PER_THREAD = 2  # in flight, so that a worker need not wait for the next one
AHEAD_PER_THREAD = 4  # results in order: in flight, or made and not yet wanted


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


class Workers:
    """The workers that a distributed.Client reaches: those that there are, and those that join.

    greeting: run on each of them; its result has the worker's "code". greetings: results by address. failed: why
    workers get no more tasks, by address. Raises CodeError if a worker runs other code, and DeviceError if there is
    none for WAIT_SECONDS.
    """

    def __init__(self, client: Any, greeting: Callable[[], dict[str, Any]] = greet):
        self.client, self.failed = client, dict[str, str]()
        try:
            wait_for(lambda: client.wait_for_workers(1, timeout=WAIT_SECONDS))
        except TimeoutError:
            raise DeviceError(f"--dask: no worker came within {WAIT_SECONDS:g} s") from None
        self.greetings = wait_for(lambda: client.run(greeting, on_error="return"))
        for address, said in self.greetings.items():
            if isinstance(said, BaseException):
                raise CodeError(f"--dask: worker {address} cannot run irtscots-cl: {type(said).__name__}: {said}")
            if said["code"] != code_hash():
                raise CodeError(code_differs(address))

    def in_order(self, function: Callable[..., Any], items: Iterable[Any], *arguments: Any) -> Generator[Any]:
        """Results of function(*arguments, item) of all items, in their order.

        At most AHEAD_PER_THREAD results for each thread of the workers are made before it is their turn; they stay
        where they were made until then. What a lost worker had is made again elsewhere. Raises CodeError, DeviceError
        where no worker is left or the scheduler is gone, and what the function raises, a ValueError with the worker's
        address before it. Closing the generator cancels what has not run.
        """
        code, watch, ended = code_hash(), WorkerWatch(self), SimpleQueue[None]()
        rest, out = deque(items), deque[Any]()
        try:
            with interruption.waking(lambda: ended.put(None)):
                while rest or out:
                    interruption.check()
                    watch.look()
                    while rest and len(out) < AHEAD_PER_THREAD * sum(watch.threads.values()):
                        out.append(self.submit(call, code, function, (*arguments, rest.popleft())))
                        out[-1].add_done_callback(lambda _: ended.put(None))
                    if out and out[0].status not in ("pending", "lost"):
                        yield self._result(out.popleft())
                        continue
                    with suppress(Empty):
                        ended.get(timeout=POLL_SECONDS)
        finally:
            self.cancel(out)

    def _result(self, future: Any) -> Any:
        if (error := self.failure(future)) is not None:
            raise error
        return self.fetch(future)

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

    def failure(self, future: Any) -> BaseException | None:
        """What a task that has ended raised, if anything.

        Raises DeviceError if the scheduler is gone, or workers died at the task.
        """
        if future.status == "finished":
            return None
        if future.status != "error":
            raise self.lost()
        error: BaseException = future.exception()
        if type(error).__name__ == "KilledWorker":
            reason = str(error).splitlines()[0]
            raise DeviceError(f"--dask: workers died one after the other at the same task: {reason}")
        return error

    def fetch(self, future: Any) -> Any:
        """The result of a task that has ended well, from the worker that has it; DeviceError without scheduler."""
        try:
            return wait_for(lambda: self.client.gather(future, direct=True))
        except CancelledError:
            raise self.lost() from None

    def cancel(self, futures: Iterable[Any]) -> None:
        """Cancel tasks; those that run go on to their end."""
        futures = list(futures)
        if futures and self.client.status == "running":
            self.client.cancel(futures)

    def lost(self, reason: object = "") -> DeviceError:
        return DeviceError(f"--dask: the scheduler is gone{f': {reason}' if str(reason) else ''}")


class WorkerWatch:
    """Which workers are there, asked every POLL_SECONDS. threads: of each address, as last heard."""

    def __init__(self, workers: Workers):
        self._workers, self.threads = workers, dict[str, int]()
        self._asked, self._seen = 0.0, time.monotonic()

    def look(self) -> bool:
        """Whether it was time to ask. Raises DeviceError where there was no worker for WAIT_SECONDS."""
        now = time.monotonic()
        if now - self._asked < POLL_SECONDS:
            return False
        self.threads, self._asked = self._workers.usable(), now
        if self.threads:
            self._seen = now
        elif now - self._seen > WAIT_SECONDS:
            raise DeviceError(f"--dask: no worker for {WAIT_SECONDS:g} s")
        return True

    def ask_again(self) -> None:
        """At the next look, without waiting."""
        self._asked = 0.0
