"""The command `irtscots reproduce`."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

from irtscots_cl.cli.common import DEVICE_HELP, add_no_figures, command, figures, print_json, print_tables
from irtscots_cl.cli.keeping import add_resume, keeping
from irtscots_cl.cli.progress import Progress, add_quiet

NAMES = "snr, fig3, fig4, fig5, fig6, table4, table5, precision, zonal, brightness, scatter, off-axis, time"


def add(commands) -> None:
    parser = command(
        commands,
        "reproduce",
        _execute,
        "repeat the paper's tables and figures beside its own numbers",
        f"WHAT: {NAMES}, or all. Prints paper, theory, our number with its error bar and a verdict, and writes figures "
        "and reproduce.json; `all` takes a quarter of an hour on two cores and also writes reproduce.md and "
        "reproduce.html.",
        example="table5 --quick --out paper",
    )
    parser.add_argument("what", metavar="WHAT", help="a study, or all")
    parser.add_argument("--quick", action="store_true", help="without the largest ray numbers: some minutes for all")
    parser.add_argument("--device", metavar="D", help=DEVICE_HELP)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="where figures and documents go; default irtscots-out/reproduce",
        default=Path("irtscots-out/reproduce"),
    )
    add_no_figures(parser)
    add_resume(parser)
    add_quiet(parser)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.studies import suite
    from irtscots_cl.system.atomic_files import check_output_folder, plain, write_json

    names = suite.chosen(options.what)
    check_output_folder(options.out, ("reproduce.json", "reproduce.md", "reproduce.html", ".lock"))
    from irtscots_cl.opencl.device import select_device
    from irtscots_cl.pipeline.output import told_as_incomplete
    from irtscots_cl.studies.traces import SharedTraces

    device, finished = select_device(options.device), []
    with keeping(options.out, "checkpoints", options.resume, many=True) as keeper:
        traces = SharedTraces(device, options.quick, keeper=keeper)
        for name in names:
            with Progress(name, options.quiet) as traces.progress:
                finished.append(suite.run_study(name, traces))
            if not options.json:
                print_tables(suite.tables(finished[-1:]))
                print("\n".join(f"  {note}" for note in finished[-1].outcome.notes))
                sys.stdout.flush()
        names = [name for one in finished for name in one.outcome.figures]
        if not options.figures:  # documents do not link to them either
            finished = [replace(one, outcome=replace(one.outcome, figures={})) for one in finished]
        results = suite.facts(finished, traces)
        with told_as_incomplete(options.out):
            figures(options, options.out, names, partial(suite.write_figures, finished=finished))
            if options.what == suite.ALL:
                suite.write_documents(options.out, finished, traces)
            write_json(options.out / "reproduce.json", results)
        keeper.remove()
    if options.json:
        print_json(plain(results))
    else:
        verdicts = ", ".join(f"{count} {verdict}" for verdict, count in suite.counts(finished).items())
        print(f"{verdicts}; {suite.TEST}")
        print(f"results in {options.out}")
    return 0
