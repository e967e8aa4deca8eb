"""The whole benchmark: the requested measurements as plain data, with the conditions of measurement."""

from __future__ import annotations

import os
import platform
import subprocess
import time
from pathlib import Path

from irtscots_cl.bench.accuracy import run_accuracy
from irtscots_cl.bench.scaling import run_scaling
from irtscots_cl.bench.throughput import run_throughput
from irtscots_cl.opencl.device import Device
from irtscots_cl.system.memory import peak_bytes
from irtscots_cl.system.versions import versions


def run_bench(device: Device, quick: bool = False, scaling: bool = False, accuracy: bool = False) -> dict:
    """Contents of bench.json: rates; with `scaling` or `quick` wall times under the key "scaling" (quick: tiny sweeps);
    with `accuracy` speed against error under the key "accuracy". Raises DeviceError if the device cannot run it.
    """
    started = time.perf_counter()
    facts = conditions(device) | {"quick": quick} | run_throughput(device, quick)
    if scaling or quick:
        facts["scaling"] = run_scaling(device, quick)
    if accuracy:
        facts["accuracy"] = run_accuracy(device, quick)
    return facts | {"peak_memory_mib": peak_memory_mib(), "seconds": time.perf_counter() - started}


def conditions(device: Device) -> dict:
    """The conditions of a measurement: device, driver, machine, load before it begins, versions, revision."""
    return {
        "device": device.describe(),
        "machine": platform.processor() or platform.machine(),
        "processors": os.cpu_count(),
        "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,  # not on Windows
        "versions": versions(),
        "git_revision": _git_revision(),
    }


def peak_memory_mib() -> float | None:
    """Peak memory of this process in MiB; None if the system does not report it."""
    found = peak_bytes()
    return None if found is None else found / 2**20


def _git_revision() -> str:
    """Revision of the source tree that the package runs from, or "unknown" for an installed package."""
    try:
        told = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=Path(__file__).parent, check=True,
                              capture_output=True, text=True, timeout=10)  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return told.stdout.strip()
