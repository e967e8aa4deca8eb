"""PoCL's cache folder: why PoCL has no device, or builds nothing, where it cannot write there.

PoCL keeps the programs that it builds in a folder. It makes the folder when it looks for its devices, and offers none
where it cannot; it builds no program where the folder is there but cannot be written. Neither error names the folder.
The search for it is that of pocl_cache_init_topdir in PoCL's lib/CL/pocl_cache.c (3.0 to 6.0).
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

VARIABLE = "POCL_CACHE_DIR"
PLATFORM = "Portable Computing Language"  # PoCL's name of its platform


def cache_folder() -> tuple[Path, str]:
    """The folder that PoCL uses, and the environment variable that leads there; "" for none."""
    if named := os.environ.get(VARIABLE):
        return Path(named), VARIABLE
    if cache := os.environ.get("XDG_CACHE_HOME"):
        return Path(cache) / "pocl" / "kcache", "XDG_CACHE_HOME"
    if (home := os.environ.get("HOME")) is not None:
        return Path(f"{home}/.cache/pocl/kcache"), "HOME"
    return Path("/tmp/pocl/kcache"), ""


def cache_problem() -> str:
    """Why PoCL cannot write to its cache folder and what to do, in one line; "" if it can. Makes the folder."""
    folder, variable = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(2**16))  # on a full disk a file may be made, but not written
            file.flush()
    except OSError as error:
        origin = f", from the environment variable {variable}" if variable else ""
        reason = "it is a file" if folder.is_file() else error.strerror or type(error).__name__
        return f"PoCL cannot write to its cache folder {folder}{origin}: {reason}; set {VARIABLE} to a writable folder"
    return ""
