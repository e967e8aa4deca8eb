"""The command `irtscots run`."""

from __future__ import annotations

import argparse
from pathlib import Path

from irtscots_cl.cli.common import (
    add_measure,
    add_scene,
    add_trace_choices,
    command,
    print_json,
    print_tables,
    progress_bar,
    visible_scene,
)


def add(commands) -> None:
    parser = command(
        commands,
        "run",
        _execute,
        "simulate a test of a mirror and measure it",
        "Writes report.json, report.html, result.h5 and figures into the output folder.",
    )
    add_scene(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME")
    add_trace_choices(parser)
    add_measure(parser)
    parser.add_argument(
        "--rays-per-pixel",
        type=int,
        default=16384,
        metavar="N",
        help="rays per detector pixel (adjoint) or per screen pixel (forward); default 16384",
    )
    parser.add_argument(
        "--replicates",
        type=int,
        default=8,
        metavar="R",
        help="independent parts of the rays, for error bars; default 8",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the random numbers; default 1")
    parser.add_argument(
        "--overfill",
        type=float,
        default=1.0,
        metavar="F",
        help="forward: solid angle of the emission over the least that covers the mirror; default 1",
    )


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.files import check_output_folder
    from irtscots_cl.measures import check_measure
    from irtscots_cl.options import ANALYTIC, TraceOptions
    from irtscots_cl.tracer import share_rays

    TraceOptions(
        options.estimator, options.sampler, options.precision, options.seed, options.overfill, options.smoothing
    )
    check_measure(options.measure)
    share_rays(options.rays_per_pixel, options.replicates)
    scene = visible_scene(options.scene)
    folder = options.out if options.out is not None else Path("irtscots-out") / scene.name
    check_output_folder(folder)
    from irtscots_cl.device import select_device
    from irtscots_cl.pipeline import simulate, write_run

    device = select_device(options.device) if options.estimator != ANALYTIC else None
    with progress_bar() as progress:
        run = simulate(
            scene,
            device=device,
            progress=progress,
            estimator=options.estimator,
            sampler=options.sampler,
            precision=options.precision,
            rays_per_pixel=options.rays_per_pixel,
            replicates=options.replicates,
            seed=options.seed,
            overfill=options.overfill,
            smoothing=options.smoothing,
            measure=options.measure,
        )
    write_run(run, folder)
    if options.json:
        from irtscots_cl.files import plain

        print_json(plain(run.report))
    else:
        from irtscots_cl.report import summary_tables

        print_tables(summary_tables(run.report))
        print(f"results in {folder}")
    return 0
