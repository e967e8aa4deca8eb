"""OpenCL devices: their selection, and how the failures of their drivers are told."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache

import pyopencl as cl

ENVIRONMENT = "IRTSCOTS_DEVICE"
HINT = "install one: pip install 'pyopencl[pocl]' (CPU, Linux x86-64), or your GPU vendor's OpenCL driver"


class DeviceError(RuntimeError):
    """No usable OpenCL device, or one that fails; the message is one line."""


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
        """How messages name it."""
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

        PoCL reports the widest registers of the processor even where its compiler does not use them: LLVM 14 compiles
        for every AMD processor with AVX-512 as for the ones before, with AVX2. The target's name is in the version.
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
    """What the driver reports inside becomes a DeviceError of one line. doing: what failed, for the message."""
    label = device.label  # now: a device that is lost may not tell its name
    try:
        yield
    except cl.Error as error:
        raise DeviceError(f"{label}: {f'{doing}: ' if doing else ''}{first_line(error)}") from error


def first_line(error: cl.Error) -> str:
    return next((line for line in str(error).splitlines() if line.strip()), "unknown error").strip()


@lru_cache
def all_devices() -> tuple[Device, ...]:
    """Every OpenCL device of every platform, in the drivers' order; looked up once per process."""
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        return ()
    found = []
    for p, platform in enumerate(platforms):
        try:
            found += [Device(device, f"{p}:{d}") for d, device in enumerate(platform.get_devices())]
        except cl.Error:  # a platform without a device reports an error
            continue
    return tuple(found)


def select_device(choice: str | None = None) -> Device:
    """A device by index ("0:0"), kind ("gpu", "cpu") or part of its or its platform's name, in any case of letters.

    None takes the environment variable IRTSCOTS_DEVICE or, if that is not set, the best found: a GPU before a CPU,
    more compute units before fewer. "pocl" names the embedded device. Raises DeviceError if nothing fits.
    """
    devices = all_devices()
    if not devices:
        raise DeviceError(f"no OpenCL device found; {HINT}")
    source = "--device"
    if choice is None:
        choice, source = os.environ.get(ENVIRONMENT) or None, ENVIRONMENT
    usable = [d for d in devices if _is_usable(d)]
    matching = usable if choice is None else [d for d in usable if _matches(d, choice)]
    if not matching:
        allowed = "; ".join(f"{d.index} {d.name} ({d.platform})" for d in devices)
        raise DeviceError(f"{source} = {choice!r}: no such usable device; found: {allowed}")
    rank = {"gpu": 0, "other": 1, "cpu": 2}
    return min(matching, key=lambda d: (rank[d.kind], -d.cl_device.max_compute_units))


def _is_usable(device: Device) -> bool:
    try:
        return bool(device.cl_device.endian_little and device.cl_device.available)
    except cl.Error:  # it was there when the devices were listed
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
