"""The command `irtscots devices`."""

from __future__ import annotations

import argparse

from irtscots_cl.cli.common import EXIT_NO_DEVICE, command, fail, print_json


def add(commands) -> None:
    command(commands, "devices", _execute, "list the OpenCL devices and what was probed on each")


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.opencl.device import DeviceError, all_devices, no_device_message
    from irtscots_cl.opencl.selftest import probe

    found = []
    for device in all_devices():
        facts: dict[str, object] = device.describe()
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
    if not found:
        return fail(no_device_message(), EXIT_NO_DEVICE)
    return 0
