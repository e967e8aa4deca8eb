"""Wall time against size: the fit, the sweeps' jobs, tiny sweeps on the device. No time is judged."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from irtscots_cl.bench import figures, scaling, tables, wall
from irtscots_cl.bench.fits import fit_exponent
from irtscots_cl.bench.scaling import Point, Sweep, run_sweep
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.scene.presets import load_scene

SIZES = (10, 100, 1000, 10_000)


@pytest.mark.parametrize("exponent", [-1.0, 0.0, 0.5, 2.0])
def test_fit_recovers_a_power_law(exponent):
    law = 0.3 * np.array(SIZES, float) ** exponent
    fit = fit_exponent(SIZES, np.stack([law, 1.1 * law, 0.9 * law], 1))  # rounds of other speed, the same law
    assert fit["exponent"] == pytest.approx(exponent, abs=1e-12)  # rounding
    assert fit["standard_error"] < 1e-12  # rounding


def test_standard_error_covers_the_noise():
    """The fits' errors over their standard errors scatter as a t distribution with 2 degrees of freedom or narrower."""
    random, far, trials = np.random.default_rng(1), 0, 400
    for _ in range(trials):
        seconds = np.array(SIZES, float)[:, None] ** 0.8 * np.exp(0.05 * random.standard_normal((4, 1)))
        fit = fit_exponent(SIZES, seconds)
        far += abs(fit["exponent"] - 0.8) > 4.303 * fit["standard_error"]  # the 95 % limit of that t distribution
    # binomial(400, 0.05): mean 20, sigma 4.4; 5 sigma either way, failure chance below 1e-5
    assert 20 - 5 * 4.4 < far < 20 + 5 * 4.4 and far > 0


def test_standard_error_tells_of_a_law_that_is_no_power():
    sizes = np.array(SIZES, float)
    bent = (5 + 0.01 * sizes)[:, None] * np.ones(3)  # a fixed cost first, proportional later; rounds agree exactly
    straight = 0.01 * sizes[:, None] * np.ones(3)
    assert fit_exponent(SIZES, bent)["standard_error"] > 0.05 > 1e-12 > fit_exponent(SIZES, straight)["standard_error"]


def test_standard_error_of_two_sizes_is_the_rounds():
    seconds = np.array([[1.0, 1.0, 1.0], [2.0, 4.0, 8.0]])  # exponents 1, 2, 3 at sizes 1 and 2
    fit = fit_exponent((1, 2), seconds)
    assert fit["exponent"] == pytest.approx(2) and fit["standard_error"] == pytest.approx(1 / math.sqrt(3))
    assert math.isnan(fit_exponent((1, 2), seconds[:, :1])["standard_error"])


@pytest.mark.parametrize(
    "sizes, seconds", [((1,), [[1.0]]), ((2, 2), [[1.0], [1.0]]), ((1, 2), [1.0, 2.0]), ((1, 2), [[1.0], [0.0]])]
)
def test_fit_refuses_what_has_no_exponent(sizes, seconds):
    with pytest.raises(ValueError, match="must be") as refused:
        fit_exponent(sizes, seconds)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("quick", [True, False])
def test_sweeps_change_one_thing(device, quick):
    rays, screen, detector, cores = scaling.default_sweeps(device, quick)
    sphere = load_scene("sphere")
    assert {point.scene for point in rays.points} == {sphere} == {point.scene for point in cores.points}
    assert [p.size for p in rays.points] == [p.rays_per_pixel * 441 for p in rays.points]
    for sweep in (screen, detector, cores):  # the same rays in all, to the rounding of rays per pixel
        total = [p.rays_per_pixel * math.prod(p.scene.screen.pixels) for p in sweep.points]
        assert np.ptp(total) / total[0] < 0.001
    for sweep, grid in ((screen, lambda s: s.screen), (detector, lambda s: s.camera.detector)):
        assert [p.size for p in sweep.points] == [math.prod(grid(p.scene).pixels) for p in sweep.points]
        sides = [grid(p.scene).pixels[0] * grid(p.scene).pitch_mm for p in sweep.points]
        np.testing.assert_allclose(sides, grid(sphere).pixels[0] * grid(sphere).pitch_mm, rtol=1e-12)  # rounding
    assert [p.size for p in cores.points] == [p.cores for p in cores.points] and cores.points[0].cores == 1
    if device.kind == "cpu":
        assert cores.points[-1].cores == device.cl_device.max_compute_units
    if not quick:
        assert [round(math.log10(p.size), 2) for p in rays.points] == [6, 7, 8, 9, 10]


