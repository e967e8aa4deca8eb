"""Running the package's kernels under Oclgrind, an interpreter of OpenCL C that checks every access to memory.

Oclgrind (of 2021, with LLVM 13) lacks a few of LLVM's operations: four builtins of kernels/arithmetic/simd_vector.cl
get the library's functions instead, and nothing is optimised or inlined by force. The kernels' text is otherwise what
every device gets.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partialmethod
from pathlib import Path

import numpy as np
import pyopencl as cl
import pytest

from irtscots_cl.opencl import kernel as execution
from irtscots_cl.opencl import selftest
from irtscots_cl.opencl.device import Device, all_devices
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import Source

HOW_TO_GET_IT = "no Oclgrind here: tools/check_kernels makes an environment that has it and runs these tests there"
CHECKS = ("OCLGRIND_DATA_RACES", "OCLGRIND_UNINITIALIZED")  # accesses out of bounds: always
BEFORE = """
#define __builtin_sqrtf(x) sqrt(x)
#define __builtin_sqrt(x) sqrt(x)
#define __builtin_ctzl(x) (63 - (int)clz((x) & -(x)))
#define __builtin_bitreverse32(x) reverse_bits_of(x)
#define always_inline unused
uint reverse_bits_of(uint x) {
    uint reversed = 0;
    for (int bit = 0; bit < 32; ++bit) reversed |= (x >> bit & 1u) << (31 - bit);
    return reversed;
}
"""
OPTIONS = ("-cl-opt-disable", "-fgnu89-inline")  # without optimisation an inline function needs a body of its own


class Simulated(Device):
    """Oclgrind's device as a CPU that takes 8 rays side by side, or as a GPU that takes one."""

    def __init__(self, device: Device, width: int):
        super().__init__(device.cl_device, device.index)
        object.__setattr__(self, "width", width)

    @property
    def kind(self) -> str:
        return "cpu" if self.width > 1 else "gpu"

    def vector_width(self, precision: str) -> int:
        return self.width


class Oclgrind:
    """A new context of Oclgrind's device, and what it finds wrong in it. files: kernel files that were built."""

    def __init__(self, log: Path, patch: pytest.MonkeyPatch):
        self._log, self.files = log, set()
        for check in CHECKS:
            patch.setenv(check, "1")
        patch.setenv("OCLGRIND_LOG", str(log))
        for module in (execution, selftest):
            patch.setattr(module, "build", self._build)
        patch.setattr(execution, "check_device", lambda *_: None)  # it takes long here, and its builtins are others
        patch.setattr(Workspace, "clear", _clear)
        patch.setattr(Workspace, "share", partialmethod(_share, Workspace.share))

    def device(self, width: int) -> Simulated:
        return Simulated(next(device for device in all_devices() if device.platform == "Oclgrind"), width)

    def complaints(self) -> list[str]:
        """First lines of what was found, with the place."""
        text = self._log.read_text(errors="replace") if self._log.exists() else ""
        found = [part.strip().splitlines() for part in text.split("\n\n") if part.strip()]
        return [" | ".join(line.strip() for line in lines)[:400] for lines in found]

    def _build(self, device: Device, source: Source) -> cl.Program:
        self.files |= set(source.files)
        options = [*source.options, *OPTIONS]
        return cl.Program(device.context, BEFORE + source.text).build(options=options, cache_dir=False)


def _clear(work: Workspace, buffer: cl.Buffer) -> None:
    """Zeros by a copy: Oclgrind takes no note of clEnqueueFillBuffer, and would call the buffer not set."""
    cl.enqueue_copy(work.device.queue, buffer, np.zeros(buffer.size, np.uint8))


def _share(work: Workspace, share: Callable, array: np.ndarray) -> cl.Buffer:
    """The array with its values copied in: Oclgrind takes no note of what shared memory holds, either."""
    buffer = share(work, array)
    cl.enqueue_copy(work.device.queue, buffer, array.copy())
    return buffer


def has_oclgrind() -> bool:
    return any(device.platform == "Oclgrind" for device in all_devices())
