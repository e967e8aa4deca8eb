"""Where the rays of a trace run: one device, or many of a machine that share them as their speeds allow."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from irtscots_cl.checkpoint import KeptTrace
from irtscots_cl.device import Device, DeviceError, describe_together
from irtscots_cl.launches import Pace
from irtscots_cl.runner import Job, run_rays

SHARE = 0.5  # of what would be a device's due, taken at a time: what is left evens out what speeds did not tell
LEAST_SECONDS = 0.02  # of a launch, however little is left
log = logging.getLogger(__name__)


class Work(Protocol):
    """The rays of a trace and what they fill, known without a device.

    streams, max_rays_per_item, first_launch_rays: as of a runner.Job. sums_shapes: of its sums, which are uint64. wire:
    all of it as text, for another process.
    """

    streams: int
    max_rays_per_item: int
    first_launch_rays: int
    sums_shapes: tuple[tuple[int, ...], ...]

    def build(self, device: Device) -> Job:
        """Its job on a device; raises DeviceError if the device cannot build or hold it."""

    def wire(self) -> str: ...

    @classmethod
    def from_wire(cls, text: str) -> Work: ...


@dataclass(frozen=True)
class Ran:
    """Rays that have run. sums: as of runner.run_rays. device: facts of where, as device.describe_together.

    seconds: build, trace, kernels (of many devices, the mean over them).
    """

    sums: tuple[np.ndarray, ...]
    device: dict[str, object]
    seconds: dict[str, float]


class Site(Protocol):
    """Where rays can run."""

    def run(
        self,
        work: Work,
        rays: np.ndarray,
        progress: Callable[[int, int], None] | None = None,
        launch_rays: int | None = None,
        kept: KeptTrace | None = None,
        finished: Callable[[tuple[np.ndarray, ...]], None] | None = None,
    ) -> Ran:
        """As runner.run_rays, of the work's job."""

    def describe(self) -> dict[str, object]:
        """Facts of all its devices, as device.describe_together."""

    def about(self) -> dict[str, str]:
        """{"device", "driver"}: the names of the different ones."""

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """function(device, *arguments) on its first device; plain arguments and results, a function of a module."""


class Devices:
    """The devices of this machine that a user chose, as a Site."""

    def __init__(self, devices: Sequence[Device]):
        self._devices = tuple(devices)

    def run(self, work: Work, rays: np.ndarray, progress=None, launch_rays=None, kept=None, finished=None) -> Ran:
        started = time.perf_counter()
        with together(self._devices, work.build) as (job, facts):
            built = time.perf_counter()
            sums = run_rays(job, rays, progress, launch_rays, kept, finished)
            traced = time.perf_counter()
            seconds = {"build": built - started, "trace": traced - built, "kernels": job.pace.kernel_seconds}
            return Ran(sums, facts(), seconds)

    def describe(self) -> dict[str, object]:
        return describe_together([device.describe() for device in self._devices])

    def about(self) -> dict[str, str]:
        return differing([{"device": device.name, "driver": device.driver} for device in self._devices])

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return function(self._devices[0], *arguments)


def differing(several: list[dict]) -> dict:
    """Of many, each key with the one value that all have, or all the different values as text."""
    values = {key: sorted({str(each[key]) for each in several}) for key in several[0]}
    return {key: several[0][key] if len(found) == 1 else " + ".join(found) for key, found in values.items()}


class together:  # noqa: N801  used as a function: `with together(devices, build) as (job, facts):`
    """One job of all the devices that can build it, and a function that gives the facts of those that take part.

    A device that cannot is left out, and the log says so; DeviceError if none can.
    """

    def __init__(self, devices: Sequence[Device], build: Callable[[Device], Job]):
        self._crew: Crew | None = None
        if len(devices) == 1:
            self._job, self._facts = build(devices[0]), devices[0].describe
            return
        members = []
        for device in devices:
            try:
                members.append(Member(device, build(device)))
            except DeviceError as error:
                log.warning("left out: %s", error)
                last = error
        if not members:
            raise last
        self._job = self._crew = Crew(members)
        self._facts = self._crew.describe

    def __enter__(self) -> tuple[Job, Callable[[], dict[str, object]]]:
        return self._job, self._facts

    def __exit__(self, *_) -> None:
        if self._crew is not None:
            self._crew.close()