def test_a_tiny_sweep_on_the_device(device):
    sphere = load_scene("sphere")
    sweep = Sweep("rays", "rays", "tiny", tuple(Point(441 * n, sphere, n) for n in (64, 4096)))
    found = run_sweep(sweep, device, rounds=2)
    assert [point["rays"] for point in found["points"]] == [441 * 64, 441 * 4096]
    for point in found["points"]:
        for name in wall.TIMES:
            assert 0 < point[name]["lowest"] <= point[name]["median"] <= point[name]["highest"]
        assert point["kernel_seconds"]["median"] <= point["trace_seconds"]["median"] < point["total_seconds"]["median"]
    assert found["points"][1]["kernel_seconds"]["median"] > found["points"][0]["kernel_seconds"]["median"]  # 64 times
    assert found["exponents"].keys() == set(wall.TIMES)
    assert json.loads(json.dumps(found)) == found


def test_points_run_in_turn_and_a_failed_one_is_told(device):
    calls = []

    def timer(point, device):
        calls.append(point.size)
        if point.size == 2:
            raise DeviceError("does not fit")
        return {"rays": 10} | dict.fromkeys(wall.TIMES, point.size**2.0)

    sweep = Sweep("s", "u", "f", tuple(Point(n, load_scene("sphere"), 1) for n in (1, 2, 4)))
    found = run_sweep(sweep, device, 2, timer)
    assert calls == [1, 2, 4, 1, 4]
    assert found["points"][1] == {"size": 2, "skipped": "does not fit"}
    assert found["exponents"]["trace_seconds"]["exponent"] == pytest.approx(2)


def results_of(*sweeps):
    return {"cases": [], "device": {"name": "d", "platform": "p"}, "scaling": {"sweeps": list(sweeps)}}


def made_sweep(name, sizes, skipped=()):
    def timer(point, device):
        if point.size in skipped:
            raise DeviceError("does not fit")
        return {"rays": 100} | {time: (k + 1) * point.size**0.5 for k, time in enumerate(wall.TIMES)}

    points = tuple(Point(n, load_scene("sphere"), 1) for n in sizes)
    return run_sweep(Sweep(name, "u", "f", points, "by h"), None, 1, timer)


def test_table_has_every_point_and_the_exponents():
    shown = tables.bench_tables(results_of(made_sweep("a", (1, 4, 16), skipped=(4,)), made_sweep("b", (1,))))
    assert [table.title for table in shown] == ["scaling with a: f; by h", "scaling with b: f; by h"]
    assert all(len(row) == len(table.head) for table in shown for row in table.rows)
    assert [row[0] for row in shown[0].rows] == ["1", "4", "16", "exponent"]
    assert shown[0].rows[1][-1] == "does not fit"
    assert shown[0].rows[2][1:4] == ("4", "8", "12") and shown[0].rows[3][1] == "0.50"
    assert [row[0] for row in shown[1].rows] == ["1"]  # one point has no exponent


def test_figure_draws_every_sweep(tmp_path):
    results = results_of(made_sweep("a", (1, 4, 16)), made_sweep("b", (1, 2)), made_sweep("c", (2,), skipped=(2,)))
    panels = figures.scaling_figure(results).axes
    assert [axes.get_xscale() for axes in panels[:3]] == ["log", "log", "linear"]  # nothing to draw in the third
    drawn = panels[0].containers[0].lines[0].get_xydata()
    np.testing.assert_allclose(drawn, [[1, 1], [4, 2], [16, 4]])
    figures.write_figures(tmp_path, results | {"cases": [{"group": "g", "name": "n"} | dict.fromkeys(RATES, 1.0)]})
    assert (tmp_path / "bench_scaling.png").read_bytes().startswith(b"\x89PNG")


RATES = ("lowest", "rays_per_second", "highest")


def test_cores_are_limited_in_a_process_of_its_own(device, monkeypatch):
    most = device.cl_device.max_compute_units
    if device.kind != "cpu":
        with pytest.raises(DeviceError, match="only drivers for CPUs"):
            wall.time_on_cores("sphere", device, 64, 1)
        return
    found = wall.time_on_cores("sphere", device, 64, 1)
    assert found["rays"] == 441 * 64 and all(found[name] > 0 for name in wall.TIMES)
    monkeypatch.setattr(wall, "LIMITS", ("NO_DRIVER_READS_THIS",))
    with pytest.raises(DeviceError, match=f"has {most} compute units, asked for {most + 1}") as refused:
        wall.time_on_cores("sphere", device, 64, most + 1)
    assert "\n" not in str(refused.value)
