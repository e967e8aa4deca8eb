"""The command `irtscots view`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from irtscots_cl.cli.common import command, print_json


def add(commands) -> None:
    parser = command(
        commands,
        "view",
        _execute,
        "compare finished runs in a browser: numbers, maps, differences",
        "Serves one page on this machine alone (127.0.0.1) until Ctrl-C, or writes it.",
        example="out measured",
    )
    parser.add_argument("folders", type=Path, nargs="+", metavar="DIR", help="output folder of run or reconstruct")
    parser.add_argument("--port", type=int, default=0, metavar="N", help="default: any free one")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the page to this file instead of serving it")


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.cli.loopback import ADDRESS, page_server, serve_until_interrupted
    from irtscots_cl.report.page.runs import comparison_page, read_runs
    from irtscots_cl.system.atomic_files import write_text

    if options.out is not None and options.port:
        raise ValueError("--port: must be left out with --out, which serves nothing")
    page = comparison_page(read_runs(options.folders))
    if options.out is not None:
        write_text(options.out, page)
        print_json({"file": str(options.out)}) if options.json else print(f"written to {options.out}")
        return 0
    server = page_server(page.encode, options.port)
    address = f"http://{ADDRESS}:{server.server_port}/"
    print_json({"address": address}) if options.json else print(f"{address} shows the runs; Ctrl-C ends it")
    sys.stdout.flush()
    serve_until_interrupted(server)
    return 0
