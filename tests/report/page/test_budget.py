"""The page of an error budget: the tornado chart with its table, maps that are those of budget.h5, what it says."""

from __future__ import annotations

import re

import pytest

from irtscots_cl.budget.assess import assess_budget
from irtscots_cl.report.page.budget import budget_page, costs_of
from irtscots_cl.report.page.tornado import COLOURS, Cost, tornado_chart, tornado_table
from irtscots_cl.scene.error_sources import Budget
from tests.support.small_budget import SOURCES, small_scene


@pytest.fixture(scope="module")
def found():
    sources = {**SOURCES, "camera.diffraction_nm": 600.0, "screen.brightness_random": 0.02}
    return assess_budget(small_scene(31), Budget(sources=sources, trials=8), trial=3)


@pytest.fixture
def page(opened, found, tmp_path):
    (tmp_path / "report.html").write_text(budget_page(found), encoding="utf-8")
    with opened(tmp_path / "report.html") as page:
        yield page


def test_bars_are_as_long_as_their_numbers_and_coloured_by_kind():
    costs = [Cost("a & b", "parameter", 40.0, 0.8), Cost("c", "process", 20.0, 0.2)]
    chart = tornado_chart(costs)
    lengths = [float(width) for width in re.findall(r'width="([\d.]+)" height="16"', chart)]
    assert lengths[0] == pytest.approx(2 * lengths[1], abs=0.1)
    fills = re.findall(r'height="16" fill="(#\w+)"', chart)
    assert fills == [COLOURS["parameter"], COLOURS["process"]] and "constant" not in chart
    assert "40.00 nm (80.0 %)" in chart and "a &amp; b" in chart
    assert tornado_table(costs).rows[1] == ("c", "process", "20.00", "20.0")


def test_costs_are_those_of_the_budget_largest_first(found):
    costs = costs_of(found)
    assert [cost.nm for cost in costs] == sorted((cost.nm for cost in costs), reverse=True)
    assert {cost.source: cost.nm for cost in costs} == {name: nm[0] for name, nm in found.linear.nm.items()}
    assert sum(cost.share for cost in costs) == pytest.approx(1.0)
    assert {cost.source: cost.kind for cost in costs}["noise.place_mm"] == "process"
    assert {cost.kind for cost in costs} == set(COLOURS)


def test_the_page_says_what_it_shows(page, found):
    summary = page.locator(".summary").inner_text()
    largest = costs_of(found)[0]
    assert f"{found.linear.total_nm[0]:.3g} nm rms" in summary and f"largest are {largest.source}" in summary
    table = page.locator("section table").first
    assert table.locator("tbody tr").count() == len(found.linear.nm)
    assert table.locator("tbody th").first.inner_text() == largest.source
    titles = page.locator("h2").all_inner_texts()
    assert titles[0] == "What each source costs" and any(title.startswith("Ledger of trial 3") for title in titles)
    assert "Set-up" in titles and page.locator("#frame-controls").is_hidden() and page.said == []


def test_maps_of_sources_and_of_the_ledger_are_in_the_page(page, found):
    page.select_option("#layer", label="whole error of trial 3")
    page.select_option("#terms", "3")
    left = found.trials.design.response.left(found.ledger.total_mm[None])[0, 0] * 1e6
    shown = float(re.search(r"rms ([\d.]+) nm", page.locator("#statistics").inner_text())[1])
    assert shown == pytest.approx(left, rel=5e-3)  # of single precision, and of fits over the same pixels
    largest = costs_of(found)[0]
    page.select_option("#layer", label=f"{largest.source}, one standard deviation")
    shown = float(re.search(r"rms ([\d.]+) nm", page.locator("#statistics").inner_text())[1])
    assert shown == pytest.approx(largest.nm, rel=5e-3)
    page.locator("#map").press("ArrowUp")
    names = page.locator("#pixel th").all_inner_texts()
    assert f"ledger: {largest.source}" not in names and f"{largest.source}, one standard deviation" in names


def test_the_pixel_is_that_of_the_detector(opened, tmp_path):
    """Of a detector of 205 pixels every third row and column is looked at, from the second."""
    found = assess_budget(small_scene(205), Budget(sources={"camera.x_mm": 0.1}, trials=2))
    seen = found.trials.design.seen
    assert seen.step > 1
    (tmp_path / "report.html").write_text(budget_page(found), encoding="utf-8")
    with opened(tmp_path / "report.html") as page:
        row, column = map(int, page.locator("#pixel td").first.inner_text().split(", "))
        assert row in seen.row and column in seen.column
        x, y = (
            float(v)
            for v in page.locator("#pixel td")
            .nth(1)
            .inner_text()
            .replace(" mm", "")
            .replace("\N{MINUS SIGN}", "-")
            .split(", ")
        )
        i, k = list(seen.row).index(row), list(seen.column).index(column)
        assert (x, y) == pytest.approx((seen.x_mm[i, k], seen.y_mm[i, k]), abs=1e-3)


def test_without_sources_the_usual_values_are_shown(opened, tmp_path):
    found = assess_budget(small_scene(31), Budget())
    (tmp_path / "report.html").write_text(budget_page(found), encoding="utf-8")
    with opened(tmp_path / "report.html") as page:
        assert "at usual values the largest would be" in page.locator(".summary").inner_text()
        assert page.locator("#maps").is_hidden() and page.locator("#setup").is_visible() and page.said == []


def test_nothing_serious_for_those_who_see_or_point_otherwise(page):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install 'irtscots-cl[test]'")
    found = axe.Axe().run(page).response["violations"]
    assert [(one["id"], one["impact"]) for one in found if one["impact"] in ("serious", "critical")] == []
    for width in (390, 1440):
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
