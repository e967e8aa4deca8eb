"""Versions of the package and of what its numbers depend on."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def package_version() -> str:
    """The version of the installed package."""
    try:
        return version("irtscots-cl")
    except PackageNotFoundError:  # a source tree on the path
        return "0+uninstalled"


def versions() -> dict[str, str]:
    """Versions of the package and of what its numbers depend on."""
    found = {}
    for name in ("irtscots-cl", "pyopencl", "numpy", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # a source tree that was never installed
            found[name] = "unknown"
    return found
