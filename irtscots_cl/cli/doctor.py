"""The command `irtscots doctor`."""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

from irtscots_cl.cli.common import EXIT_NO_DEVICE, command, print_json
from irtscots_cl.cli.terminal import LEVELS, coloured, next_step

OPTIONAL = {  # module: (extra, what for)
    "distributed": ("dask", "traces on many machines"),
    "astropy": ("fits", "FITS files"),
    "imagecodecs": ("images", "packed TIFF files"),
    "mpmath": ("stability", "irtscots stability"),
    "argcomplete": ("completion", "completion of commands in the shell"),
}
LEAST_GIB, LEAST_DISK_GIB = 2.0, 1.0


def add(commands) -> None:
    command(
        commands,
        "doctor",
        _execute,
        "say whether this machine is ready: devices, drivers, folders, memory, versions, and what to do",
        "Each line is ok, note or problem; with a problem the exit code is 3.",
    )


def _execute(options: argparse.Namespace) -> int:
    found = [*_versions(), *_completion(), *_devices(), *_folders(), *_room()]
    if options.json:
        print_json([{"level": level, "what": what, "text": text} for level, what, text in found])
    else:
        for level, what, text in found:
            print(f"{coloured(f'{level:8}', LEVELS[level], sys.stdout)} {what:18} {text}")
        if all(level != "problem" for level, _, _ in found):
            next_step(options, "irtscots run sphere-deviated, or irtscots init for a mirror of your own")
    return EXIT_NO_DEVICE if any(level == "problem" for level, _, _ in found) else 0


def _versions():
    """What is installed, and whether the command is on the PATH."""
    from importlib.util import find_spec

    from irtscots_cl.system.versions import versions

    yield "ok", "versions", ", ".join(f"{name} {value}" for name, value in versions().items())
    yield "ok", "Python", f"{platform.python_version()}, {sys.executable}"
    for module, (extra, purpose) in OPTIONAL.items():
        if find_spec(module) is None:
            yield "note", "not installed", f"{module}, for {purpose}: pip install 'irtscots-cl[{extra}]'"
    if shutil.which("irtscots") is None:
        folder = sysconfig.get_path("scripts")
        yield (
            "note",
            "command",
            f"not on the PATH: run {Path(folder) / 'irtscots'}, or activate its environment",
        )


def _completion():
    """Whether the shell completes commands, and else the line that makes it."""
    from importlib.util import find_spec

    if find_spec("argcomplete") is None:  # told among what is not installed
        return
    from irtscots_cl.cli.completion import is_set_up, set_up_line

    if is_set_up(Path.home()):
        yield "ok", "completion", "set up in the shell"
    else:
        line = set_up_line(os.environ.get("SHELL", ""))
        yield "note", "completion", f"not set up in the shell: {line}, and open a new one"


def _devices():
    """Each device and whether it computes correctly."""
    from irtscots_cl.opencl.device import DeviceError, all_devices, no_device_message
    from irtscots_cl.opencl.selftest import probe

    usable = 0
    for device in all_devices():
        try:
            probe(device)
        except DeviceError as error:
            yield "note", "device", f"{device.label}: not usable: {error}"
            continue
        usable += 1
        yield "ok", "device", f"{device.label} ({device.driver}): passed its self-test"
    if not usable:
        yield "problem", "device", no_device_message()
    choice = os.environ.get("IRTSCOTS_DEVICE")
    if choice:
        from irtscots_cl.opencl.device import select_device

        try:
            yield "ok", "IRTSCOTS_DEVICE", f"{choice}: chooses {select_device().label}"
        except DeviceError as error:
            yield "problem", "IRTSCOTS_DEVICE", str(error)


def _folders():
    """Folders that must be writable."""
    from irtscots_cl.opencl.pocl_cache import cache_folder, cache_problem

    problem = cache_problem()
    if problem:
        yield "problem", "PoCL's cache", problem
    else:
        yield "ok", "PoCL's cache", str(cache_folder()[0])
    for what, folder in (("temporary files", tempfile.gettempdir()), ("results", Path.cwd())):
        if os.access(folder, os.W_OK):
            free = shutil.disk_usage(folder).free / 2**30
            level = "ok" if free >= LEAST_DISK_GIB else "problem"
            yield level, what, f"{folder}: {free:.1f} GiB free" + ("" if level == "ok" else ": free some space")
        else:
            yield "problem", what, f"{folder}: cannot be written; work in another folder"


def _room():
    """Memory."""
    from irtscots_cl.system.memory import GIB, memory_bytes

    memory = memory_bytes() / GIB
    level = "ok" if memory >= LEAST_GIB else "note"
    yield level, "memory", f"{memory:.1f} GiB" + ("" if level == "ok" else ": use coarse detectors, or --smoothing")
    yield "ok", "processors", f"{os.cpu_count()}"
