"""Figures of an error budget: what their titles say is what they show."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import calibration_report, small_scene

from irtscots_cl.budget.assess import assess_budget
from irtscots_cl.report.budget_figures import cumulative_figure, map_figure
from irtscots_cl.scene.error_sources import Budget


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """With a constant, a process, and two sources that act alike and are perfectly anticorrelated."""
    sources = {"camera.diffraction_nm": 3000.0, "noise.place_mm": 5e-3, "screen.y_mm": 0.05}
    report = calibration_report(tmp_path_factory.mktemp("report"), -1.0, names=("camera.z_mm", "screen.z_mm"))
    return assess_budget(small_scene(31), Budget(sources=sources, calibrated=report, trials=4))


def test_titles_of_maps_are_of_their_maps(found):
    """The standard deviation has nothing of the constant, which all tests have alike; a process has one draw."""
    *_, whole = map_figure(found).axes[:6]
    shown = np.asarray(whole.images[0].get_array())
    assert (
        f"rms {np.sqrt(np.nanmean(shown**2)):.3g} nm, PV {np.nanmax(shown) - np.nanmin(shown):.3g} nm"
        in whole.get_title()
    )
    assert np.nanmax(shown) < 60 < found.linear.nm["camera.diffraction_nm"][0]
    titles = [axes.get_title() for axes in map_figure(found).axes[:5]]
    assert [title for title in titles if "one draw" in title] == [titles[-2]] and "noise.place_mm" in titles[-2]


def test_the_cumulative_sum_says_where_it_is_not_the_total(found):
    """Distances that make up for one another cost 165 nm by squares, and next to nothing together."""
    axes = cumulative_figure(found.linear).axes[0]
    assert axes.lines[0].get_ydata()[-1] > 1.5 * found.linear.total_nm[0]
    assert f"{found.linear.total_nm[0]:.3g} nm with what is correlated" in axes.get_title()
    alone = assess_budget(small_scene(31), Budget(sources={"screen.x_mm": 0.1, "screen.y_mm": 0.1}, trials=4))
    title = cumulative_figure(alone.linear).axes[0].get_title()
    assert title == "Root of the sum of squares of all sources up to this one"
