"""The choice of patterns as tables, data, advice and a figure."""

from __future__ import annotations

import json

import pytest
from designed import CAMERA, setup_of
from PIL import Image

from irtscots_cl.measurement.pattern_design.choice import design_patterns
from irtscots_cl.report.pattern_design import (
    NAME,
    advice,
    as_recorded,
    command_of,
    design_facts,
    design_tables,
    write_design_figure,
)
from irtscots_cl.system.atomic_files import plain


@pytest.fixture(scope="module")
def found():
    return design_patterns(setup_of("sphere", 25), frames=32, camera=CAMERA)


def test_data_are_json_and_tell_all(found):
    facts = json.loads(json.dumps(plain(design_facts(found, "sphere"))))
    assert facts["frames"] == 32 and facts["best_fringes"]["command"] == command_of(found.best_fringes, "sphere")
    assert len(facts["sets"]) == len(found.sets)
    lines = next(one for one in facts["sets"] if one.get("line_step_px") == 1)
    assert lines["frames_used"] == 0 and lines["nm_as_recorded"] is None and not lines["recommendable"]
    assert {"equal_frames", "equal_light"} == facts["bound_nm"].keys()


def test_table_has_the_best_of_each_kind_and_the_bound(found):
    (table,) = design_tables(found)
    names = [row[0] for row in table.rows]
    assert names[-1] == "bound of any pattern" and any(n.startswith("lines of 1") for n in names)
    assert sum("geometric" in n for n in names) == 3 and not any(" 3 steps" in n for n in names)
    assert next(row for row in table.rows if row[0].startswith("lines of 1"))[1] == "42, too many"
    assert {len(row) for row in table.rows} == {len(table.head)}


def test_advice_is_a_command_that_fits_the_frames(found):
    text = "\n".join(advice(found, "./my.toml"))
    best = found.best_fringes
    assert f"irtscots patterns ./my.toml --steps {best.fringes.steps} --periods 0.9 " in text
    assert f"in {best.used} frames" in text and best.used <= 32
    assert as_recorded(best, 32) == pytest.approx(best.nm_frames * (32 / best.used) ** 0.5)


def test_figure(found, tmp_path):
    assert write_design_figure(found, tmp_path) == NAME
    with Image.open(tmp_path / NAME) as image:
        assert image.size == (960, 600)
