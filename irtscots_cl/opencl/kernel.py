"""Buffers and launches on a device: all OpenCL calls of the tracer, so that it does not import pyopencl."""

from __future__ import annotations

import math
import weakref
from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from irtscots_cl.opencl.device import Device, DeviceError, driver_errors
from irtscots_cl.opencl.program import Source, build
from irtscots_cl.opencl.selftest import check_device

_TOO_LITTLE_MEMORY = (
    cl.status_code.MEM_OBJECT_ALLOCATION_FAILURE,
    cl.status_code.OUT_OF_RESOURCES,
    cl.status_code.OUT_OF_HOST_MEMORY,
)
MIN_LAUNCH_ITEMS = 64  # smaller launches do not run in parallel: an error is then not caused by the launch's size


@dataclass(frozen=True)
class LocalMemory:
    """A kernel argument in local memory, with its number of bytes per work-group."""

    nbytes: int


class _Buffer(cl.Buffer):
    """A buffer that weak references can point to."""


class Workspace:
    """One built kernel on one device with its buffers, by argument name.

    Buffers live as long as the workspace. Errors of the driver become a DeviceError of one line. The constructor first
    runs the device's self-test and raises DeviceError if it fails.
    """

    def __init__(self, device: Device, source: Source, kernel: str):
        check_device(device, source.precision)
        self.device = device
        self._buffers: weakref.WeakSet[_Buffer] = weakref.WeakSet()
        self._most_items = math.inf  # in a launch, until a driver rejects one for lack of memory
        program = build(device, source)
        with driver_errors(device):  # all device queries are here: a lost device may not answer
            self._kernel = cl.Kernel(program, kernel)
            self._group = (1, 1) if device.kind == "cpu" else None
            self._memory_bytes = device.cl_device.global_mem_size
            self._buffer_bytes = device.cl_device.max_mem_alloc_size

    def upload(self, array: np.ndarray) -> cl.Buffer:
        """A device copy of the array, read-only for kernels."""
        return self._allocate(array.nbytes, cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR, array)

    def share(self, array: np.ndarray) -> cl.Buffer:
        """The array itself as device memory that kernels read and write; read it after `arrived` only."""
        return self._allocate(array.nbytes, cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR, array)

    def arrived(self, buffer: cl.Buffer, array: np.ndarray) -> None:
        """Wait for all earlier launches, until a shared array holds what they wrote."""
        with driver_errors(self.device):
            mapped, _ = cl.enqueue_map_buffer(
                self.device.queue, buffer, cl.map_flags.READ, 0, array.shape, array.dtype, is_blocking=True
            )
            mapped.base.release(self.device.queue)
            self.device.queue.finish()

    def empty(self, nbytes: int) -> cl.Buffer:
        """Uninitialised device memory that kernels read and write."""
        return self._allocate(nbytes, cl.mem_flags.READ_WRITE)

    def clear(self, buffer: cl.Buffer) -> None:
        """Set all bytes to zero."""
        with driver_errors(self.device):
            cl.enqueue_fill_buffer(self.device.queue, buffer, np.uint8(0), 0, buffer.size)

    def download(self, buffer: cl.Buffer, out: np.ndarray) -> np.ndarray:
        """Copy a buffer into the array (same number of bytes) and return it; waits for all earlier launches."""
        with driver_errors(self.device):
            cl.enqueue_copy(self.device.queue, out, buffer)
        return out

    def launch(self, grid: tuple[int, int], arguments: list) -> float:
        """Run the kernel over the grid, one work-item per work-group on CPUs. Returns the kernel's seconds.

        A launch that the driver rejects for lack of memory is halved, down to MIN_LAUNCH_ITEMS work-items; later
        launches are no larger than the size that succeeded. A kernel identifies its work-items only by get_global_id,
        so the result is the same. A launch that fails after it has begun is not repeated, because it may have added to
        its sums.
        """
        passed = [cl.LocalMemory(a.nbytes) if isinstance(a, LocalMemory) else a for a in arguments]
        seconds, waiting = 0.0, [((0, 0), grid)]
        while waiting:
            offset, part = waiting.pop()
            event = self._begin(offset, part, passed) if math.prod(part) <= self._most_items else None
            if event is None:
                waiting += _halves(offset, part)
                continue
            with driver_errors(self.device, "a kernel failed while it ran"):
                event.wait()
                seconds += (event.profile.end - event.profile.start) * 1e-9
        return seconds

    def _begin(self, offset: tuple[int, int], part: tuple[int, int], arguments: list) -> cl.Event | None:
        """Start a part of a launch; None if the driver has too little memory for its work-items."""
        with driver_errors(self.device, f"a launch of {part[0]} x {part[1]} work-items beside {self._held()}"):
            try:
                return self._kernel(self.device.queue, part, self._group, *arguments, global_offset=offset)
            except cl.Error as error:
                if error.code not in _TOO_LITTLE_MEMORY or math.prod(part) <= MIN_LAUNCH_ITEMS:
                    raise
                self._most_items = max(math.prod(part) // 2, MIN_LAUNCH_ITEMS)
                return None

    def _allocate(self, nbytes: int, flags: int, array: np.ndarray | None = None) -> cl.Buffer:
        """A buffer. Raises DeviceError, with the requested and the available memory, if it does not fit."""
        failed = f"too little memory: {nbytes} bytes wanted beside {self._held()}"
        if nbytes > self._buffer_bytes or nbytes + self._held_bytes() > self._memory_bytes:
            raise DeviceError(f"{self.device.label}: {failed}")
        given = {} if array is None else {"hostbuf": np.ascontiguousarray(array)}
        with driver_errors(self.device, failed):
            buffer = _Buffer(self.device.context, flags, nbytes, **given)
        self._buffers.add(buffer)
        return buffer

    def _held_bytes(self) -> int:
        return sum(buffer.size for buffer in self._buffers)

    def _held(self) -> str:
        return (f"{self._held_bytes()} bytes in buffers, of {self._memory_bytes} that the device has (at most "
                f"{self._buffer_bytes} in one)")  # fmt: skip


def _halves(offset: tuple[int, int], part: tuple[int, int]) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Both halves, (offset, size) each, of a part of a grid, cut across its longer side; the first half is last."""
    axis = int(part[1] > part[0])
    first = part[axis] // 2
    sizes, offsets = [list(part), list(part)], [list(offset), list(offset)]
    sizes[0][axis], sizes[1][axis], offsets[1][axis] = first, part[axis] - first, offset[axis] + first
    return [(tuple(offsets[k]), tuple(sizes[k])) for k in (1, 0)]
