"""OpenCL devices: their selection, and errors of their drivers."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache

import pyopencl as cl

from irtscots_cl.opencl import intel_driver
from irtscots_cl.opencl.pocl_cache import PLATFORM, cache_problem
from irtscots_cl.opencl.pocl_processor import name_processor

ENVIRONMENT = "IRTSCOTS_DEVICE"
ALL = "all"  # every usable device of this machine
HINT = "install one: pip install 'pyopencl[pocl]' (CPU, Linux x86-64), or your GPU vendor's OpenCL driver"


class DeviceError(RuntimeError):
    """There is no usable OpenCL device, or it fails. The message is one line."""


@dataclass(frozen=True)
class Device:
    """An OpenCL device with its context and queue, made on first use."""

    cl_device: cl.Device
    index: str  # "platform:device", as `select_device` takes it

    @cached_property
    def name(self) -> str:
        return self.cl_device.name.strip()

    @property
    def label(self) -> str:
        """The device's name in messages."""
        return f"device {self.index} {self.name}"

    @property
    def platform(self) -> str:
        return self.cl_device.platform.name.strip()

    @property
    def driver(self) -> str:
        return f"{self.cl_device.platform.version.strip()} / {self.cl_device.driver_version.strip()}"

    @cached_property
    def kind(self) -> str:
        """ "cpu", "gpu" or "other"."""
        kinds = {cl.device_type.CPU: "cpu", cl.device_type.GPU: "gpu"}
        return next((name for bit, name in kinds.items() if self.cl_device.type & bit), "other")

    @cached_property
    def context(self) -> cl.Context:
        with driver_errors(self):
            return cl.Context([self.cl_device])

    @cached_property
    def queue(self) -> cl.CommandQueue:
        with driver_errors(self):
            return cl.CommandQueue(self.context, properties=cl.command_queue_properties.PROFILING_ENABLE)

    @property
    def local_memory_bytes(self) -> int:
        return self.cl_device.local_mem_size

    @property
    def has_fp64(self) -> bool:
        return bool(self.cl_device.double_fp_config)

    def vector_width(self, precision: str) -> int:
        """Rays side by side in a work-item: 8 or 16 on CPUs, one or two registers' worth; 1 elsewhere.

        PoCL reports the widest registers of the processor even if its compiler does not use them. LLVM 14 compiles for
        every AMD processor with AVX-512 as for earlier ones, with AVX2. The version contains the target's name.
        """
        if self.kind != "cpu":
            return 1
        double = precision == "fp64"
        native = self.cl_device.native_vector_width_double if double else self.cl_device.native_vector_width_float
        if "znver" in self.cl_device.version:
            native = 8
        return 16 if native >= 16 else 8

    def describe(self) -> dict[str, object]:
        """Plain facts for reports."""
        with driver_errors(self):
            return {
                "index": self.index,
                "name": self.name,
                "platform": self.platform,
                "driver": self.driver,
                "kind": self.kind,
                "compute_units": self.cl_device.max_compute_units,
            }


@contextmanager
def driver_errors(device: Device, doing: str = "") -> Iterator[None]:
    """Turn a driver's errors in the block into a DeviceError of one line. doing: the action, for the message."""
    label = device.label  # read now: a lost device may not report its name
    try:
        yield
    except cl.Error as error:
        raise DeviceError(f"{label}: {f'{doing}: ' if doing else ''}{first_line(error)}") from error


def first_line(error: cl.Error) -> str:
    return next((line for line in str(error).splitlines() if line.strip()), "unknown error").strip()


@lru_cache
def all_devices() -> tuple[Device, ...]:
    """Every OpenCL device of every platform, in the drivers' order; listed once per process."""
    found = []
    for p, platform in enumerate(_platforms()):
        for d, device in enumerate(_devices_of(platform)):
            name_processor(device)
            found.append(Device(device, f"{p}:{d}"))
    return tuple(found)


def no_device_message() -> str:
    """Why there is no OpenCL device, and what to do, in one line."""
    empty = [platform.name.strip() for platform in _platforms() if not _devices_of(platform)]
    if not empty:
        return f"no OpenCL device found; {HINT}"
    if problem := _pocl_problem():
        return f"no OpenCL device found: {problem}"
    return f"no OpenCL device found: the OpenCL driver is there, but has no device: {', '.join(empty)}"


def _platforms() -> list[cl.Platform]:
    """All platforms, Intel's last: PoCL keeps its number where the other is installed."""
    try:
        with intel_driver.registered():
            found = cl.get_platforms()
    except cl.Error:
        return []
    return sorted(found, key=lambda platform: platform.name.strip() == intel_driver.PLATFORM)


def _devices_of(platform: cl.Platform) -> list[cl.Device]:
    try:
        return platform.get_devices()
    except cl.Error:  # a platform without a device reports an error
        return []


def _pocl_problem() -> str:
    """Why PoCL is there but has no device, if its cache folder is the reason; else ""."""
    hidden = any(platform.name.strip() == PLATFORM and not _devices_of(platform) for platform in _platforms())
    return cache_problem() if hidden else ""


