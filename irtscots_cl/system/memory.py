"""How much memory there is: what would not fit is refused before it is taken, not when the system ends the program."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

GIB = 2.0**30
CONTAINER = Path("/sys/fs/cgroup/memory.max")


@lru_cache
def memory_bytes() -> float:
    """The least of the machine's memory, the container's and the process's limit; infinite where none is known."""
    known = [float("inf")]
    with suppress(AttributeError, ValueError, OSError):  # not a POSIX system
        known.append(float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    with suppress(ValueError, OSError):  # no container, or one without a limit
        known.append(float(CONTAINER.read_text(encoding="ascii")))
    with suppress(ImportError):  # not a POSIX system
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        known.append(float("inf") if limit == resource.RLIM_INFINITY else float(limit))
    return min(known)


def check_memory(what: str, nbytes: float) -> None:
    """Refuse, with a ValueError, `what` (source, key and value) that takes more bytes than there are."""
    if nbytes > memory_bytes():
        least = f"{nbytes / GIB:.1f} GiB of memory"
        raise ValueError(f"{what}: takes about {least}; must fit the {memory_bytes() / GIB:.1f} GiB that there are")


def peak_bytes() -> float | None:
    """The most memory that this process has held; None if the system does not tell."""
    with suppress(OSError):  # Linux' rusage also counts what the parent held before exec
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * float(next(line for line in status.splitlines() if line.startswith("VmHWM:")).split()[1])
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024  # macOS counts bytes, others KiB
    return float(unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
