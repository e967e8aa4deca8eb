"""A trace without its device: its rays, the kernel that traces them, the sums that they fill."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from irtscots_cl.execution.checkpoint_file import Fingerprint
from irtscots_cl.execution.launch_plan import RateMeter, RayBlock
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.program import Source


@dataclass(frozen=True)
class TraceProgram:
    """What a device runs for a task.

    source, kernel: the OpenCL source and the name of its kernel. The kernel's arguments are, in order: the first of
    `inputs`, the Launch structure of launch(replicate, block, rays of a work-item), the other inputs, the sums,
    `scratch_bytes` of device memory (none if 0), and `after`, which are passed as they are.
    fingerprint: what the sums depend on, apart from scene, options, rays and device.
    """

    source: Source
    kernel: str
    inputs: tuple[np.ndarray, ...]
    launch: Callable[[int, RayBlock, int], np.ndarray]
    fingerprint: Fingerprint
    scratch_bytes: int = 0
    after: tuple[Any, ...] = ()


class TraceTask(Protocol):
    """The rays of a trace and the sums that they fill.

    sources: of rays (screen pixels or detector pixels). max_rays_per_item: of one work-item. first_launch_rays: rays of
    a launch before one has been timed. sums_shapes: of the sums, which are uint64.
    """

    max_rays_per_item: int
    first_launch_rays: int

    @property
    def sources(self) -> int: ...

    @property
    def sums_shapes(self) -> tuple[tuple[int, ...], ...]: ...

    def program(self, device: Device) -> TraceProgram:
        """The task's program on a device. Raises DeviceError if the device lacks the task's precision."""

    def to_json(self) -> str:
        """The task as text, for another process."""

    @classmethod
    def from_json(cls, text: str) -> TraceTask: ...


class Tracer(Protocol):
    """A task on a device or on several: DeviceTracer, DevicePool.

    sources, sums_shapes, max_rays_per_item, first_launch_rays: as of the task. rate_meter: of the launches so far.
    fingerprint: as of TraceProgram. Either `clear` and `sums` are used, or `begin` and `collect`.
    """

    sources: int
    max_rays_per_item: int
    first_launch_rays: int
    rate_meter: RateMeter
    fingerprint: Fingerprint

    @property
    def sums_shapes(self) -> tuple[tuple[int, ...], ...]: ...

    def clear(self) -> None:
        """Set the sums to zero."""

    def launch(self, replicate: int, block: RayBlock) -> None:
        """Trace a block of a replicate's rays into the sums."""

    def sums(self) -> tuple[np.ndarray, ...]:
        """The sums of all launches since the last clear: integers, so they do not depend on the launches."""

    def begin(self, sums: tuple[np.ndarray, ...]) -> None:
        """Launches from here on add to these arrays of the host, which may be read after `collect` only."""

    def collect(self) -> None:
        """Let the arrays of `begin` hold all launches since then."""


def add_to(sums: tuple[np.ndarray, ...], more: tuple[np.ndarray, ...]) -> None:
    """Add arrays to others in place."""
    for array, found in zip(sums, more, strict=True):
        array += found
