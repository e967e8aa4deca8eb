"""The command `irtscots bench`."""

from __future__ import annotations

import argparse
from pathlib import Path

from irtscots_cl.cli.common import DEVICE_HELP, command, print_json, print_tables


def add(commands) -> None:
    parser = command(
        commands,
        "bench",
        _execute,
        "measure the tracer's throughput",
        "Writes bench.json and bench.png into the output folder.",
    )
    parser.add_argument("--quick", action="store_true", help="fewer cases and rounds, under 20 s")
    parser.add_argument("--device", metavar="D", help=DEVICE_HELP)
    parser.add_argument(
        "--out", type=Path, default=Path("irtscots-out/bench"), metavar="DIR", help="default irtscots-out/bench"
    )


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.files import check_output_folder, plain, write_json

    check_output_folder(options.out)
    from irtscots_cl.bench import bench_tables, run_bench, write_plot
    from irtscots_cl.device import select_device

    results = run_bench(select_device(options.device), options.quick)
    options.out.mkdir(parents=True, exist_ok=True)
    write_json(options.out / "bench.json", results)
    write_plot(results, options.out / "bench.png")
    if options.json:
        print_json(plain(results))
    else:
        print_tables(bench_tables(results))
        print(f"multiply-add limit {results['multiply_adds_per_second'] / 1e9:.0f} G/s; results in {options.out}")
    return 0
