"""The parts of a height error: that they add up to it, and that each answers to its own cause alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from synthetic import small_scene

from irtscots_cl.analysis import error_terms as errorparts
from irtscots_cl.analysis.error_terms import error_terms, rounding_height_nm
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.optics.surface import Surface
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.trace import trace

RAYS = 256
SINGLE = TraceOptions("adjoint", "sobol", smoothing=True)


def run_of(scene, device, measure, precision="fp32", rays=RAYS, **options):
    options = {"sampler": "sobol", "precision": precision, "rays_per_pixel": rays, "replicates": 2} | options
    run = trace(scene, device=device, **options)
    return measure_by(measure, run.images(LineScan(scene)), scene.nominal()), run.options


def whole_error(result, scene):
    error = result.deviation_mm - Surface.of(scene.mirror).deviation_at(result.x_mm, result.y_mm)[0]
    return remove_terms(result.x_mm, result.y_mm, error, result.mask, "piston_tilt")


def by_name(parts):
    return {part.name: part for part in parts}


@pytest.fixture(scope="module")
def scene():
    return small_scene("sphere-deviated")


@pytest.fixture(scope="module")
def measured(scene, device):
    """By measure: result, options of the trace, and its parts."""
    found = {}
    for measure in ("paper", "fine", "refined"):
        result, options = run_of(scene, device, measure, smoothing=True)
        found[measure] = result, options, error_terms(result, scene, measure, options, device)
    return found


@pytest.mark.parametrize("measure", ["paper", "fine", "refined"])
def test_the_maps_add_up_to_the_whole_error(scene, measured, measure):
    result, _, parts = measured[measure]
    left = whole_error(result, scene) - sum(part.height_mm for part in parts)
    assert np.nanmax(np.abs(left)) < 1e-15  # mm: rounding of heights near 1 um, and of a sum of eight
    for part in parts:
        assert part.height_nm == pytest.approx(rms(part.height_mm, result.mask) * 1e6, rel=1e-12)  # rounding


def test_stages_come_in_the_order_of_the_measurement(measured, device):
    names = ["ray noise", *(["float rounding"] if device.has_fp64 else []), "line sampling", "height coupling",
             "pixel averaging", "edge pixels", "integration"]  # fmt: skip
    assert [part.name for part in measured["paper"][2]] == names
    assert [part.name for part in measured["refined"][2]] == [*names[: names.index("line sampling")],
                                                              "left by refinement"]  # fmt: skip


def test_a_better_measure_lowers_what_it_is_meant_to(measured):
    paper, fine, refined = (by_name(measured[name][2]) for name in ("paper", "fine", "refined"))
    for name, factor in (("line sampling", 5), ("pixel averaging", 5), ("integration", 20)):  # 8, 9, 30 measured
        assert fine[name].height_nm < paper[name].height_nm / factor, name
    assert refined["left by refinement"].height_nm < 0.02  # nm: as without rays, tests/test_refinement.py
    assert fine["ray noise"].height_nm == pytest.approx(refined["ray noise"].height_nm, rel=0.3)  # the same rays


def test_ray_noise_falls_with_the_rays_and_nothing_else_does(scene, device, measured):
    few = by_name(measured["paper"][2])
    result, options = run_of(scene, device, "paper", rays=16 * RAYS, smoothing=True)
    many = by_name(error_terms(result, scene, "paper", options, device))
    # 16^-0.7 = 0.14 for smoothed Sobol points; about 1000 pixels tell slopes to 3 %, heights to 30 %
    assert many["ray noise"].slope_urad[0] < 0.25 * few["ray noise"].slope_urad[0]
    for name in ("line sampling", "pixel averaging", "edge pixels", "integration"):
        assert many[name].height_nm == pytest.approx(few[name].height_nm, rel=1e-9), name  # no rays in them


def test_the_analytic_estimator_has_no_ray_noise_and_needs_no_device(scene):
    run = trace(scene, estimator="analytic")
    result = measure_by("paper", run.images(LineScan(scene)), scene.nominal())
    parts = by_name(error_terms(result, scene, "paper", run.options))
    assert parts["ray noise"].height_nm == 0.0 and parts["ray noise"].slope_urad == (0.0, 0.0)
    assert "float rounding" not in parts
    assert parts["line sampling"].height_nm > 0.1  # lines of 0.2 mm cost 1.5 nm at 9.6 mm, less where noise averages


def test_lines_half_as_wide_sample_better(scene):
    def sampling(pixels, pitch_mm):
        screen = dataclasses.replace(scene.screen, pixels=(pixels, pixels), pitch_mm=pitch_mm)
        finer = dataclasses.replace(scene, screen=screen)
        run = trace(finer, estimator="analytic")
        result = measure_by("paper", run.images(LineScan(finer)), finer.nominal())
        return by_name(error_terms(result, finer, "paper", run.options))["line sampling"].slope_urad[0]

    assert sampling(42, 0.1) < 0.25 * sampling(21, 0.2)  # as the 5/2 power of the width: 0.18


def test_the_stages_of_a_measure_without_pixel_average_are_freed_of_it(scene, measured, monkeypatch):
    """Left out where the parts are made, the stages would be those of another measure."""
    result, options, parts = measured["fine"]
    monkeypatch.setattr(errorparts, "deconvolve_pixel", lambda values, mask: values)
    wrong = by_name(error_terms(result, scene, "fine", options))
    assert wrong["pixel averaging"].height_nm > 3 * by_name(parts)["pixel averaging"].height_nm  # 9 measured


def test_pixels_without_a_closed_form_have_a_part_of_their_own(device):
    """A screen so low that it cuts the light of some pixels along y, which a scan along x does not show."""
    scene = small_scene("sphere-deviated")
    offset = (0.0, 0.6)
    scene = dataclasses.replace(scene, screen=dataclasses.replace(scene.screen, centre_offset_mm=offset))
    result, options = run_of(scene, device, "paper")
    free = trace(scene, estimator="analytic")
    lost = np.setdiff1d(np.flatnonzero(result.mask), free.windows.pixels[free.flux_w["x"][0].sum(-1) > 0])
    if not lost.size:
        pytest.skip("every pixel that can be used has a closed form")
    parts = error_terms(result, scene, "paper", options, device)
    assert parts[-1].name == "pixels without a closed form"
    left = whole_error(result, scene) - sum(part.height_mm for part in parts)
    assert np.nanmax(np.abs(left)) < 1e-15  # mm, rounding as above


def test_rounding_is_told_where_there_is_a_double_to_compare_with(scene, device, measured):
    result, options, parts = measured["paper"]
    assert rounding_height_nm(result, scene, TraceOptions("forward"), device) == 0.0
    assert rounding_height_nm(result, scene, TraceOptions(precision="fp64"), device) == 0.0
    if device.has_fp64:
        told = rounding_height_nm(result, scene, options, device)
        assert told == by_name(parts)["float rounding"].height_nm
        assert 1e-4 < told < 0.2  # nm: 0.02 at 9.6 mm pixels; ulps of the screen's 218 mm are 2e-9 rad
