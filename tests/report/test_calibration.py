"""The facts of a calibration and their tables."""

from __future__ import annotations

import math
from functools import lru_cache

import pytest
from calibrations import knowing, measured, paraboloid

from irtscots_cl.calibration.calibrate import FITTED, Calibrated, Unknowns, calibrate
from irtscots_cl.report.calibration import calibration_facts, calibration_tables, known_by


@lru_cache
def found() -> Calibrated:
    scene = knowing(paraboloid(21), camera__y_mm=0.01, camera_to_screen=(436.2, 0.05))
    return calibrate([measured(scene, {"camera.x_mm": 0.3})], scene, Unknowns(FITTED, mirror_order=2))


def test_facts():
    facts = calibration_facts(found(), [])
    by_name = {u["name"]: u for u in facts["unknowns"]}
    assert (
        by_name["camera.y_mm"]["prior_source"] == "calibration.known" and by_name["camera.y_mm"]["known_by"] == "prior"
    )
    assert by_name["zernike.6_um"]["unit"] == "um" and by_name["camera.x_mm"]["prior"] == 0.5
    (distance,) = facts["distances"]
    assert (distance["known_mm"], distance["sigma_mm"]) == (436.2, 0.05)
    assert len(facts["covariance"]) == len(facts["unknowns"]) == 15
    errors = [math.sqrt(row[k]) for k, row in enumerate(facts["covariance"])]
    assert errors == pytest.approx([u["standard_error"] for u in facts["unknowns"]])
    heights = facts["height_nm_rms"]
    assert heights["standard_deviation"]["piston_tilt"] > heights["noise"]["piston_tilt"] > 0
    assert facts["better_with"] and len(facts["zernike"]) == 12


def test_tables_say_the_same():
    facts = calibration_facts(found(), [])
    tables = {table.title: table for table in calibration_tables(facts)}
    assert set(tables) >= {"Calibration", "Geometry", "Heights", "Low terms of the height", "Known distances"}
    assert dict(tables["Calibration"].rows)["verdict"] == facts["verdict"]
    assert dict(tables["Calibration"].rows)["mirror terms"] == "to radial order 2"
    rows = {row[0]: row for row in tables["Geometry"].rows}
    assert len(rows) == 12 and rows["camera.y_mm"][-2:] == ("prior", "calibration.known")
    assert all(len(row) == len(table.head) for table in tables.values() for row in table.rows)


@pytest.mark.parametrize(
    ("error", "prior", "words"),
    [(0.1, 0.5, "data"), (0.3, 0.5, "data and prior"), (0.49, 0.5, "prior"), (0.1, math.nan, "data")],
)
def test_what_determines_an_unknown(error, prior, words):
    assert known_by(error, prior) == words
