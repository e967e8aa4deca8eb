"""Speed against error: what is tried, what is told of it; no time is judged."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from synthetic import small_scene

from irtscots_cl.bench import accuracy, figures, tables
from irtscots_cl.bench.accuracy import RAYS, default_series, mark_front, paper_runs, run_accuracy, seconds_of
from irtscots_cl.optics.setup import Setup
from irtscots_cl.system.atomic_files import plain
from irtscots_cl.tracing.samplers import SAMPLERS


@pytest.fixture(scope="module")
def results(device):
    """The quick form on a small detector."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(accuracy, "load_scene", small_scene)
        return run_accuracy(device, quick=True)


def test_every_estimator_and_sampler_is_swept_over_four_decades(device):
    series = default_series(device, quick=False)
    single = {(s.kind, s.options.sampler) for s in series if s.options.precision == "fp32"}
    assert single == {(kind, sampler) for kind in ("forward", "adjoint", "smoothed") for sampler in SAMPLERS}
    double = {s.kind for s in series if s.options.precision == "fp64"}
    assert double == ({"forward", "adjoint", "smoothed"} if device.has_fp64 else set())
    assert all(max(rays) / min(rays) >= 1e4 for rays in RAYS.values())
    assert len({s.name for s in series}) == len(series)


@pytest.mark.slow
def test_points_tell_error_noise_and_time(results):
    assert {p["kind"] for p in results["points"]} == {"analytic", "forward", "adjoint", "smoothed"}
    for point in results["points"]:
        for key in ("slope_error_urad", "height_error_nm"):
            assert point[key]["value"] > 0
        assert point["trace_seconds"]["lowest"] <= point["trace_seconds"]["median"] <= point["trace_seconds"]["highest"]
        if point["kind"] == "analytic":
            assert point["rays"] == 0 and point["height_noise_nm"] == 0 and point["slope_noise_urad"] == 0
            assert math.isnan(point["height_error_nm"]["standard_error"])
        else:
            assert point["rays"] > 0 and point["pixels_used"] > 900
            assert 0 < point["slope_noise_urad"] < 1.2 * point["slope_error_urad"]["value"]  # 2 seeds: known to 2 %
    json.dumps(plain(results), allow_nan=False)


def test_noise_falls_and_the_floors_stay(results):
    for found in results["exponents"]:
        assert -1.3 < found["slope"]["exponent"] < -0.45  # Sobol points: -0.65 to -0.8; two points, 2 seeds
    floors = {f["measure"]: f["height_error_nm"]["value"] for f in results["floors"]}
    assert floors["fine"] < floors["paper"]
    best = min(p["height_error_nm"]["value"] for p in results["points"] if p["measure"] == "paper")
    assert best > 0.9 * floors["paper"]  # no number of rays gets below; noise may take a little off by chance


def test_the_front_is_of_those_that_no_other_beats():
    def point(seconds, error):
        return {"trace_seconds": {"median": seconds / 2}, "measure_seconds": {"median": seconds / 2},
                "height_error_nm": {"value": error}}  # fmt: skip

    given = [point(1, 5), point(2, 6), point(2, 3), point(4, 3), point(8, 1), point(0.5, 9), point(9, 1.5)]
    assert [p["on_front"] for p in mark_front(given)] == [True, False, True, False, True, True, False]
    assert [seconds_of(p) for p in given] == [1, 2, 2, 4, 8, 0.5, 9]


def test_the_paper_s_runs_are_its_own():
    """37 min, 6 h and 61 h at 31,250 rays/s; errors as its Table 5 has them."""
    found = paper_runs()
    assert [round(run["seconds"] / 60) for run in found] == [37, 368, 3675]
    assert [run["height_error_nm"] for run in found] == [6.69, 2.32, 1.05]
    np.testing.assert_allclose([run["slope_error_urad"] for run in found], [2.73, 0.887, 0.394], rtol=2e-3)  # digits


def test_tables_and_figure_show_everything(results, device):
    whole = {"device": device.describe(), "cases": [], "accuracy": results}
    shown = tables.bench_tables(whole)
    assert all(len(row) == len(table.head) for table in shown for row in table.rows)
    points, front, exponents, floors, paper = shown
    assert len(points.rows) == len(results["points"]) and len(exponents.rows) == len(results["exponents"])
    assert len(front.rows) == sum(p["on_front"] for p in results["points"]) > 1
    assert len(floors.rows) == 1 + len(results["floors"]) and len(paper.rows) == 3
    figure = figures.accuracy_figure(whole)
    assert len(figure.axes) == 2 * len(results["floors"])
    assert all(axes.get_xscale() == axes.get_yscale() == "log" for axes in figure.axes)


def test_so_few_rays_that_nothing_can_be_measured_give_no_point(device, monkeypatch):
    scene = small_scene()
    series = accuracy.Series("forward", accuracy.TraceOptions("forward"), (1,), ("paper",))
    assert accuracy._point(Setup(scene), device, series, 1, 2) == []
