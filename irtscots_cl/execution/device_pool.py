"""Many devices of a machine share the rays of a trace as their speeds allow."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.execution.launch_plan import RateMeter, RayBlock
from irtscots_cl.execution.task import Tracer, add_to
from irtscots_cl.opencl.device import Device, DeviceError, describe_together, merge_descriptions

SHARE = 0.5  # of a device's share by its speed, taken at a time: the rest evens out errors of the speeds
MIN_SECONDS = 0.02  # of a launch, however little is left
log = logging.getLogger(__name__)


class open_pool:  # noqa: N801  used as a function: `with open_pool(devices, build) as (tracer, describe):`
    """One tracer of all the devices that can build it, and a function that describes the devices that take part.

    A device that cannot is left out and logged; DeviceError if none can.
    """

    def __init__(self, devices: Sequence[Device], build: Callable[[Device], Tracer]):
        self._pool: DevicePool | None = None
        if len(devices) == 1:
            self._tracer, self._describe = build(devices[0]), devices[0].describe
            return
        members = []
        for device in devices:
            try:
                members.append(PooledDevice(device, build(device)))
            except DeviceError as error:
                log.warning("left out: %s", error)
                last = error
        if not members:
            raise last
        self._tracer = self._pool = DevicePool(members)
        self._describe = self._pool.describe

    def __enter__(self) -> tuple[Tracer, Callable[[], dict[str, object]]]:
        return self._tracer, self._describe

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.close()


@dataclass
class PooledDevice:
    """A device of a pool with its tracer. done: replicate and block of the launches since its sums were last taken."""

    device: Device
    tracer: Tracer
    done: list[tuple[int, RayBlock]] = field(default_factory=list)


class DevicePool:
    """Tracers of the same task on several devices, as one task.Tracer.

    Each launch is shared: a thread per device takes pieces of it, larger ones on faster devices, until all is done.
    Every device adds up its own sums; sums() takes and adds them. A device that fails is left out and logged: its
    launches since its sums were last taken are repeated on the others. DeviceError if all have failed.
    """

    def __init__(self, members: Sequence[PooledDevice]):
        self._members, first = list(members), members[0].tracer
        self.sources, self.max_rays_per_item = first.sources, first.max_rays_per_item
        self.first_launch_rays = sum(member.tracer.first_launch_rays for member in members)
        self.rate_meter = RateMeter()
        self.fingerprint = merge_descriptions([member.tracer.fingerprint for member in members])
        self.sums_shapes = first.sums_shapes
        self._taken: tuple[np.ndarray, ...] | None = None  # sums that were taken from the devices
        self._into: tuple[np.ndarray, ...] = ()
        self._todo: list[tuple[int, RayBlock]] = []
        self._lock, self._pool = threading.Lock(), ThreadPoolExecutor(len(members))

    def close(self) -> None:
        self._pool.shutdown()

    def describe(self) -> dict[str, object]:
        """The devices that have not failed."""
        return describe_together([member.device.describe() for member in self._members])

    def clear(self) -> None:
        self._taken = None
        for member in list(self._members):
            member.done.clear()
            self._clear(member)

    def begin(self, sums: tuple[np.ndarray, ...]) -> None:
        self._into = sums
        self.clear()

    def collect(self) -> None:
        add_to(self._into, self.sums())
        self._taken = None

    def launch(self, replicate: int, block: RayBlock) -> None:
        started = time.perf_counter()
        self._share((replicate, block))
        self.rate_meter.launched(block.total, time.perf_counter() - started)

    def sums(self) -> tuple[np.ndarray, ...]:
        for member in list(self._members):
            try:
                sums = member.tracer.sums()
            except DeviceError as error:
                self._lose(member, error)
                continue
            self._taken = sums if self._taken is None else tuple(a + b for a, b in zip(self._taken, sums, strict=True))
            member.done.clear()
            self._clear(member)
        if self._todo:  # of a device that failed just now
            self._share()
            return self.sums()
        return tuple(array.copy() for array in self._taken or ())

    def _clear(self, member: PooledDevice) -> None:
        try:
            member.tracer.clear()
        except DeviceError as error:
            self._lose(member, error)

    def _share(self, *todo: tuple[int, RayBlock]) -> None:
        """Launch these blocks and all others that are waiting."""
        self._todo += todo
        try:
            while self._todo:  # again where a device failed when the others had come to an end
                list(self._pool.map(self._work, list(self._members)))
        except BaseException:
            self._todo.clear()  # so that the threads come to an end
            raise

    def _work(self, member: PooledDevice) -> None:
        """Launch pieces on a device while there are any."""
        while (piece := self._take(member)) is not None:
            member.done.append(piece)
            try:
                member.tracer.launch(*piece)
            except DeviceError as error:
                self._lose(member, error)
                return

    def _take(self, member: PooledDevice) -> tuple[int, RayBlock] | None:
        """The next piece of the waiting blocks, of a size for this device."""
        with self._lock:
            if not self._todo:
                return None
            replicate, block = self._todo.pop()
            speeds = [m.tracer.rate_meter.rays_per_second for m in self._members]
            own = member.tracer.rate_meter.rays_per_second
            due = own / sum(speeds) if all(speeds) else 1 / len(speeds)
            count = max(1, int(block.sources * due * SHARE), int(own * MIN_SECONDS / block.rays))
            if count < block.sources:
                rest = block._replace(first_source=block.first_source + count, sources=block.sources - count)
                self._todo.append((replicate, rest))
            return replicate, block._replace(sources=min(count, block.sources))

    def _lose(self, member: PooledDevice, error: DeviceError) -> None:
        with self._lock:
            self._members.remove(member)
            if not self._members:
                raise error
            log.warning("left out: %s; its rays are traced again by %d other device(s)", error, len(self._members))
            self._todo += member.done
