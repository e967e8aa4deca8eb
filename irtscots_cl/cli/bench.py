"""The command `irtscots bench`."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from irtscots_cl.cli.common import DEVICE_HELP, add_no_figures, command, figures, print_json, print_tables

FIGURES = ("bench.png", "bench_scaling.png", "bench_accuracy.png")


def add(commands) -> None:
    parser = command(
        commands,
        "bench",
        _execute,
        "measure the tracer's throughput, and speed against error",
        "Writes bench.json, bench.png and, where asked for, bench_scaling.png and bench_accuracy.png into the output "
        "folder.",
        example="--quick --out bench",
    )
    parser.add_argument(
        "--scaling",
        action="store_true",
        help="also wall times against rays, screen pixels, detector pixels and cores: minutes more",
    )
    parser.add_argument(
        "--accuracy",
        action="store_true",
        help="also seconds against slope and height error by estimator, sampler, precision and rays: half an hour more",
    )
    parser.add_argument("--quick", action="store_true", help="fewer cases and rounds, tiny scaling; about a minute")
    parser.add_argument("--device", metavar="D", help=DEVICE_HELP)
    parser.add_argument(
        "--out", type=Path, default=Path("irtscots-out/bench"), metavar="DIR", help="default irtscots-out/bench"
    )
    add_no_figures(parser)


def _draw(results: dict, folder: Path) -> None:
    from irtscots_cl.bench.figures import write_figures

    write_figures(folder, results)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain, write_json

    check_output_folder(options.out, ("bench.json", "bench.png"))
    from irtscots_cl.bench.suite import run_bench
    from irtscots_cl.bench.tables import bench_tables
    from irtscots_cl.opencl.device import select_device
    from irtscots_cl.pipeline.output import told_as_incomplete

    with made_folder(options.out):
        results = run_bench(select_device(options.device), options.quick, options.scaling, options.accuracy)
        with told_as_incomplete(options.out):
            write_json(options.out / "bench.json", results)
            figures(options, options.out, FIGURES, partial(_draw, results))
    if options.json:
        print_json(plain(results))
    else:
        print_tables(bench_tables(results))
        print(f"multiply-add limit {results['multiply_adds_per_second'] / 1e9:.0f} G/s; results in {options.out}")
    return 0
