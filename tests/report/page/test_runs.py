"""The page of `irtscots view`: what it reads, and what it shows in a browser."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pytest

from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.report.page.runs import comparison_page, comparison_rows, read_runs
from tests.support.stored_runs import store_run


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    store_run(folder / "one")
    store_run(folder / "two", scale=1.5)
    store_run(folder / "turned", scale=1.5, orientation="quarter-turn")
    store_run(folder / "small", pixels=15)
    return folder


@pytest.fixture(scope="module")
def runs(folders):
    return read_runs([folders / name for name in ("one", "two", "small")])


@pytest.fixture
def page(opened, runs, tmp_path):
    (tmp_path / "view.html").write_text(comparison_page(runs), encoding="utf-8")
    with opened(tmp_path / "view.html") as page:
        yield page


def said(page):
    return page.locator("#statistics").inner_text()


def numbers(page):
    """rms and PV that the page says."""
    return [float(re.search(rf"{name} (\S+) nm", said(page))[1]) for name in ("rms", "PV")]


def test_rows_are_the_reports_numbers(runs):
    rows = {row[0]: row[1:] for row in comparison_rows(runs)}
    key = "height error [nm rms], piston and tilt removed"
    assert rows[key] == tuple(f"{run.facts['height_error_nm_rms']['piston_tilt']:.4g}" for run in runs)
    assert rows["scene"] == ("sphere-deviated",) * 3 and "deviation [nm], peak to valley" not in rows


def test_maps_lie_upright(folders):
    two, turned = read_runs([folders / "two", folders / "turned"])
    for name, values in two.maps.items():
        np.testing.assert_array_equal(turned.maps[name], values)


def test_folders_of_one_name_are_told_apart(folders, tmp_path):
    store_run(tmp_path / "one")
    names = [run.name for run in read_runs([folders / "one", tmp_path / "one", folders / "two"])]
    assert names == [str(folders / "one"), str(tmp_path / "one"), "two"]


def test_what_is_no_run_is_refused(folders, tmp_path):
    with pytest.raises(ValueError, match="report.json: there is none; must be the folder of a finished run$"):
        read_runs([tmp_path])
    (tmp_path / "report.json").write_text("[1]")
    with pytest.raises(ValueError, match="report.json: not a report of this program$"):
        read_runs([tmp_path])
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(ValueError, match=r"result.h5: not a readable HDF5 file: there is no file"):
        read_runs([tmp_path])
    with h5py.File(tmp_path / "result.h5", "w") as file:
        file["mirror/x_mm"] = np.zeros((2, 2))
    with pytest.raises(ValueError, match="result.h5: .*y_mm.* missing"):
        read_runs([tmp_path])
    with pytest.raises(ValueError, match="^DIR: 9 folders; must be 1 to 8$"):
        read_runs([folders / "one"] * 9)


def test_names_stay_text(folders, runs):
    import dataclasses

    text = comparison_page([dataclasses.replace(runs[0], name="</script><b>")])
    assert "</script><b>" not in text


def test_the_difference_is_that_of_the_maps(page, runs):
    one, two = (run.maps for run in runs[:2])
    assert said(page).startswith("A − B: one − two: deviation from the design, removed: piston and tilt")  # noqa: RUF001
    mask = (one["island_groups"] == 1) & (two["island_groups"] == 1)
    off = np.where(mask, one["deviation_nm"] - two["deviation_nm"], np.nan)
    left = remove_terms(one["mirror/x_mm"], one["mirror/y_mm"], off, mask, "piston_tilt")
    assert numbers(page) == pytest.approx([rms(left, mask), np.nanmax(left) - np.nanmin(left)], rel=2e-3)
    assert rms(left, mask) > 100  # half of the deviation
    page.select_option("#first", "1")
    assert numbers(page)[0] == 0  # B less itself
    page.select_option("#second", "2")
    assert "25 x 25 and 15 x 15 pixels, which have no difference" in said(page) and page.said == []


def test_each_run_is_shown_and_both_in_turn(page):
    page.select_option("#show", "first")
    one = numbers(page)
    page.select_option("#show", "second")
    assert numbers(page) == pytest.approx([1.5 * value for value in one], rel=0.01)
    page.select_option("#show", "blink")
    assert said(page).startswith("A: one")
    page.wait_for_function("document.getElementById('statistics').textContent.startsWith('B: two')")
    page.wait_for_function("document.getElementById('statistics').textContent.startsWith('A: one')")
    assert page.said == []


def test_a_click_shows_the_numbers_of_all_runs(page, runs):
    page.select_option("#layer", label="slope x")
    box, (row, column) = page.locator("#map").bounding_box(), (9, 14)
    page.mouse.click(box["x"] + (column + 0.5) / 25 * box["width"], box["y"] + (24.5 - row) / 25 * box["height"])
    shown = {
        line.locator("th").inner_text(): line.locator("td").inner_text() for line in page.locator("#pixel tr").all()
    }
    assert shown.pop("row, column") == "9, 14"
    for run in runs:
        value = run.maps["slope/x_rad"][row, column] * 1e6
        text = shown[run.name].split()[0].replace("–", "nan").replace("\N{MINUS SIGN}", "-")  # noqa: RUF001
        assert float(text) == pytest.approx(value, rel=1e-5, nan_ok=True)
    page.locator("#map").press("ArrowUp")
    assert page.locator("#pixel td").first.inner_text() == "10, 14" and page.said == []


def test_nothing_serious_for_those_who_see_or_point_otherwise(page):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install 'irtscots-cl[test]'")
    found = axe.Axe().run(page).response["violations"]
    assert [(one["id"], one["impact"]) for one in found if one["impact"] in ("serious", "critical")] == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 1200
