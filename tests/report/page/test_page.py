"""report.html: what is in the file, and what it does in a browser (Debian's chromium)."""

from __future__ import annotations

import dataclasses
import json
import re
import time

import h5py
import numpy as np
import pytest

from irtscots_cl.analysis.error_terms import ErrorTerm
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.pipeline.output import write_run
from irtscots_cl.pipeline.simulate import simulate
from irtscots_cl.report.page.arrays import packed
from irtscots_cl.report.page.drawings import bar_chart, ledger_flow, zernike_chart
from irtscots_cl.report.page.rendering import with_signs
from irtscots_cl.report.tables import summary_tables
from tests.support.synthetic import small_scene

LIT_SHARE = """() => {
  const c = document.getElementById("frame"), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  let lit = 0;
  for (let k = 0; k < d.length; k += 4) lit += d[k] > 100;
  return lit / (d.length / 4);
}"""
MOST_BYTES, READY_S = 6e6, 2.0
MINUS = "\N{MINUS SIGN}"


@pytest.fixture(scope="module")
def run():
    return simulate(small_scene(pixels=61), estimator="analytic")


@pytest.fixture(scope="module")
def parts(run):
    """Two terms of the height error, one a hundred times the other."""
    map_mm = np.where(run.result.mask, run.result.x_mm * 1e-9, np.nan)
    return tuple(ErrorTerm(name, (0.0, 0.0), 1.0, map_mm * size) for name, size in (("large", 1.0), ("small", 0.01)))