def select_device(choice: str | None = None) -> Device:
    """A device by index ("0:0"), kind ("gpu", "cpu") or part of its or its platform's name, ignoring case.

    None uses the environment variable IRTSCOTS_DEVICE or, if that is not set, the best device: a GPU before a CPU,
    more compute units before fewer. "pocl" is the embedded device. Of PoCL and Intel's driver of the same processor, if
    the choice allows both, Intel's is taken if it is clearly faster (speed.fastest). Raises DeviceError if no device
    matches.
    """
    devices = all_devices()
    if not devices:
        raise DeviceError(no_device_message())
    source = "--device"
    if choice is None:
        choice, source = os.environ.get(ENVIRONMENT) or None, ENVIRONMENT
    if choice is not None and choice.strip().lower() == ALL:
        raise DeviceError(f"{source} = {choice!r}: must name one device here")
    usable = [d for d in devices if _is_usable(d)]
    matching = usable if choice is None else [d for d in usable if _matches(d, choice)]
    if not matching:
        allowed = "; ".join(f"{d.index} {d.name} ({d.platform})" for d in devices)
        hidden = f"; {problem}" if (problem := _pocl_problem()) else ""
        raise DeviceError(f"{source} = {choice!r}: no such usable device; found: {allowed}{hidden}")
    rank = {"gpu": 0, "other": 1, "cpu": 2}
    return _faster_driver(min(matching, key=lambda d: (rank[d.kind], -d.cl_device.max_compute_units)), matching)


def drivers_compared(devices: Sequence[Device]) -> list[Device]:
    """PoCL's device and Intel's of the same processor, in this order, if both are among these; else none."""
    pocl = [device for device in devices if device.platform == PLATFORM]
    intel = [device for device in devices if device.platform == intel_driver.PLATFORM and device.kind == "cpu"]
    return [*pocl[:1], *intel] if pocl and intel else []


def _faster_driver(best: Device, among: list[Device]) -> Device:
    """The best of these; if that is one of two drivers of a processor, PoCL's or, if clearly faster, Intel's."""
    pair = drivers_compared(among)
    if best not in pair:
        return best
    from irtscots_cl.opencl.speed import fastest  # it needs this module

    return fastest(pair[0], pair[1:])


def select_devices(choice: str | None = None) -> tuple[Device, ...]:
    """All usable devices for "all", one for each choice of a list with commas, or the one that select_device takes.

    Each device is listed once. None uses the environment variable IRTSCOTS_DEVICE. Raises the DeviceError of
    select_device.
    """
    wanted = choice if choice is not None else os.environ.get(ENVIRONMENT)
    if wanted is not None and wanted.strip().lower() == ALL:
        usable = _each_processor_once([d for d in all_devices() if _is_usable(d)])
        return usable or (select_device(None),)  # its error says what to do
    if wanted is None or "," not in wanted:
        return (select_device(choice),)
    chosen = [select_device(part) for part in wanted.split(",")]
    return tuple({device.index: device for device in chosen}.values())


def _each_processor_once(devices: list[Device]) -> tuple[Device, ...]:
    """Without the slower of PoCL and Intel's driver: both would run on the same cores."""
    pair = drivers_compared(devices)
    kept = _faster_driver(pair[0], pair) if pair else None
    return tuple(device for device in devices if device not in pair or device is kept)


def describe_together(facts: list[dict[str, object]]) -> dict[str, object]:
    """Device.describe() of one device; for several, the same keys for all of them together.

    compute_units: the total. devices: the facts of each, which may themselves be combined.
    """
    if len(facts) == 1:
        return facts[0]
    merged: dict[str, object] = {}
    for key in ("index", "name", "platform", "driver", "kind"):
        counted = Counter(str(of_one[key]) for of_one in facts)
        times = {text: f"{n} x " if key == "name" and n > 1 else "" for text, n in counted.items()}
        merged[key] = " + ".join(times[text] + text for text in counted)
    merged["compute_units"] = sum(int(of_one["compute_units"]) for of_one in facts)
    return merged | {"devices": facts}


def _is_usable(device: Device) -> bool:
    try:
        return bool(device.cl_device.endian_little and device.cl_device.available)
    except cl.Error:  # the device was lost after the devices were listed
        return False


def _matches(device: Device, choice: str) -> bool:
    wanted = choice.strip().lower()
    if not wanted:
        return False
    if wanted in (device.kind, device.index):
        return True
    if wanted in ("cpu", "gpu") or ":" in wanted:
        return False
    platform = device.platform.lower().replace("portable computing language", "portable computing language pocl")
    return wanted in device.name.lower() or wanted in platform


def merge_descriptions(several: list[dict]) -> dict:
    """Several descriptions as one: each key with the common value, or with all different values as text."""
    values = {key: sorted({str(each[key]) for each in several}) for key in several[0]}
    return {key: several[0][key] if len(found) == 1 else " + ".join(found) for key, found in values.items()}
