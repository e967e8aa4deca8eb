"""Buffers and launches on a device: the few OpenCL calls that the tracer needs, so that it never imports pyopencl."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from irtscots_cl.device import Device, DeviceError
from irtscots_cl.program import Source, build


@dataclass(frozen=True)
class LocalMemory:
    """A kernel argument in local memory, of that many bytes per work-group."""

    nbytes: int


class Workspace:
    """One built kernel on one device with its buffers, by argument name.

    Buffers live as long as the workspace. Errors of the driver become DeviceError of one line.
    """

    def __init__(self, device: Device, source: Source, kernel: str):
        self.device = device
        self._kernel = cl.Kernel(build(device, source), kernel)

    def upload(self, array: np.ndarray) -> cl.Buffer:
        """A device copy of the array, read-only for kernels."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return self._guarded(lambda: cl.Buffer(self.device.context, flags, hostbuf=np.ascontiguousarray(array)))

    def empty(self, nbytes: int) -> cl.Buffer:
        """Device memory that kernels read and write, not yet set."""
        return self._guarded(lambda: cl.Buffer(self.device.context, cl.mem_flags.READ_WRITE, nbytes))

    def clear(self, buffer: cl.Buffer) -> None:
        """Set all bytes to zero."""
        self._guarded(lambda: cl.enqueue_fill_buffer(self.device.queue, buffer, np.uint8(0), 0, buffer.size))

    def download(self, buffer: cl.Buffer, out: np.ndarray) -> np.ndarray:
        """Copy a buffer into the array (same number of bytes) and return it; waits for all launches before."""
        self._guarded(lambda: cl.enqueue_copy(self.device.queue, out, buffer))
        return out

    def launch(self, grid: tuple[int, int], arguments: list) -> float:
        """Run the kernel over the grid, one work-item per work-group on CPUs; returns the kernel's seconds."""
        group = (1, 1) if self.device.kind == "cpu" else None
        passed = [cl.LocalMemory(a.nbytes) if isinstance(a, LocalMemory) else a for a in arguments]

        def run() -> float:
            event = self._kernel(self.device.queue, grid, group, *passed)
            event.wait()
            return (event.profile.end - event.profile.start) * 1e-9

        return self._guarded(run)

    def _guarded(self, action):
        try:
            return action()
        except cl.Error as error:
            name = f"device {self.device.index} {self.device.name}"
            raise DeviceError(f"{name}: {str(error).splitlines()[0]}") from error
