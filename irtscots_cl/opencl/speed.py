"""Which of two drivers of the same processor is faster: measured once, and kept in the user's cache folder.

A kernel of the kind that traces rays, kernels/entry/speed_test.cl, runs on both in turn. The measured rates are kept by
devices, drivers and the kernel's source: the choice stays the same until one of these changes.
"""

from __future__ import annotations

import hashlib
import json
import os
import statistics
import time
from pathlib import Path

import numpy as np

from irtscots_cl.opencl.device import Device, DeviceError
from irtscots_cl.opencl.kernel import LocalMemory, Workspace
from irtscots_cl.opencl.program import Source, compose

PIXELS = 64 * 64  # SIDE * SIDE of the kernel
RAYS_PER_BLOCK = 256  # BLOCK of kernels/arithmetic/simd_vector.cl
ITEMS_PER_UNIT = 8
FIRST_BLOCKS = 64  # of each work-item, to learn how many fill a round
ROUNDS = 5
SECONDS = 0.25  # of all rounds on one device
CLEARLY = 1.1  # a driver replaces the default one if it is faster by this factor


def fastest(default: Device, others: list[Device]) -> Device:
    """The default device, or another one that is clearly faster. Measures unless the cache knows the rates.

    A device that fails the self-test or the measurement is not taken.
    """
    known = rates([default, *others])
    best = max(others, key=lambda device: known[device.index])
    return best if known[best.index] > CLEARLY * known[default.index] else default


def rates(devices: list[Device]) -> dict[str, float]:
    """Rays per second by device index, from the cache or measured."""
    path = cache_folder() / f"speed-{_key(devices)}.json"
    try:
        kept = json.loads(path.read_text())
        if isinstance(kept, list) and len(kept) == len(devices):
            return {device.index: float(rate) for device, rate in zip(devices, kept, strict=True)}
    except (OSError, ValueError, TypeError):
        pass
    measured = measure(devices)
    _keep(path, [measured[device.index] for device in devices])
    return measured


def measure(devices: list[Device]) -> dict[str, float]:
    """Rays per second by device index, in rounds in which all take their turns; 0 for a device that fails."""
    tests, failed = {}, {device.index: 0.0 for device in devices}
    for device in devices:
        try:
            tests[device.index] = SpeedTest(device)
        except DeviceError:
            continue  # its error is told when it is chosen by name
    found: dict[str, list[float]] = {index: [] for index in tests}
    for _ in range(ROUNDS):
        for index, test in tests.items():
            found[index].append(test.rate())
    return failed | {index: statistics.median(of_one) for index, of_one in found.items()}


class SpeedTest:
    """The kernel, built and warm on one device. Raises DeviceError as Workspace and its launches do."""

    def __init__(self, device: Device):
        self._items = ITEMS_PER_UNIT * int(device.describe()["compute_units"])
        self._space = Workspace(device, _source(device), "speed_test")
        self._counts = self._space.empty(4 * PIXELS * self._items)
        self._blocks = FIRST_BLOCKS
        self.rate()
        started = time.perf_counter()
        self.rate()
        wanted = SECONDS / ROUNDS / max(time.perf_counter() - started, 1e-6)
        self._blocks = max(1, int(FIRST_BLOCKS * wanted))

    def rate(self) -> float:
        """Rays per second of one launch, by the clock: two drivers may count a kernel's time differently."""
        started = time.perf_counter()
        self._space.launch((self._items, 1), [np.uint32(self._blocks), self._counts, LocalMemory(4 * PIXELS)])
        return self._blocks * RAYS_PER_BLOCK * self._items / (time.perf_counter() - started)

    def counts(self) -> np.ndarray:
        """Rays by pixel [work-item, pixel] of the last launch."""
        return self._space.download(self._counts, np.empty((self._items, PIXELS), np.uint32))


def _source(device: Device) -> Source:
    return compose("speed_test.cl", {}, {}, "fp32", device.vector_width("fp32"))


def _key(devices: list[Device]) -> str:
    """32 hexadecimal digits of all that the rates depend on."""
    facts = [(d.name, d.platform, d.driver, d.describe()["compute_units"], _source(d).digest) for d in devices]
    return hashlib.blake2b(json.dumps(facts).encode(), digest_size=16).hexdigest()


def cache_folder() -> Path:
    """irtscots-cl in XDG_CACHE_HOME or in ~/.cache."""
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(cache) / "irtscots-cl"


def _keep(path: Path, rates: list[float]) -> None:
    """Write the rates; without a writable folder they are measured again next time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}")
        part.write_text(json.dumps(rates))
        part.replace(path)
    except OSError:
        pass
