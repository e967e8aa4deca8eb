"""The processor that PoCL compiles for, named where PoCL's own compiler does not know it.

PoCL asks its LLVM for the processor's name. An LLVM older than the processor answers "generic", a name that its own
front end then refuses: no kernel builds ("unknown target CPU 'generic'"). The PyPI wheel's LLVM 14
does so on AMD's family 26 (Zen 5). No option or environment variable of PoCL 3.0 overrides the name, so it is replaced
in PoCL's own description of the device, before the first program is built.
"""

from __future__ import annotations

import os
import struct
from array import array
from pathlib import Path

import pyopencl as cl

MEMORY = Path("/proc/self/mem")  # of this process
UNKNOWN = b"generic\0"
TRIPLE = b"x86_64-"  # PoCL keeps the target's triple just before the processor's name
DESCRIPTION_BYTES = 2048  # of struct _cl_device_id that are searched; PoCL 3.0 has both at 632 and 640

# Names that every LLVM since 3.9 knows, best first, with the flags of /proc/cpuinfo that they need.
PROCESSORS = (
    (b"skylake-avx512", {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2", "fma", "bmi2"}),
    (b"haswell", {"avx2", "fma", "f16c", "bmi1", "bmi2", "movbe"}),
    (b"x86-64", set()),
)

_names: list[array[int]] = []  # PoCL keeps pointers to them as long as the process runs


def name_processor(device: cl.Device) -> None:
    """Give a PoCL device a processor's name that its compiler knows, if it has none. Other devices stay as they are."""
    if device.platform.name.strip() != "Portable Computing Language" or not MEMORY.exists():
        return
    # Through the file an address that is none gives an error, no crash.
    memory = os.open(MEMORY, os.O_RDWR)
    try:
        place = unknown_name(memory, device.int_ptr)
        if place is not None:
            _names.append(array("B", best_processor(Path("/proc/cpuinfo").read_text()) + b"\0"))
            os.pwrite(memory, struct.pack("<Q", _names[-1].buffer_info()[0]), place)
    finally:
        os.close(memory)


def best_processor(cpuinfo: str) -> bytes:
    """The best of PROCESSORS that the text of /proc/cpuinfo allows."""
    line = next((line for line in cpuinfo.splitlines() if line.startswith("flags")), "")
    flags = set(line.split())
    return next(name for name, needed in PROCESSORS if needed <= flags)


def unknown_name(memory: int, description: int) -> int | None:
    """Address of the pointer to "generic" in the device's description at this address; None if there is none.

    memory: MEMORY, open.
    """
    read = _read(memory, description, DESCRIPTION_BYTES)
    words = struct.unpack(f"<{len(read) // 8}Q", read[: len(read) // 8 * 8])
    for k in range(1, len(words)):
        if _read(memory, words[k], len(UNKNOWN)) == UNKNOWN and _read(memory, words[k - 1], len(TRIPLE)) == TRIPLE:
            return description + 8 * k
    return None


def _read(memory: int, address: int, count: int) -> bytes:
    if not 0 < address < 2**47:
        return b""
    try:
        return os.pread(memory, count, address)
    except OSError:
        return b""
