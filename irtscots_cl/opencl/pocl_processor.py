"""The processor that PoCL compiles for, named where PoCL's own compiler does not know it.

PoCL asks its LLVM for the processor's name. An LLVM older than the processor answers "generic", a name that its own
front end then refuses: no kernel builds ("unknown target CPU 'generic'", PoCL issue 1049). The PyPI wheel's LLVM 14
does so on AMD's family 26 (Zen 5). No option or environment variable of PoCL 3.0 overrides the name, so it is replaced
in PoCL's own description of the device, before the first program is built.
"""

from __future__ import annotations

import ctypes
import os
import struct
from pathlib import Path

import pyopencl as cl

UNKNOWN = b"generic\0"
TRIPLE = b"x86_64-"  # PoCL keeps the target's triple just before the processor's name
DESCRIPTION_BYTES = 2048  # of struct _cl_device_id that are searched; PoCL 3.0 has both at 632 and 640

# Names that every LLVM since 3.9 knows, best first, with the flags of /proc/cpuinfo that they need.
PROCESSORS = (
    (b"skylake-avx512", {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2", "fma", "bmi2"}),
    (b"haswell", {"avx2", "fma", "f16c", "bmi1", "bmi2", "movbe"}),
    (b"x86-64", set()),
)

_names: list[ctypes.Array] = []  # PoCL keeps pointers to them as long as the process runs


def name_processor(device: cl.Device) -> None:
    """Give a PoCL device a processor's name that its compiler knows, if it has none. Other devices stay as they are."""
    if device.platform.name.strip() != "Portable Computing Language" or not Path("/proc/self/mem").exists():
        return
    place = _unknown_name(device.int_ptr)
    if place is not None:
        _names.append(ctypes.create_string_buffer(best_processor(Path("/proc/cpuinfo").read_text())))
        ctypes.c_uint64.from_address(place).value = ctypes.addressof(_names[-1])


def best_processor(cpuinfo: str) -> bytes:
    """The best of PROCESSORS that the text of /proc/cpuinfo allows."""
    line = next((line for line in cpuinfo.splitlines() if line.startswith("flags")), "")
    flags = set(line.split())
    return next(name for name, needed in PROCESSORS if needed <= flags)


def _unknown_name(description: int) -> int | None:
    """Address of the pointer to "generic" in the device's description at this address; None if there is none.

    Read through /proc/self/mem: an address that is none gives an error, no crash.
    """
    memory = os.open("/proc/self/mem", os.O_RDONLY)
    try:
        words = struct.unpack(f"<{DESCRIPTION_BYTES // 8}Q", _read(memory, description, DESCRIPTION_BYTES))
        for k in range(1, len(words)):
            if _read(memory, words[k], len(UNKNOWN)) == UNKNOWN and _read(memory, words[k - 1], 7) == TRIPLE:
                return description + 8 * k
    except struct.error:  # less could be read
        pass
    finally:
        os.close(memory)
    return None


def _read(memory: int, address: int, count: int) -> bytes:
    if not 0 < address < 2**47:
        return b""
    try:
        return os.pread(memory, count, address)
    except OSError:
        return b""
