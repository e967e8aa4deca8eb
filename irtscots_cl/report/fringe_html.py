"""The report of a mirror measured by fringes as an HTML page."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from irtscots_cl.report.fringe_tables import fringe_tables
from irtscots_cl.report.tables import measured_tables
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.system.atomic_files import write_text


def write_fringe_html(path: Path, facts: MeasuredFacts, figures: list[str], toml: str) -> None:
    """Write report.html next to its figures folder."""
    import jinja2

    template = (files("irtscots_cl.report") / "templates" / "measured.html").read_text(encoding="utf-8")
    page = jinja2.Environment(autoescape=True).from_string(template)
    tables = [*measured_tables(facts), *fringe_tables(facts)]
    write_text(path, page.render(facts=facts, tables=tables, figures=figures, toml=toml))
