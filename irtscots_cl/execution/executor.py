"""Where traces run, and how a run is watched, saved and cut into launches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from irtscots_cl.execution.checkpoint import Checkpoint
from irtscots_cl.execution.task import TraceTask

Sums = tuple[np.ndarray, ...]


@dataclass(frozen=True)
class RunControl:
    """How a run is watched, saved and cut into launches. No result depends on it.

    progress(done, total): called after each launch with numbers of rays. on_replicate(sums so far): called when a
    replicate is complete and others are to come. checkpoint: saves the sums, and a run continues from what it has
    saved. launch_rays: rays per launch, instead of timing.
    """

    progress: Callable[[int, int], None] | None = None
    on_replicate: Callable[[Sums], None] | None = None
    checkpoint: Checkpoint | None = None
    launch_rays: int | None = None


@dataclass(frozen=True)
class TraceSums:
    """The sums of a run.

    sums: each [replicates, ...] uint64, as run_rays returns them. device: the devices that took part, as
    device.describe_together returns it. seconds: build, trace, kernels (mean over the devices).
    """

    sums: Sums
    device: dict[str, object]
    seconds: dict[str, float]


class Executor(Protocol):
    """A place where traces run: LocalExecutor, DaskExecutor."""

    def run(self, task: TraceTask, rays: np.ndarray, control: RunControl = RunControl()) -> TraceSums:
        """Trace rays [replicates] per source. Raises checkpoint.Interrupted if the checkpoint ends the run."""

    def describe(self) -> dict[str, object]:
        """All its devices, as device.describe_together returns it."""

    def device_identity(self) -> dict[str, str]:
        """{"device", "driver"}: the names of the different ones."""

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """function(device, *arguments) on its first device; plain arguments and results, a function of a module."""
