"""A task on one device: its kernel, built and warm, with its buffers."""

from __future__ import annotations

from typing import Any

import numpy as np

from irtscots_cl.execution.launch_plan import RateMeter, RayBlock
from irtscots_cl.execution.task import TraceProgram, TraceTask, add_to
from irtscots_cl.opencl.device import Device
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.system import interruption

MIN_TIMED_RAYS = 2**14  # of a source, in a benchmark


class DeviceTracer:
    """A task.Tracer on one device. program: the task's on this device if None.

    Raises DeviceError if the device cannot build the kernel or hold its buffers.
    """

    def __init__(self, task: TraceTask, device: Device, program: TraceProgram | None = None):
        program = program or task.program(device)
        self.task, self.program, self.rate_meter = task, program, RateMeter()
        self.sources, self.fingerprint = task.sources, program.fingerprint
        self.max_rays_per_item, self.first_launch_rays = task.max_rays_per_item, task.first_launch_rays
        self._workspace = space = Workspace(device, program.source, program.kernel)
        self._inputs = [space.upload(array) for array in program.inputs]
        self._shares = device.kind == "cpu"  # its memory is the host's
        self._into: tuple[np.ndarray, ...] = ()
        self._sums = self._own_sums()
        self._scratch = [space.empty(program.scratch_bytes)] if program.scratch_bytes else []
        self._was_cleared = True
        self.launch(0, RayBlock(0, 1, 0, 0))  # no rays: some drivers compile at the first launch
        self._was_cleared = False  # cleared when it is needed: sums that are never used take no memory

    @property
    def kernel_seconds(self) -> float:
        return self.rate_meter.kernel_seconds

    @property
    def sums_shapes(self) -> tuple[tuple[int, ...], ...]:
        return self.task.sums_shapes

    def _own_sums(self) -> list[Any]:
        return [self._workspace.empty(8 * int(np.prod(shape))) for shape in self.sums_shapes]

    def clear(self) -> None:
        if self._shares and self._into:  # those arrays are the caller's
            self._into, self._sums = (), self._own_sums()
        for buffer in (*self._sums, *self._scratch):
            self._workspace.clear(buffer)
        self._was_cleared = True

    def begin(self, sums: tuple[np.ndarray, ...]) -> None:
        self._into = sums
        if not self._shares:
            self.clear()
            return
        self._sums.clear()  # first: there need not be memory for both
        self._sums = [self._workspace.share(array) for array in sums]
        for buffer in self._scratch:
            self._workspace.clear(buffer)
        self._was_cleared = True

    def collect(self) -> None:
        if self._shares:
            for buffer, array in zip(self._sums, self._into, strict=True):
                self._workspace.arrived(buffer, array)
            return
        add_to(self._into, self.sums())
        self.clear()

    def launch(self, replicate: int, block: RayBlock) -> None:
        if not self._was_cleared:
            self.clear()
        per_item = max(1, min(block.rays, self.max_rays_per_item))
        structure = self.program.launch(replicate, block, per_item)
        scene, *inputs = self._inputs
        arguments = [scene, structure, *inputs, *self._sums, *self._scratch, *self.program.after]
        items = max(1, -(-block.rays // per_item))
        self.rate_meter.launched(block.total, self._workspace.launch((block.sources, items), arguments))

    def sums(self) -> tuple[np.ndarray, ...]:
        if not self._was_cleared:
            self.clear()
        arrays = (np.empty(shape, np.uint64) for shape in self.task.sums_shapes)
        return tuple(self._workspace.download(buffer, a) for buffer, a in zip(self._sums, arrays, strict=True))

    def read_scratch(self, out: np.ndarray) -> np.ndarray:
        """Copy the program's scratch memory into the array and return it."""
        return self._workspace.download(self._scratch[0], out)

    def throughput(self, rays: int, min_rays: int = MIN_TIMED_RAYS) -> float:
        """Rays per second of one launch of about that many rays, from its kernel's time.

        Every source gets at least min_rays, so that work done once per work-item does not count; with many sources,
        only those in the middle take part.
        """
        interruption.check()
        per_source = max(rays // self.sources, min_rays)
        sources = max(1, min(self.sources, rays // per_source))
        self.rate_meter.kernel_seconds = 0.0
        self.clear()
        block = RayBlock((self.sources - sources) // 2, sources, 0, per_source)
        self.launch(0, block)
        return block.total / self.kernel_seconds
