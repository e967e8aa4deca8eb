"""All tables of a measurement, for the terminal and the HTML page."""

from __future__ import annotations

from irtscots_cl.report.fringe_tables import fringe_tables
from irtscots_cl.report.image_tables import image_tables
from irtscots_cl.report.picture import picture_tables
from irtscots_cl.report.table import Table
from irtscots_cl.report.tables import measured_tables
from irtscots_cl.report.types import MeasuredFacts


def measurement_tables(facts: MeasuredFacts) -> list[Table]:
    """What the mirror is, what the images say of it, and how they were read; of what the facts have."""
    return measured_tables(facts) + fringe_tables(facts) + picture_tables(facts) + image_tables(facts)
