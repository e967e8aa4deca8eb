"""What notebooks and consoles show of objects: summaries, plots, xarray's data, the widget."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import irtscots_cl as irt
from irtscots_cl.budget.assess import assess_budget
from irtscots_cl.report.plot import MAPS
from irtscots_cl.report.viewer import MODULE
from irtscots_cl.system.shown import html_table
from tests.support.synthetic import small_scene


@pytest.fixture(scope="module")
def scene():
    return small_scene("sphere-deviated", 25)


@pytest.fixture(scope="module")
def run(scene):
    return irt.trace(scene, estimator="analytic")


@pytest.fixture(scope="module")
def stack(scene, run):
    return run.images(irt.LineScan(scene))


@pytest.fixture(scope="module")
def result(scene, stack):
    return irt.reconstruct(stack, scene.nominal())


@pytest.fixture(scope="module")
def comparison(scene, result):
    return irt.compare(result, scene)


@pytest.fixture(scope="module")
def budget(scene):
    from irtscots_cl.scene.error_sources import Budget

    sources = {"camera.z_mm": 0.05, "screen.x_mm": 0.1}
    return assess_budget(scene, Budget(trials=4, sources=sources))


def axes():
    return Figure().subplots()


def test_everything_is_shown_in_a_line_and_in_a_table(scene, run, stack, result, comparison, budget):
    for shown, part in (
        (scene, "mirror 1064 mm"), (run, "estimator analytic"), (stack, "x scan 21 lines"), (stack.x, "axis x"),
        (result, f"pixels used {result.pixels_used} of"), (comparison, "slope error x"), (budget, "sources 2"),
    ):  # fmt: skip
        assert part in repr(shown) and len(repr(shown)) < 500 and "\n" not in repr(shown)
        html = shown._repr_html_()
        assert html.count("<tr>") == len(shown.summary()) and html.startswith("<table>")
        for name, text in shown.summary().items():
            assert f"<th>{name}</th><td>{text}</td>" in html


def test_text_stays_text():
    class Named:
        def summary(self):
            return {"a<b": "c&d"}

    assert "<th>a&lt;b</th><td>c&amp;d</td>" in html_table(Named())


def test_the_summary_is_that_of_the_map(result, budget):
    found = result.levelled(result.deviation_mm)[result.height_mask] * 1e6
    assert f"{np.sqrt(np.mean(found**2)):.4g} nm rms" in result.summary()["deviation from the design"]
    assert f"{budget.linear.total_nm[0]:.3g} nm rms" in budget.summary()["all together"]


def test_the_grid_is_the_pixels_and_goes_on_around_them(result):
    for grid, known in zip(result.grid_mm(), (result.x_mm, result.y_mm), strict=True):
        np.testing.assert_array_equal(grid[result.mask], known[result.mask])
    x, y = result.grid_mm()
    step = np.nanmedian(np.diff(result.x_mm, axis=1))
    # pixels beyond the rim lie where a regular grid has them, to a third of a pixel
    assert (np.abs(np.diff(x, axis=1) - step) < abs(step) / 3).all()
    assert np.isfinite(y).all() and axes().pcolormesh(x, y, result.deviation_mm, shading="nearest") is not None


@pytest.mark.parametrize("what", MAPS)
def test_maps_are_drawn(result, what):
    drawn = irt.plot(result, axes(), what=what)
    values = drawn.collections[0].get_array()
    assert values.count() == (result.height_mask if what in ("deviation", "height") else result.mask).sum() or (
        what == "standard-error"  # NaN for a single replicate
    )
    if what == "slope-x":
        np.testing.assert_allclose(values.compressed(), result.slope_x[result.mask] * 1e3)


def test_others_are_drawn(scene, run, stack, comparison, budget):
    assert irt.plot(scene, axes(), what="y").get_xlabel() == "y [mm]"
    image = irt.plot(stack, axes(), what="y", line=9)
    assert image.get_title() == "y scan, line 10 of 21"
    np.testing.assert_array_equal(image.images[0].get_array(), stack.y.image(9))
    brightest = irt.plot(stack.x, axes()).images[0].get_array()
    assert brightest.sum() == max(stack.x.image(k).sum() for k in range(21))
    light = irt.plot(run, axes()).images[0].get_array()
    assert light.sum() == pytest.approx(run.mean_curves_w("x").sum())
    error = irt.plot(comparison, axes()).images[0]
    assert error.get_clim()[0] == -error.get_clim()[1]
    bars = irt.plot(budget, axes())
    assert {tick.get_text() for tick in bars.get_yticklabels()} == {"camera.z_mm", "screen.x_mm"}


def test_what_cannot_be_drawn_is_refused(scene, stack, result):
    with pytest.raises(ValueError, match="^what = 'slope': must be one of deviation, height"):
        irt.plot(result, axes(), what="slope")
    with pytest.raises(ValueError, match="^line = 21: must be 0 to 20$"):
        irt.plot(stack, axes(), line=21)
    with pytest.raises(ValueError, match="^the budget has no sources"):
        irt.plot(assess_budget(scene), axes())
    with pytest.raises(TypeError, match="^str: must be a scene"):
        irt.plot("scene", axes())


def test_without_axes_pyplots_are_used(result):
    from matplotlib import pyplot

    with pytest.MonkeyPatch.context() as patch:
        figure = pyplot.figure()
        patch.setattr(pyplot, "gca", figure.gca)
        assert irt.plot(result).figure is figure
    pyplot.close(figure)


def test_xarray_has_the_maps(result, stack):
    pytest.importorskip("xarray", reason="pip install 'irtscots-cl[notebook]'")
    data = irt.to_xarray(result)
    np.testing.assert_array_equal(data.slope_x_rad, result.slope_x)
    assert data.deviation_nm.units == "nm" and data.deviation_nm.dims == ("row", "column")
    assert np.isfinite(data.x_mm).all() and float(data.height_mm.sel(row=12, column=12)) == result.height_mm[12, 12]
    images = irt.to_xarray(stack)
    assert images.images_y.dims == ("line_y_mm", "row", "column") and images.images_y.units == "W"
    np.testing.assert_array_equal(images.images_y[7], stack.y.image(7))
    with pytest.raises(TypeError, match="^int: must be"):
        irt.to_xarray(1)


def test_what_is_not_installed_is_named(result, monkeypatch):
    for module in ("xarray", "anywidget"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=r"pip install 'irtscots-cl\[notebook\]'"):
        irt.to_xarray(result)
    with pytest.raises(ImportError, match=r"pip install 'irtscots-cl\[notebook\]'"):
        irt.viewer(result)


def test_the_widget_holds_the_page(result, comparison, stack):
    pytest.importorskip("anywidget", reason="pip install 'irtscots-cl[notebook]'")
    widget = irt.viewer(result, comparison, stack, height_px=500)
    assert "error of the deviation" in widget.page and widget.height_px == 500 and widget.chosen == []


def test_a_click_in_the_widget_reaches_the_notebook(result, browser):
    """The widget's module with a stand-in for the notebook's model."""
    from irtscots_cl.report.page.page import page_of

    page = browser.new_page(viewport={"width": 1200, "height": 900})
    page.set_content("<div id='el'></div>")
    page.evaluate(
        """async ([module, html]) => {
          const made = await import(URL.createObjectURL(new Blob([module], { type: "text/javascript" })));
          const values = { page: html, height_px: 800 };
          window.kept = values;
          const model = { get: (name) => values[name], set: (name, value) => { values[name] = value; },
                          save_changes: () => { values.saved = true; } };
          made.default.render({ model, el: document.getElementById("el") });
        }""",
        [MODULE, page_of(result)],
    )
    inside = page.frame_locator("iframe")
    inside.locator("html[data-ready=yes]").wait_for(state="attached", timeout=30_000)
    inside.locator("#map").press("ArrowRight")
    page.wait_for_function("window.kept.saved")
    said = inside.locator("#pixel td").first.inner_text()
    assert str(page.evaluate("window.kept.chosen")) == f"[{said}]"
    page.close()
