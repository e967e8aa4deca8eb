"""The command `irtscots devices`."""

from __future__ import annotations

import argparse
import sys

from irtscots_cl.cli.common import EXIT_NO_DEVICE, command, fail, print_json


def add(commands) -> None:
    command(
        commands,
        "devices",
        _execute,
        "list the OpenCL devices and what was probed on each",
    )


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.opencl import intel_driver
    from irtscots_cl.opencl.device import DeviceError, all_devices, no_device_message
    from irtscots_cl.opencl.selftest import probe

    found, devices = [], all_devices()
    for device in devices:
        facts: dict[str, object] = device.describe() | _standing(device, devices)
        try:
            facts |= probe(device)
        except DeviceError as error:
            facts["unusable"] = str(error)
        found.append(facts)
    if options.json:
        print_json(found)
    for facts in [] if options.json else found:
        print(f"{facts['index']}  {facts['name']}  ({facts['platform']}, {facts['driver']})")
        for key, value in facts.items():
            if key not in ("index", "name", "platform", "driver"):
                print(f"     {key.replace('_', ' '):28} {value}")
    if not any(device.platform == intel_driver.PLATFORM for device in devices) and (problem := intel_driver.problem()):
        print(f"irtscots: {problem}", file=sys.stderr)
    if not found:
        return fail(no_device_message(), EXIT_NO_DEVICE)
    return 0


def _standing(device, devices) -> dict[str, object]:
    """Whether it is taken where none is chosen; the measured rate, where drivers of one processor are compared."""
    from irtscots_cl.opencl.device import DeviceError, drivers_compared, select_device
    from irtscots_cl.opencl.speed import rates

    try:
        facts: dict[str, object] = {"default": select_device(None) is device}
    except DeviceError:  # of IRTSCOTS_DEVICE: commands that trace tell it
        facts = {"default": False}
    pair = drivers_compared(devices)
    return facts | ({"speed_test_rays_per_second": round(rates(pair)[device.index])} if device in pair else {})
