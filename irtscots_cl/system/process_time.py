"""How long this process has run, the start of Python and the imports included."""

from __future__ import annotations

import os
import time
from pathlib import Path

_imported = time.monotonic()


def seconds_of_process() -> float:
    """Seconds since the process began; since the import of this module where the system does not tell."""
    try:
        fields = Path("/proc/self/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        return time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[19]) / os.sysconf("SC_CLK_TCK")
    except (AttributeError, OSError, ValueError, IndexError):  # not Linux
        return time.monotonic() - _imported
