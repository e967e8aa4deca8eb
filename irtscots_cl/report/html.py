"""The report as an HTML page."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from irtscots_cl.report.tables import summary_tables
from irtscots_cl.report.types import Report
from irtscots_cl.system.atomic_files import write_text


def write_html(path: Path, report: Report, figures: list[str], toml: str) -> None:
    """Write report.html next to its figures folder."""
    import jinja2

    template = (files("irtscots_cl.report") / "templates" / "report.html").read_text(encoding="utf-8")
    page = jinja2.Environment(autoescape=True).from_string(template)
    write_text(path, page.render(report=report, tables=summary_tables(report), figures=figures, toml=toml))