@pytest.fixture(scope="module")
def folder(run, parts, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    write_run(dataclasses.replace(run, parts=parts), folder)
    return folder


@pytest.fixture(scope="module")
def html(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture
def page(opened, folder):
    with opened(folder / "report.html") as page:
        yield page


def numbers(page):
    """What the table of the chosen pixel says, by name; minus signs as float() reads them."""
    rows = page.locator("#pixel tr").all()
    return {row.locator("th").inner_text(): row.locator("td").inner_text().replace(MINUS, "-") for row in rows}


def test_the_file_needs_nothing_else(html, run):
    assert len(html) < MOST_BYTES
    assert not re.findall(r'(?:src|href)="(?!data:)', html) and "url(" not in html and "@import" not in html
    for table in summary_tables(run.report):
        rows = [row for row in table.rows if row[0] != "seconds"]  # the page's own are not over when it is written
        assert all(with_signs(cell) in html.replace("&#39;", "'") for row in rows for cell in row)
    assert "irtscots run sphere-deviated --estimator analytic" in html


def test_text_of_a_scene_stays_text(run, tmp_path):
    name = dict(run.report, warnings=["<script>alert(1)</script>"])
    from irtscots_cl.report.page.page import write_page

    write_page(tmp_path / "report.html", name, run.stack, run.result, run.comparison)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text and "&lt;script&gt;alert(1)" in text


def test_packed_arrays_are_what_they_were():
    import base64
    import zlib

    values = np.array([[1.5, np.nan], [-2e-9, 7e8]], np.float32)
    data = packed(values)
    planes = np.frombuffer(zlib.decompress(base64.b64decode(data["data"])), np.uint8).reshape(4, -1)
    assert data["shape"] == [2, 2] and data["type"] == "float32"
    np.testing.assert_array_equal(np.ascontiguousarray(planes.T).view("<f4").reshape(2, 2), values)


def test_drawings_show_their_numbers():
    bars = bar_chart("a & b", [("noise", 12.34, 0.5), ("rest", 0.4, np.nan)], "nm")
    assert "12.3 ± 0.5 nm" in bars and "0.4 nm" in bars  # as many decimals in all
    assert 'aria-label="a &amp; b"' in bar_chart("a & b", [("noise", 1.0, np.nan)], "nm")
    assert f"{MINUS}0.12345 ± 0.00009" in zernike_chart([("4 power", 0.12, -0.12345, 9e-5)])
    flow = ledger_flow({"launched": 200, "detected": 150, "clipped": 50, "failed": 0})
    assert "detected 150 (75.00%)" in flow and "clipped 50 (25.00%)" in flow and "failed" not in flow


def test_it_opens_fast_without_a_word(browser, folder):
    page = browser.new_page()
    said = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    started = time.process_time()
    page.goto((folder / "report.html").as_uri())
    page.wait_for_selector("html[data-ready=yes]", timeout=30_000)
    ready = page.evaluate("performance.now()") / 1000  # since the page was asked for, with its maps drawn
    assert said == [] and time.process_time() - started < READY_S and ready < 15 * READY_S
    page.close()


def test_a_click_shows_the_numbers_of_that_pixel_in_result_h5(page, folder):
    row, column = 20, 34
    box = page.locator("#map").bounding_box()
    with h5py.File(folder / "result.h5") as file:
        rows, columns = file["mask"].shape
        names = {"slope x": "slope/x_rad", "slope y": "slope/y_rad", "centroid x": "centroid/x_mm",
                 "centroid y": "centroid/y_mm", "deviation from the design": "deviation_nm",
                 "height of the surface": "height_mm"}  # fmt: skip
        expected = {shown: float(file[name][row, column]) for shown, name in names.items()}
    page.mouse.click(box["x"] + (column + 0.5) / columns * box["width"],
                     box["y"] + (rows - 0.5 - row) / rows * box["height"])  # fmt: skip
    shown = numbers(page)
    assert shown["row, column"] == f"{row}, {column}" and shown["flag"] == "used"
    for name, value in expected.items():
        assert float(shown[name].split()[0]) == pytest.approx(value, rel=2e-5)
    page.locator("#map").press("ArrowRight")
    assert numbers(page)["row, column"] == f"{row}, {column + 1}"
    assert page.said == []


@pytest.mark.parametrize("terms", ["none", "piston_tilt", "piston_tilt_power", "piston_tilt_power_astigmatism"])
def test_terms_are_removed_as_by_the_program(page, run, terms):
    count = {"none": "0", "piston_tilt": "3", "piston_tilt_power": "4", "piston_tilt_power_astigmatism": "6"}[terms]
    page.select_option("#terms", count)
    result = run.result
    left = remove_terms(result.x_mm, result.y_mm, result.deviation_mm * 1e6, result.height_mask, terms)
    said = page.locator("#statistics").inner_text()
    assert float(re.search(r"rms ([\d.]+) nm", said)[1]) == pytest.approx(rms(left, result.height_mask), rel=1e-3)
    assert float(re.search(r"PV ([\d.]+) nm", said)[1]) == pytest.approx(np.nanmax(left) - np.nanmin(left), rel=1e-3)


def test_coma_goes_too(page, run):
    before = page.locator("#statistics").inner_text()
    page.select_option("#terms", "8")
    after = page.locator("#statistics").inner_text()
    rms_of = [float(re.search(r"rms ([\d.]+) nm", said)[1]) for said in (before, after)]
    # Noll 6 (0.3266 um) and 8 (-0.1414 um) are most of the deviation; 9, 11, 29, 38 stay
    expected = 1e3 * np.sqrt(0.1061**2 + 0.0894**2 + 0.025**2 + 0.0141**2)
    assert rms_of[0] > 380 and rms_of[1] == pytest.approx(expected, rel=0.03)


def test_parts_share_a_scale(page):
    names = page.locator("#layer option").all_inner_texts()
    parts = [name for name in names if name.startswith("error: ")]
    assert len(parts) == 2
    scales = set()
    for name in parts:
        page.select_option("#layer", label=name)
        scales.add(page.evaluate("view => document.getElementById('bar').toDataURL()", None))
    assert len(scales) == 1


def test_a_profile_is_drawn_along_a_line(page):
    box = page.locator("#map").bounding_box()
    assert page.locator("#profile").is_hidden()
    page.click("#draw-line")
    assert page.get_attribute("#draw-line", "aria-pressed") == "true"
    page.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.click(box["x"] + 0.7 * box["width"], box["y"] + 0.5 * box["height"])
    assert page.locator("#profile").is_visible()
    assert page.get_attribute("#draw-line", "aria-pressed") == "false" and page.said == []


def test_frames_are_those_of_the_images(page, run):
    page.select_option("#scan", "1")
    lines = len(run.stack.y.positions_mm)
    page.fill("#line", str(lines // 2 + 2))
    assert f"line {lines // 2 + 3} of {lines}" in page.locator("#line-text").inner_text()
    assert (
        f"{run.stack.y.positions_mm[lines // 2 + 2]:.2g}".replace("-", MINUS) in page.locator("#line-text").inner_text()
    )
    # the frame's brightness follows the image: the lit share of the canvas is that of the image
    image = run.stack.y.image(lines // 2 + 2)
    share = page.evaluate(LIT_SHARE)
    # red above 100 of cividis: from 0.26 of the scale on
    assert share == pytest.approx((image > 0.26 * run.stack.y.mean_w().max()).mean(), abs=0.03)


@pytest.mark.parametrize(("width", "height"), [(390, 844), (1366, 768)])
def test_it_fits_phones_and_laptops(browser, folder, width, height):
    page = browser.new_page(viewport={"width": width, "height": height})
    page.goto((folder / "report.html").as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.emulate_media(media="print")
    assert page.locator(".controls").first.is_hidden() and page.locator("#map").is_visible()
    page.close()


def test_nothing_serious_for_those_who_see_or_point_otherwise(page):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install 'irtscots-cl[test]'")
    found = axe.Axe().run(page).response["violations"]
    assert [(one["id"], one["impact"]) for one in found if one["impact"] in ("serious", "critical")] == []
    assert json.dumps(found) is not None


def test_all_controls_are_reached_by_keys_and_show_the_focus(page):
    reached = []
    for _ in range(30):
        page.keyboard.press("Tab")
        found = page.evaluate(
            "() => { const a = document.activeElement, s = getComputedStyle(a);"
            " return [a.id || a.tagName.toLowerCase(), s.outlineStyle, parseFloat(s.outlineWidth)]; }"
        )
        reached.append(found[0])
        assert found[0] == "body" or (found[1] != "none" and found[2] >= 2), found
    wanted = page.evaluate(
        "() => [...document.querySelectorAll('select, input, button, canvas[tabindex], summary')]"
        ".filter((e) => e.checkVisibility()).map((e) => e.id || e.tagName.toLowerCase())"
    )
    assert {"layer", "terms", "scale", "draw-line", "map", "scan", "line", "rays", "summary"} <= set(wanted)
    assert set(wanted) <= set(reached)


def test_the_chosen_pixel_is_told_to_who_listens(page, run):
    said = page.locator("#pixel-said")
    assert said.get_attribute("role") == "status"
    page.locator("#map").press("ArrowUp")
    row, column = (int(n) for n in re.match(r"pixel (\d+), (\d+): deviation", said.text_content()).groups())
    value = float(said.text_content().split()[-2].replace(MINUS, "-"))
    deviation = run.result.levelled(run.result.deviation_mm)[row, column] * 1e6
    assert value == pytest.approx(deviation, rel=1e-3) and numbers(page)["row, column"] == f"{row}, {column}"


def test_arrow_keys_stay_in_their_row_at_the_edge(page):
    row = numbers(page)["row, column"].split(",")[0]
    for _ in range(70):
        page.locator("#map").press("ArrowLeft")
    assert numbers(page)["row, column"] == f"{row}, 0"


def test_a_profile_line_is_drawn_by_keys(page):
    page.locator("#draw-line").press("Enter")
    map_ = page.locator("#map")
    map_.press("Enter")
    for _ in range(5):
        map_.press("ArrowRight")
    assert page.locator("#profile").is_hidden()
    map_.press("Enter")
    assert page.locator("#profile").is_visible() and page.get_attribute("#draw-line", "aria-pressed") == "false"


def test_the_map_has_millimetres_and_pixels_at_its_sides(page, run):
    """The number 0 mm stands where the mirror's x is 0: in the middle of the detector, pixel 30 of 61."""
    left = page.eval_on_selector_all(
        "#map-bottom span", "all => all.filter((e) => e.textContent === '0')[0].style.left"
    )
    assert float(left.rstrip("%")) == pytest.approx(50, abs=1.0)
    told = page.locator("#map-left span").all_inner_texts()
    assert "0" in told and any(text.startswith(MINUS) for text in told)
    assert page.locator("#map-top span").all_inner_texts()[:2] == ["0", "20"]


def test_letters_keep_their_size_on_phones(browser, folder):
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((folder / "report.html").as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    for name in ("curve-x", "bar"):
        ratio = page.evaluate(
            f"() => {{ const c = document.getElementById('{name}'); return c.width / c.clientWidth; }}"
        )
        assert ratio == pytest.approx(1.0, abs=0.02)  # one canvas pixel a CSS pixel: 13 px letters are 13 px
    page.close()


def test_signs_of_print():
    assert with_signs("out [um], 3.1 +- 0.2 urad, sum, maximum um") == "out [µm], 3.1 ± 0.2 µrad, sum, maximum µm"
    assert "\N{GREEK SMALL LETTER MU}" not in with_signs("um urad")
