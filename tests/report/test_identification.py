"""Tables, data and the figure of `irtscots identify`."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from irtscots_cl.calibration.identification import identify
from irtscots_cl.report.identification import (
    identification_facts,
    identification_tables,
    shown,
    write_direction_figure,
)
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.system.atomic_files import plain


@pytest.fixture(scope="module")
def found():
    return identify(load_scene("sphere"))


def test_the_facts_keep_the_contract(found):
    facts = json.loads(json.dumps(plain(identification_facts(found)), allow_nan=False))
    sources = {source["name"]: source for source in facts["sources"]}
    for name in ("camera.x_mm", "screen.z_mm", "screen.clocking_rad", "screen.tilt_x_rad", "screen.pitch_relative"):
        assert list(sources[name]["nm_per_unit"]) == [
            "piston_tilt", "piston_tilt_power", "piston_tilt_power_astigmatism",
            "piston_tilt_power_astigmatism_coma",
        ]  # fmt: skip
    assert sources["camera.x_mm"]["unit"] == "mm" and sources["screen.clocking_rad"]["unit"] == "rad"
    assert sources["camera.x_mm"]["nm_per_unit"]["piston_tilt"] == pytest.approx(124.04, rel=2e-3)
    assert facts["pixels"] == 9793 and facts["every_pixel"] == 1
    assert {entry["noll"] for entry in facts["zernikes"]} == set(range(4, 37))
    assert all(set(d) == {"change", "left_of_prior", "height_nm_rms", "mainly"} for d in facts["directions"])
    assert next(m for m in facts["measures"] if m["not_possible"])["name"].startswith("reference flat")


def test_the_tables_say_it_in_words(found):
    sources, directions, pairs, zernikes, measures, plan = identification_tables(found)
    rows = {row[0]: row[1:] for row in sources.rows}
    assert rows["camera.x_mm"] == ("0.1 mm", "12.4", "10.8", "6.23", "0.03")
    assert rows["screen.clocking_rad"][:2] == ("1 mrad", "19.2")
    assert rows["1 more"][1] == "below 0.01"  # the turn of a sphere about its own axis
    assert directions.rows[0][0] in ("camera.z +0.35 mm, screen.z +0.35 mm", "screen.z +0.35 mm, camera.z +0.35 mm")
    assert ("camera.x_mm, screen.x_mm", "1.3 %", "0.1 mm", "10.8", "8.8", "0.02", "0.02") in pairs.rows
    assert zernikes.rows[0][:2] == ("4", "power")
    names = [row[0] for row in measures.rows]
    assert "mirror at 0, 120 and 240 degrees" in names and "camera to screen" in names
    assert "the camera sees the screen in it through" in measures.rows[-1][2]
    assert plan.rows[0][0] in ("camera to mirror", "screen to mirror")


def test_no_row_for_pairs_where_nothing_looks_alike(found):
    tables = identification_tables(replace(found, alike=[], plan=[]))
    assert len(tables) == 4


@pytest.mark.parametrize(
    "value, unit, text",
    [
        (0.0123, "mm", "+0.012 mm"),
        (-5.4e-4, "rad", "-0.54 mrad"),
        (3.3e-4, "relative", "+0.033 %"),
        (0.13, "px", "+0.13 px"),
        (6e-5, "", "+6e-05"),
        (0.25, "um", "+0.25 um"),
    ],
)
def test_numbers_with_their_units(value, unit, text):
    assert shown(value, unit) == text
    assert shown(abs(value), unit, "") == text.lstrip("+-")


def test_the_figure(found, tmp_path, monkeypatch):
    marked = []
    monkeypatch.setattr("irtscots_cl.report.identification.mark_x", lambda axes, towards: marked.append(towards))
    name = write_direction_figure(found, tmp_path)
    assert (tmp_path / name).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert len(marked) == len(found.directions)  # every map has its fiducial
