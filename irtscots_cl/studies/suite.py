"""The studies by name: runs them, and gives their results as plain data and as one document."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path

from irtscots_cl.report.page.rendering import template
from irtscots_cl.report.tables import Table
from irtscots_cl.studies.traces import SharedTraces
from irtscots_cl.studies.verdicts import FAILURE_CHANCE, TEST, Z_LIMIT, StudyResult
from irtscots_cl.system.atomic_files import replacing, write_text
from irtscots_cl.system.versions import versions

# Name on the command line -> module; the order is that of `all`.
STUDIES = {
    "snr": "snr", "fig3": "fig3", "fig4": "fig4", "fig5": "fig5", "fig6": "fig6", "table4": "table4",
    "table5": "table5", "precision": "precision", "zonal": "zonal", "brightness": "brightness", "scatter": "scatter",
    "off-axis": "off_axis", "time": "time",
}  # fmt: skip
ALL = "all"


@dataclass(frozen=True)
class Finished:
    """A finished study. seconds: its time, including traces that it was the first to need."""

    name: str
    title: str
    outcome: StudyResult
    seconds: float


def chosen(what: str) -> tuple[str, ...]:
    """Names of the studies in WHAT. Raises ValueError for an unknown name."""
    if what == ALL:
        return tuple(STUDIES)
    if what not in STUDIES:
        raise ValueError(f"WHAT = {what!r}: must be one of {', '.join((*STUDIES, ALL))}")
    return (what,)


def run_study(name: str, traces: SharedTraces) -> Finished:
    """Run one study."""
    module = import_module(f"irtscots_cl.studies.{STUDIES[name]}")
    started = time.perf_counter()
    outcome = module.study(traces)
    return Finished(name, module.TITLE, outcome, time.perf_counter() - started)


def facts(finished: Iterable[Finished], traces: SharedTraces) -> dict[str, object]:
    """All results except the figures, as plain data."""
    return {
        "device": traces.device.describe(),
        "versions": versions(),
        "quick": traces.quick,
        "failure_chance": FAILURE_CHANCE,
        "limit_standard_errors": Z_LIMIT,
        "studies": [
            {"name": f.name, "title": f.title, "seconds": f.seconds, "rows": [asdict(r) for r in f.outcome.rows],
             "notes": list(f.outcome.notes), "figures": list(f.outcome.figures)}
            for f in finished
        ],
    }  # fmt: skip


def tables(finished: Iterable[Finished]) -> list[Table]:
    return [f.outcome.table(f"{f.name}: {f.title}") for f in finished]


def counts(finished: Iterable[Finished]) -> dict[str, int]:
    """Number of rows with each verdict."""
    found: dict[str, int] = {}
    for verdict in (row.verdict for f in finished for row in f.outcome.rows):
        found[verdict] = found.get(verdict, 0) + 1
    return found


def write_figures(folder: Path, finished: Iterable[Finished]) -> None:
    """Write all figures as PNG files into the folder, which must exist."""
    for f in finished:
        for name, figure in f.outcome.figures.items():
            with replacing(folder / name) as temporary:
                figure.savefig(temporary, dpi=120)


def write_documents(folder: Path, finished: list[Finished], traces: SharedTraces) -> None:
    """Write reproduce.md and reproduce.html next to the figures."""
    device, about = traces.device.describe(), versions()
    for name, escape in (("reproduce.md", False), ("reproduce.html", True)):
        page = template(name, escape).render(
            finished=finished, device=device, versions=about, quick=traces.quick, counts=counts(finished), test=TEST
        )
        write_text(folder / name, page + "\n")
