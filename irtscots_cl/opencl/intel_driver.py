"""Intel's OpenCL for CPUs from its Python package, made known to this process's OpenCL loader.

The package registers its library under the path that it had where the package was built, and the loader of pyopencl's
wheels does not look into the environment's etc/OpenCL/vendors. So the loader is shown another folder: the drivers that
it would find anyway, and this library under its own path. The loader reads the folder once, when it is first asked for
platforms; it exists only meanwhile. A program that has asked before sees the drivers of its first question.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

PACKAGE = "intel-opencl-rt"
PLATFORM = "Intel(R) OpenCL"  # its name of its platform
LIBRARY = "libintelocl.so"
NEEDED = ("libimf.so", "libsvml.so", "libirng.so", "libintlc.so.5")  # that it loads, of the package LIBRARIES
LIBRARIES = "intel-cmplr-lib-rt"
VARIABLE = "OCL_ICD_VENDORS"  # the loader's: its folder of drivers
SYSTEM_FOLDER = "/etc/OpenCL/vendors"


def library() -> Path | None:
    """The driver's library in this environment; None where the package is not installed."""
    try:
        listed = distribution(PACKAGE).files or ()
    except PackageNotFoundError:
        return None
    found = [Path(str(file.locate())).resolve() for file in listed if file.name == LIBRARY]
    return next((path for path in found if path.is_file()), None)


def problem() -> str:
    """Why the installed library gives no platform and what to do, in one line; "" if it is not installed."""
    path = library()
    if path is None:
        return ""
    without = ", ".join(_missing(path))
    told = f"is not used without {without} of {LIBRARIES}" if without else "gives no OpenCL platform"
    return f"{PACKAGE} is installed and {told}: pip install 'irtscots-cl[intel]' has all that it needs"


def _missing(path: Path) -> list[str]:
    """The libraries that are not beside it. It would then take them from the current folder, whoever put them there."""
    return [name for name in NEEDED if not (path.parent / name).is_file()]


@contextmanager
def registered() -> Iterator[None]:
    """Within the block, the loader's first question for platforms also finds the package's driver, if it is there.

    Changes nothing where the package or a library that it needs is not installed, where the system's drivers include
    Intel's, or where VARIABLE names a single driver.
    """
    named = os.environ.get(VARIABLE)
    folder = Path(named or SYSTEM_FOLDER)
    path = library()
    if path is None or folder.is_file() or _missing(path):
        yield
        return
    drivers = _drivers(folder)
    if any(LIBRARY in text for text in drivers.values()):
        yield
        return
    with tempfile.TemporaryDirectory(prefix="irtscots-drivers-") as made:
        for name, text in (drivers | {"irtscots-intel.icd": str(path)}).items():
            Path(made, name).write_text(text + "\n")
        os.environ[VARIABLE] = made
        try:
            yield
        finally:
            if named is None:
                del os.environ[VARIABLE]
            else:
                os.environ[VARIABLE] = named


def _drivers(folder: Path) -> dict[str, str]:
    """The libraries that a folder of drivers names, by its files' names."""
    if not folder.is_dir():
        return {}
    return {path.name: path.read_text(errors="replace").strip() for path in sorted(folder.glob("*.icd"))}
