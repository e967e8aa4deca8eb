"""The command `irtscots watch`."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from irtscots_cl.cli.common import command, print_json
from irtscots_cl.cli.job_file import STATES, Job, read_job
from irtscots_cl.cli.progress import facts_text


def add(commands) -> None:
    parser = command(
        commands,
        "watch",
        _execute,
        "show a running job: how far it is, the error and the map so far",
        "Serves one page on this machine alone (127.0.0.1), which renews itself, until Ctrl-C; or prints once.",
        example="out --once",
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="output folder of a run at work")
    parser.add_argument("--port", type=int, default=0, metavar="N", help="default: any free one")
    parser.add_argument("--once", action="store_true", help="print it once instead of serving a page; so does --json")


def _execute(options: argparse.Namespace) -> int:
    job = read_job(options.folder)
    if options.json:
        print_json({"state": job.state} | job.facts)
        return 0
    if options.once:
        print("\n".join(f"{name}: {text}" for name, text in job_rows(job)))
        return 0
    from irtscots_cl.cli.loopback import ADDRESS, page_server, serve_until_interrupted

    server = page_server(lambda: _page(options.folder).encode(), options.port)
    print(f"http://{ADDRESS}:{server.server_port}/ shows the job; Ctrl-C ends it")
    sys.stdout.flush()
    serve_until_interrupted(server)
    return 0


def job_rows(job: Job) -> list[tuple[str, str]]:
    """What is known of a job, by name."""
    facts, rows = job.facts, [("state", STATES[job.state])]
    if not facts:
        return rows
    doing = str(facts.get("doing"))
    if facts.get("total"):
        done, total = facts["done"], facts["total"]
        doing += f", {done / total:.0%}, {facts_text(done, total, facts.get('unit', ''), facts.get('per_second'))}"
    rows.append(("doing", doing))
    if facts.get("so_far"):
        rows.append(("so far", facts["so_far"]))
    rows += [("began", _clock(facts.get("began"))), ("told", _clock(facts.get("updated"))),
             ("process", f"{facts.get('process')} on {facts.get('machine')}"),
             ("command", str(facts.get("command")))]  # fmt: skip
    return rows


def _clock(seconds: object) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds)) if isinstance(seconds, float) else "unknown"


def _page(folder: Path) -> str:
    from irtscots_cl.report.page.job import job_page

    try:
        job = read_job(folder)
    except ValueError as error:  # the folder went while the page was open
        return job_page(folder.name, [("state", str(error))], None)
    return job_page(folder.name, job_rows(job), job.maps)
