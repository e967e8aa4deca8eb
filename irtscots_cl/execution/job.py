"""What runs and where: the rays of a trace, the kernel that traces them, their sums."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from irtscots_cl.execution.checkpoint import Checkpoint
from irtscots_cl.execution.checkpoint_file import Fingerprint
from irtscots_cl.execution.launch_plan import RateMeter
from irtscots_cl.opencl.device import Device


class Work(Protocol):
    """The rays of a trace and what they fill, known without a device.

    streams, max_rays_per_item, first_launch_rays: as of a runner.Job. sums_shapes: of its sums, which are uint64. wire:
    all of it as text, for another process.
    """

    sources: int
    max_rays_per_item: int
    first_launch_rays: int
    sums_shapes: tuple[tuple[int, ...], ...]

    def build(self, device: Device) -> Job:
        """Its job on a device; raises DeviceError if the device cannot build or hold it."""

    def to_json(self) -> str: ...

    @classmethod
    def from_json(cls, text: str) -> Work: ...


@dataclass(frozen=True)
class TraceSums:
    """Rays that have run. sums: as of runner.run_rays. device: facts of where, as device.describe_together.

    seconds: build, trace, kernels (of many devices, the mean over them).
    """

    sums: tuple[np.ndarray, ...]
    device: dict[str, object]
    seconds: dict[str, float]


class Executor(Protocol):
    """Where rays can run."""

    def run(
        self,
        work: Work,
        rays: np.ndarray,
        progress: Callable[[int, int], None] | None = None,
        launch_rays: int | None = None,
        kept: Checkpoint | None = None,
        finished: Callable[[tuple[np.ndarray, ...]], None] | None = None,
    ) -> TraceSums:
        """As runner.run_rays, of the work's job."""

    def describe(self) -> dict[str, object]:
        """Facts of all its devices, as device.describe_together."""

    def device_identity(self) -> dict[str, str]:
        """{"device", "driver"}: the names of the different ones."""

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """function(device, *arguments) on its first device; plain arguments and results, a function of a module."""


class Job(Protocol):
    """A built kernel with its buffers, for one scene on one device.

    streams: sources of rays. max_rays_per_item: of a work-item. first_launch_rays: before a launch has been timed.
    pace: of the launches so far. facts: what the sums depend on, but for scene, options, rays and device.
    """

    sources: int
    max_rays_per_item: int
    first_launch_rays: int
    rate_meter: RateMeter
    facts: Fingerprint

    def clear(self) -> None:
        """Set the sums to zero."""

    def launch(self, replicate: int, part: tuple[int, int, int, int]) -> None:
        """Trace a part of a replicate's rays, as plan_launches gives it, into the sums."""

    def sums(self) -> tuple[np.ndarray, ...]:
        """The sums of all launches since the last clear: whole numbers, so they do not depend on the launches."""
