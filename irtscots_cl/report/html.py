"""The reports of a run and of a measurement as HTML pages."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from irtscots_cl.report.table import Table
from irtscots_cl.report.tables import summary_tables
from irtscots_cl.report.types import MeasuredFacts, Report
from irtscots_cl.system.atomic_files import write_text


def write_html(path: Path, report: Report, figures: list[str], toml: str) -> None:
    """Write report.html of a run next to its figures folder."""
    device = report["device"]
    intro = (
        f"{report['estimator']} estimator, {report['sampler']} sampler, {report['precision']}, seed {report['seed']}: "
        f"{report['rays_total']:,} rays at {report['rays_per_second'] / 1e6:.1f} M rays/s on {device['name']} "
        f"({device['driver']})."
    )
    title, scene = f"{report['scene']}: simulated SCOTS test", report["scene"]
    _write(path, title, scene, intro, "Images and maps", summary_tables(report), figures, toml)


def write_measured_html(path: Path, facts: MeasuredFacts, figures: list[str], toml: str) -> None:
    """Write report.html of a measurement next to its figures folder."""
    from irtscots_cl.report.measurement_tables import measurement_tables  # a run has none of them

    intro = (
        f"Measured by {facts['measure']}: {facts['pixels_used']:,} pixels, standard error of the height "
        f"{facts['height_standard_error_nm']:.3g} nm rms, piston and tilt removed."
    )
    title, scene = f"{facts['scene']}: measured by {facts['measure']}", facts["scene"]
    _write(path, title, scene, intro, "Maps", measurement_tables(facts), figures, toml)


def _write(
    path: Path, title: str, scene: str, intro: str, pictures: str, tables: list[Table], figures: list[str], toml: str
) -> None:
    import jinja2

    template = (files("irtscots_cl.report") / "templates" / "report.html").read_text(encoding="utf-8")
    page = jinja2.Environment(autoescape=True).from_string(template)
    text = page.render(
        title=title, scene=scene, intro=intro, pictures=pictures, tables=tables, figures=figures, toml=toml
    )
    write_text(path, text)
