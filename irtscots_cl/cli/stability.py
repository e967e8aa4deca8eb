"""The command `irtscots stability`."""

from __future__ import annotations

import argparse

from irtscots_cl.cli.common import command, print_json, print_tables
from irtscots_cl.cli.progress import Progress, add_quiet


def add(commands) -> None:
    parser = command(
        commands,
        "stability",
        _execute,
        "check the arithmetic on hard cases against exact references",
        "Prints of each case the check that comes nearest to its limit, then those that failed; the exit code is 0 in "
        "either case. --json gives all checks, and their number under `failed`. Needs mpmath: "
        "pip install 'irtscots-cl[stability]'.",
        example="--device cpu",
    )
    parser.add_argument(
        "--device",
        metavar="D",
        help="part of a device's name, its index such as 0:0, cpu or gpu; default: every device that works",
    )
    parser.add_argument("--long", action="store_true", help="also the cases that take many seconds or much memory")
    add_quiet(parser)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.stability.suite import failure_table, run_stability, stability_tables

    with Progress("checking", options.quiet, "checks") as progress:
        results = run_stability(_devices(options.device), options.long, progress)
    if options.json:
        from irtscots_cl.system.atomic_files import plain

        print_json(plain(results))
        return 0
    print_tables(stability_tables(results))
    if results["failed"]:
        print_tables([failure_table(results)])
    print(f"{results['checks']} checks in {results['seconds']:.0f} s, failed: {results['failed']}")
    return 0


def _devices(choice: str | None) -> list:
    from irtscots_cl.opencl.device import DeviceError, all_devices, select_device
    from irtscots_cl.opencl.selftest import check_device

    if choice is not None:
        return [select_device(choice)]
    usable = []
    for device in all_devices():
        try:
            check_device(device, "fp32")
        except DeviceError:
            continue
        usable.append(device)
    return usable or [select_device(None)]  # its error says what to do if there is no device