@dataclass
class Member:
    """A device of a crew with its job. done: replicate and part of the launches since its sums were last taken."""

    device: Device
    job: Job
    done: list[tuple[int, tuple[int, int, int, int]]] = field(default_factory=list)


class Crew:
    """Jobs of the same work on several devices, as one runner.Job.

    Each launch is shared: a thread per device takes pieces of it, larger ones on faster devices, until all is done.
    Every device adds up its own sums; sums() takes and adds them. A device that fails is left out, and the log says so:
    what it launched since its sums were last taken is launched again on the others. DeviceError when all have failed.
    """

    def __init__(self, members: Sequence[Member]):
        self._members, first = list(members), members[0].job
        self.streams, self.max_rays_per_item = first.streams, first.max_rays_per_item
        self.first_launch_rays = sum(member.job.first_launch_rays for member in members)
        self.pace, self.facts = Pace(), differing([member.job.facts for member in members])
        self._taken: tuple[np.ndarray, ...] | None = None  # sums of what is no longer on the devices
        self._todo: list[tuple[int, tuple[int, int, int, int]]] = []
        self._lock, self._pool = threading.Lock(), ThreadPoolExecutor(len(members))

    def close(self) -> None:
        self._pool.shutdown()

    def describe(self) -> dict[str, object]:
        """The facts of the devices that have not failed."""
        return describe_together([member.device.describe() for member in self._members])

    def clear(self) -> None:
        self._taken = None
        for member in list(self._members):
            member.done.clear()
            self._clear(member)

    def launch(self, replicate: int, part: tuple[int, int, int, int]) -> None:
        started = time.perf_counter()
        self._share((replicate, part))
        self.pace.launched(part[1] * part[3], time.perf_counter() - started)

    def sums(self) -> tuple[np.ndarray, ...]:
        for member in list(self._members):
            try:
                sums = member.job.sums()
            except DeviceError as error:
                self._lose(member, error)
                continue
            self._taken = sums if self._taken is None else tuple(a + b for a, b in zip(self._taken, sums, strict=True))
            member.done.clear()
            self._clear(member)
        if self._todo:  # of a device that failed just now
            self._share()
            return self.sums()
        return tuple(array.copy() for array in self._taken)

    def _clear(self, member: Member) -> None:
        try:
            member.job.clear()
        except DeviceError as error:
            self._lose(member, error)

    def _share(self, *todo: tuple[int, tuple[int, int, int, int]]) -> None:
        """Launch these parts and what else is to be done."""
        self._todo += todo
        try:
            while self._todo:  # again where a device failed when the others had come to an end
                list(self._pool.map(self._work, list(self._members)))
        except BaseException:
            self._todo.clear()  # so that the threads come to an end
            raise

    def _work(self, member: Member) -> None:
        """Launch pieces on a device while there are any."""
        while (piece := self._take(member)) is not None:
            member.done.append(piece)
            try:
                member.job.launch(*piece)
            except DeviceError as error:
                self._lose(member, error)
                return

    def _take(self, member: Member) -> tuple[int, tuple[int, int, int, int]] | None:
        """The next piece of what is to be done, of a size for this device."""
        with self._lock:
            if not self._todo:
                return None
            replicate, (stream, streams, ray, rays) = self._todo.pop()
            speeds = [m.job.pace.rays_per_second for m in self._members]
            own = member.job.pace.rays_per_second
            due = own / sum(speeds) if all(speeds) else 1 / len(speeds)
            count = max(1, int(streams * due * SHARE), int(own * LEAST_SECONDS / rays))
            if count < streams:
                self._todo.append((replicate, (stream + count, streams - count, ray, rays)))
            return replicate, (stream, min(count, streams), ray, rays)

    def _lose(self, member: Member, error: DeviceError) -> None:
        with self._lock:
            self._members.remove(member)
            if not self._members:
                raise error
            log.warning("left out: %s; its rays are traced again by %d other device(s)", error, len(self._members))
            self._todo += member.done
