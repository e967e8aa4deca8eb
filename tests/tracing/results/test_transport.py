"""Results of a trace: the map of transport, light curves, the ledger. Maps made by hand, without a device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import coarse, with_part

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.opencl.structs import WEIGHT_ONE, Fate
from irtscots_cl.optics.chief_rays import trace_chief_rays as chief_rays
from irtscots_cl.optics.screen_windows import Windows, place_windows
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.screen_shape import ScanLines
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.results.transport import LineLight, Transport, ledger_from, line_flux
from irtscots_cl.tracing.trace import trace

SCENE = coarse("sphere", 3)
RAYS = np.array([10, 30, 20])
ROUNDING = 1e-13  # relative: sums of a few float64 numbers


def transport(estimator: str = "forward", sampler: str = "philox") -> Transport:
    """Two detector pixels, windows of 2 rows and 3 columns, three replicates of unequal size."""
    random = np.random.default_rng(8)
    counts = random.integers(0, 1000, (3, 2, 2, 3)).astype(np.uint64)
    unit_w = random.uniform(1e-9, 2e-9, (2, 1, 1) if estimator == "adjoint" else (2, 2, 3))
    windows = Windows(np.array([0, 4]), np.array([[0, 0], [4, 3]], np.int32), 2, 3)
    return Transport(SCENE, TraceOptions(estimator, sampler=sampler), {}, windows, counts, unit_w, RAYS,
                     {"launched": 540}, {})  # fmt: skip


def test_the_mean_flux_weighs_replicates_by_their_rays():
    run = transport()
    each = np.stack([run.flux_w(r) for r in range(3)])
    np.testing.assert_allclose(run.flux_w(), np.average(each, 0, RAYS), rtol=ROUNDING)
    np.testing.assert_allclose(each[1], run.counts[1] * run.unit_w / 30, rtol=ROUNDING)
    assert run.rays_total == 540 and run.replicates == 3


@pytest.mark.parametrize("estimator", ["forward", "adjoint"])
def test_light_curves_add_up_rows_or_columns_alike_with_and_without_brightness(estimator):
    """Without a brightness and with one factor per window, another way of adding up is taken."""
    run = transport(estimator)
    flux = np.stack([run.flux_w(r) for r in range(3)])
    ones = np.ones(SCENE.screen.pixels[::-1])
    for axis, summed in (("x", 2), ("y", 3)):
        for brightness in (None, ones):
            np.testing.assert_allclose(run.line_flux_w(axis, brightness), flux.sum(summed), rtol=ROUNDING)


def test_brightness_counts_where_the_windows_lie():
    run, brightness = transport(), np.zeros(SCENE.screen.pixels[::-1])
    brightness[4, 5] = 0.25  # row 1 and column 1 of the second pixel's window, beside the first's
    for axis, place in (("x", 1), ("y", 1)):
        curves = run.line_flux_w(axis, brightness)
        expected = np.zeros_like(curves)
        expected[:, 1, place] = [0.25 * run.flux_w(r)[1, 1, 1] for r in range(3)]
        np.testing.assert_allclose(curves, expected, rtol=ROUNDING)


def test_the_standard_error_is_that_of_the_replicates_scatter():
    run = transport()
    each = np.stack([run.flux_w(r) for r in range(3)])
    expected = np.sqrt(((each - run.flux_w()) ** 2).sum(0) / (3 * 2))
    np.testing.assert_allclose(run.standard_error_w(), expected, rtol=ROUNDING)
    single = replace(run, counts=run.counts[:1], rays=RAYS[:1])
    assert np.isnan(single.standard_error_w()).all()


def test_hits_are_counts_of_independent_rays():
    forward, adjoint = transport("forward"), transport("adjoint")
    np.testing.assert_array_equal(forward.hits(), forward.counts.sum((0, 2, 3)))
    np.testing.assert_allclose(adjoint.hits(), adjoint.counts.sum((0, 2, 3)) / WEIGHT_ONE, rtol=ROUNDING)
    assert np.isnan(transport("adjoint", "sobol").hits()).all()


def test_line_flux_adds_up_second_differences_in_twos_complement():
    random = np.random.default_rng(2)
    shape = {"x": (3, 7, 5), "y": (3, 7, 9)}
    light = {axis: random.integers(0, 2**62, size) for axis, size in shape.items()}
    second = [np.diff(np.pad(of, ((0, 0), (0, 0), (1, 2))), axis=-1) for of in light.values()]
    counts = np.concatenate(second, -1).view(np.uint64)
    assert counts.shape[-1] == 5 + 2 + 9 + 2 and (counts > 2**63).any()
    windows = replace(place_windows(chief_rays(coarse(load_scene("sphere"))), 1), columns=5, rows=9)
    unit, rays = random.random((7, 1)), np.array([1, 2, 5])
    flux = line_flux(counts, windows, unit, rays)
    for axis, of in light.items():
        np.testing.assert_allclose(flux[axis], of * unit / rays[:, None, None], rtol=1e-15)  # rounding


def test_light_curves_alone_know_no_brightness():
    windows = Windows(np.array([0]), np.zeros((1, 2), np.int32), 21, 21)
    flux = {axis: np.ones((1, 1, 21)) for axis in "xy"}
    for options, hits in ((TraceOptions("analytic"), np.inf), (TraceOptions(smoothing=True), np.nan)):
        run = LineLight(SCENE, options, {}, windows, flux, np.array([1]), {"launched": 0}, {})
        assert run.line_flux_w("y") is flux["y"]
        np.testing.assert_array_equal(run.hits(), [hits])
        with pytest.raises(ValueError, match="brightness: the analytic and the smoothed estimator"):
            run.line_flux_w("x", np.ones((21, 21)))


def test_the_ledger_names_every_fate_and_must_close():
    counts = np.arange(1, len(Fate) + 1)
    counts[Fate.OFF_WINDOW] = 0
    ledger = ledger_from(counts, int(counts.sum()))
    assert ledger.pop("launched") == counts.sum() and "off_window" not in ledger
    assert ledger == {fate.name.lower(): counts[fate] for fate in Fate if fate != Fate.OFF_WINDOW}
    with pytest.raises(AssertionError, match=f"{counts.sum() + 1} rays launched, {counts.sum()} accounted for"):
        ledger_from(counts, int(counts.sum()) + 1)
    counts[Fate.OFF_WINDOW] = 3  # counts as lost from the windows, not from the ledger
    assert "off_window" not in ledger_from(counts, int(counts.sum()))


@pytest.mark.parametrize("options", [{"estimator": "forward", "rays_per_pixel": 2**16}, {"rays_per_pixel": 4096},
                                     {"rays_per_pixel": 256, "smoothing": True}])  # fmt: skip
def test_lines_with_gaps_and_overlaps_agree_with_the_closed_form(device, options):
    """Lines of two and of three columns, three and two apart, by rays against the light's closed form.

    The difference over the standard error of 8 replicates is Student's t of 7, whose square has the mean 7/5 and the
    variance 7.84. Pixels have independent rays: their mean leaves six standard deviations less than once in 1e4.
    """
    for lines in (ScanLines(3, 2, 1), ScanLines(2, 3, 0)):
        scene = with_part(coarse("sphere-deviated", 15), "screen", pixels=(42, 42), pitch_mm=0.1, lines=lines)
        pattern = LineScan(scene)
        exact = trace(scene, estimator="analytic").images(pattern)
        run = trace(scene, device=device, seed=11, replicates=8, sampler="philox", **options).images(pattern)
        for of, found in ((exact.x, run.x), (exact.y, run.y)):
            middle = len(of.positions_mm) // 2
            truth, mean = of.image(middle), found.image(middle)
            error = found.image(middle, found.standard_error_w())
            lit = truth > 0.02 * truth.max()
            squares = ((truth - mean)[lit] / error[lit]) ** 2
            assert lit.sum() > 30 and np.mean(squares) < 1.4 + 6 * np.sqrt(7.84 / lit.sum())
            assert mean[lit].sum() == pytest.approx(truth[lit].sum(), rel=0.02)
