"""The report of a run: its keys, its sums, its tables and its page."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from synthetic import noise_free_stack, small_scene, with_replicates

from irtscots_cl.analysis.comparison import compare
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.measurement.prediction import predict_error
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.report.facts import build_report, path_facts
from irtscots_cl.report.quality import fit_facts, island_facts, misfit_facts, quality_warnings
from irtscots_cl.report.tables import cautions, island_tables, measured_tables, path_tables, summary_tables
from irtscots_cl.system.atomic_files import plain
from irtscots_cl.system.versions import versions
from irtscots_cl.tracing.options import TraceOptions
from irtscots_cl.tracing.results.paths import LostFlux, PathFlux, PathLight
from irtscots_cl.tracing.results.transport import Transport

CONTRACT = {
    "scene",
    "device",
    "estimator",
    "sampler",
    "seed",
    "rays_total",
    "rays_per_second",
    "seconds",
    "ledger",
    "pixels_used",
    "slope_error_urad_rms",
    "height_error_nm_rms",
    "height_standard_error_nm",
    "zernike",
}
MORE = {
    "smoothing",
    "error_parts",
    "measure",
    "refinement_updates_nm",
    "refinement_converged",
    "pixels_with_traced_light",
    "pixels_without_model",
    "precision",
    "aim",
    "overfill",
    "replicates",
    "versions",
    "rays_per_pixel",
    "light_curves_refused",
    "predicted",
    "slope_error_urad_rms_standard_error",
    "height_error_nm_rms_standard_error",
    "zernike_fit",
    "islands",
    "integration_misfit",
    "warnings",
}
FATES = [
    "launched",
    "detected",
    "missed_mirror",
    "clipped",
    "off_detector",
    "off_screen",
    "absorbed",
    "failed",
]
LEDGER = dict(zip(FATES, (1000, 900, 50, 20, 10, 15, 3, 2), strict=True))
SECONDS = {"build": 0.5, "trace": 0.25, "reconstruct": 0.1, "total": 0.9}
DEVICE = {"index": "0:0", "name": "A <b>device</b> [bold]", "driver": "OpenCL 1.2 / 3"}


def made(replicates: int = 3):
    """Stack, result, comparison and report of images without a device, one pixel dead."""
    scene = small_scene()
    stack = noise_free_stack(scene)
    if replicates > 1:
        stack = with_replicates(stack, replicates, 0.01)
    flux = stack.x.flux_w.copy()
    flux[:, 20 * 41 + 20] = 0.0
    stack = ImageStack(dataclasses.replace(stack.x, flux_w=flux), stack.y)
    result = reconstruct(stack, scene.nominal())
    comparison = compare(result, scene)
    none = np.zeros(0)
    transport = Transport(
        scene,
        TraceOptions(seed=7),
        DEVICE,
        none,
        none,
        none,
        np.full(replicates, 100),
        LEDGER,
        {},
    )
    report = build_report(transport, "paper", result, comparison, predict_error(result, stack), (), SECONDS)
    return stack, result, comparison, report


@pytest.fixture(scope="module")
def run():
    return made()


@pytest.fixture(scope="module")
def report(run):
    return run[3]


def test_the_report_has_the_keys_that_others_rely_on(report):
    assert set(report) == CONTRACT | MORE
    assert set(report["seconds"]) == {"build", "trace", "reconstruct", "total"}
    assert list(report["ledger"]) == FATES
    assert set(report["slope_error_urad_rms"]) == {"x", "y"}
    assert set(report["height_error_nm_rms"]) == {"piston", "piston_tilt", "piston_tilt_power"}
    assert all(
        set(row) == {"noll", "input_um", "output_um", "standard_error_um", "expected_um", "inflation"}
        for row in report["zernike"]
    )
    assert {"index", "name", "driver"} <= set(report["device"])
    assert set(report["versions"]) == {"irtscots-cl", "pyopencl", "numpy", "scipy"} == set(versions())


def test_the_report_s_numbers_are_the_run_s(run, report):
    _, result, comparison, _ = run
    assert (report["scene"], report["seed"], report["estimator"]) == ("sphere-deviated", 7, "adjoint")
    assert report["rays_total"] == LEDGER["launched"] == sum(LEDGER[fate] for fate in FATES[1:])
    assert report["rays_per_second"] == LEDGER["launched"] / SECONDS["trace"]
    assert (report["replicates"], report["rays_per_pixel"]) == (3, 300)
    assert report["pixels_used"] == result.mask.sum() == result.on_mirror.sum() - 1
    assert report["light_curves_refused"] == {
        "empty": 1,
        "stray": 0,
        "saturated": 0,
        "masked": 0,
        "clipped": 0,  # pixels beside the mirror are not refused
    }
    assert report["slope_error_urad_rms"]["x"] == comparison.slope_error_urad["x"].value
    assert report["height_error_nm_rms"]["piston_tilt"] == comparison.height_error_nm["piston_tilt"].value
    assert [row["noll"] for row in report["zernike"]] == list(range(1, 46))


def test_predictions_are_in_the_units_that_they_are_named_after(run, report):
    stack, result, _, _ = run
    predicted = predict_error(result, stack)
    assert predicted.ray_noise_slope[0] > 0  # no ray counts here, so from the scatter of the exposures
    assert report["predicted"] == {
        "slope_error_urad_rms": {"x": predicted.slope[0] * 1e6, "y": predicted.slope[1] * 1e6},
        "slope_ray_noise_urad_rms": {
            "x": predicted.ray_noise_slope[0] * 1e6,
            "y": predicted.ray_noise_slope[1] * 1e6,
        },
        "slope_line_sampling_urad_rms": {
            "x": predicted.line_sampling_slope[0] * 1e6,
            "y": predicted.line_sampling_slope[1] * 1e6,
        },
        "height_error_nm_rms_piston_tilt": predicted.height_mm * 1e6,
        "height_ray_noise_nm_rms": predicted.ray_noise_height_mm * 1e6,
        "height_line_sampling_nm_rms": predicted.line_sampling_height_mm * 1e6,
        "height_systematic_nm_rms": predicted.systematic.height_mm * 1e6,
        "height_rounding_nm_rms": 0.0,
        "bound": "",
    }


def test_what_should_be_known_of_a_result_is_said(report):
    assert cautions(report) == []
    doubtful = report | {
        "pixels_without_model": 7,
        "refinement_converged": False,
        "refinement_updates_nm": [1.5, 0.3, 0.31],
        "precision": "fp32",
        "predicted": report["predicted"] | {
            "height_ray_noise_nm_rms": 0.3, "height_systematic_nm_rms": 0.4, "height_rounding_nm_rms": 3.6,
            "bound": "pixels without a model",
        },
    }  # fmt: skip
    model, refinement, rounding, bound = cautions(doubtful)
    assert model.startswith(f"7 of {report['pixels_used']} pixels have no model of their light")
    assert refinement == "the refinement has not converged: its rounds changed 1.5, 0.3, 0.31 nm rms"
    assert "single precision adds 3.6 nm rms to the height, all other errors 0.5 nm" in rounding
    assert bound == "the predicted height error is a bound, no estimate: pixels without a model"
    assert cautions(doubtful | {"precision": "fp64"}) == [model, refinement, bound]


def test_pixels_without_a_closed_form_are_counted_in_the_table(report):
    assert "without a closed form" not in dict(summary_tables(report)[0].rows)
    some = report | {"pixels_with_traced_light": 1200, "pixels_without_model": 3}
    assert dict(summary_tables(some)[0].rows)["without a closed form"] == "1,200 traced light, 3 no model"


def test_the_report_is_json_and_what_does_not_exist_is_null():
    single = made(replicates=1)[3]
    data = json.loads(json.dumps(plain(single), allow_nan=False))
    assert data["height_standard_error_nm"] is None
    assert data["slope_error_urad_rms_standard_error"] == {"x": None, "y": None}
    assert data["zernike"][5]["standard_error_um"] is None
    assert data["slope_error_urad_rms"]["x"] == single["slope_error_urad_rms"]["x"]


def test_the_tables_say_everything_once_with_units(report):
    run_table, errors, zernike = summary_tables(report)
    facts = dict(run_table.rows)
    assert facts["rays"] == "1,000"
    assert facts["ledger"] == (
        "detected 900, missed mirror 50, clipped 20, off detector 10, off screen 15, absorbed 3, failed 2"
    )
    assert facts["pixels used"] == f"{report['pixels_used']:,}, not used: 1 empty"
    assert [row[0] for row in errors.rows] == [
        "slope x [urad]",
        "slope y [urad]",
        "height without piston [nm]",
        "height without piston, tilt [nm]",
        "height without piston, tilt, power [nm]",
    ]
    assert [row[0] for row in zernike.rows] == ["6", "8", "9", "11", "29", "38"]  # those that the scene has
    for table in (run_table, errors, zernike):
        assert all(len(row) == len(table.head) for row in table.rows)


def test_a_mirror_without_deviation_has_no_table_of_coefficients(report):
    plain_mirror = report | {"zernike": [row | {"input_um": 0.0} for row in report["zernike"]]}
    assert len(summary_tables(plain_mirror)) == 2


CHECK = {"name": "saturation", "level": "ok", "value": 0.0, "limit": 0.0, "false_alarm": 1e-6, "text": "none"}


MEASURED = {
    "scene": "a",
    "pixels_used": 9000,
    "light_curves_refused": {},
    "pixels_with_traced_light": 0,
    "pixels_without_model": 0,
    "deviation_nm_rms": {"piston": 384.12, "piston_tilt": 1.0},
    "deviation_nm_pv": 12.5,
    "integration_misfit": {"urad_rms": 0.5, "noise_urad_rms": math.nan, "systematic_urad_rms": 0.0,
                           "limit_urad_rms": 0.25, "suspicious": True},
    "islands": {"count": 1, "groups": 1},
    "zernike": [{"noll": 4, "output_um": 0.25, "standard_error_um": 0.001, "inflation": 1.0},
                {"noll": 5, "output_um": 0.001, "standard_error_um": 0.001, "inflation": 1.0}],
    "zernike_fit": {"kind": "annular", "obscuration_ratio": 0.3, "condition": 1.1, "residual_nm_rms": 2.0,
                    "standard_errors_from": "misfit"},
}  # fmt: skip


def test_a_measurement_s_tables():
    facts = MEASURED | {
        "light_curves_refused": {"empty": 0, "clipped": 12},
        "height_standard_error_nm": math.nan,
        "checks": [{"name": "integration misfit", "level": "warning", "text": "much"},
                   {"name": "islands", "level": "ok", "text": ""}],
    }  # fmt: skip
    deviation, zernike, checks = measured_tables(facts)
    assert deviation.rows == [
        ("pixels used", "9,000, not used: 12 clipped"),
        ("without piston [nm]", "384.1"),
        ("without piston, tilt [nm]", "1"),
        ("peak to valley, without piston, tilt [nm]", "12.5"),
        ("slopes of no surface", "0.5 urad (limit 0.25)"),
    ]
    assert zernike.title == "Zernike coefficients (annular, hole 0.3)"
    assert zernike.rows == [
        ("4", "0.25 +- 0.001"),
        ("1 others", "below 3 standard errors; all with --json"),
        ("errors from", "misfit"),
        ("condition", "1.1"),
        ("left by the fit", "2 nm rms"),
    ]
    assert checks.rows == [("integration misfit", "warning", "much")] and "1 passed" in checks.title


def in_halves(gap: int):
    """A result of images whose middle columns are dark, and its scene."""
    scene = small_scene()
    stack = noise_free_stack(scene)
    dark = np.abs(np.arange(41 * 41) % 41 - 20) <= gap
    scans = (dataclasses.replace(s, flux_w=np.where(dark[None, :, None], 0, s.flux_w)) for s in (stack.x, stack.y))
    return reconstruct(ImageStack(*scans), scene.nominal()), scene


def test_islands_that_are_joined_are_told_with_their_errors():
    result, scene = in_halves(0)
    facts = island_facts(result, compare(result, scene).error_mm)
    assert (facts["count"], facts["groups"], facts["pixels_alone"]) == (2, 1, 0)
    assert facts["pixels_in_heights"] == result.pixels_used
    first, second = facts["largest"]
    assert first["piston_known"] and first["piston_standard_error_nm"] == 0
    assert second["piston_known"] and 0 < second["piston_standard_error_nm"] < 20
    assert facts["own_pistons_nm_rms"] == pytest.approx(compare(result, scene).height_error_nm["piston_tilt"].value)
    (table,) = island_tables(facts)
    assert "2 islands in 1 joined group," in table.title and len(table.rows) == 2
    fit, misfit = fit_facts(compare(result, scene).zernike_fit), misfit_facts(result.misfit())
    assert quality_warnings(facts, misfit, fit, False) == []


def test_pistons_that_are_unknown_are_told():
    result, scene = in_halves(7)
    facts = island_facts(result, compare(result, scene).error_mm)
    assert (facts["count"], facts["groups"]) == (2, 2)
    assert facts["pixels_in_heights"] == facts["largest"][0]["pixels"] < result.pixels_used
    assert not facts["largest"][1]["piston_known"] and np.isnan(facts["largest"][1]["piston_standard_error_nm"])
    assert island_tables(facts)[0].rows[1][3] == "unknown"
    fit, misfit = fit_facts(compare(result, scene).zernike_fit), misfit_facts(result.misfit())
    text = "\n".join(quality_warnings(facts, misfit, fit, True))
    assert "2 islands in 2 groups whose pistons against each other are unknown" in text
    assert fit["dropped"] and f"from Noll {fit['dropped'][0]} on (--zernike annular can): left out" in text
    suspicious = misfit | {"suspicious": True, "urad_rms": 5.0, "limit_urad_rms": 1.0}
    told = quality_warnings(facts, suspicious, fit, False)
    assert "5 urad rms of the slopes belong to no surface (limit 1)" in told[1] and len(told) == 3


def test_terms_that_cannot_be_told_apart_have_no_number(report):
    rows = [row for row in report["zernike"] if row["noll"] <= 8]
    lost = {"noll": 38, "input_um": 0.1, "output_um": np.nan, "standard_error_um": np.nan, "expected_um": np.nan,
            "inflation": np.inf}  # fmt: skip
    moved = [row | {"expected_um": row["input_um"] + 0.01} for row in rows]
    table = summary_tables(report | {"zernike": [*moved, lost]})[-1]
    assert table.head == ("term", "in [um]", "of it over the pixels [um]", "out [um]", "difference [nm]")
    assert table.rows[-1] == ("38", "0.1000", "-", "not separable", "-")


def test_a_measurement_s_table_with_error_bars_and_failed_checks():
    facts = MEASURED | {
        "height_standard_error_nm": 1.2345,
        "slope_standard_error_urad": {"x": 0.05678, "y": 0.06},
        "of_bound": {"x": 1.0123, "y": 1.1},
        "checks": [CHECK, CHECK | {"name": "gains x", "level": "warning", "text": "frame 3 is dark"}],
    }
    table, _, checks = measured_tables(facts)
    assert table.rows[4:-1] == [
        ("standard error of the height [nm]", "1.23"),
        ("standard error of the slopes [urad]", "0.0568, 0.06"),
        ("centroids' error / Cramer-Rao bound", "1.01, 1.1"),
    ]
    assert checks.rows == [("gains x", "warning", "frame 3 is dark")]
    assert "1 passed" in checks.title


def test_paths_with_their_focus_and_blur():
    """Lengths to a micrometre, no minus before a zero, nothing where there is none."""
    paths = (
        PathFlux("screen > mirror > lens > detector", "direct", 2.0, 0.01, 900, -2e-7, 1e-8),
        PathFlux("screen > mirror > plate (r) > lens > detector", "ghost", 0.5, 0.01, 50, -14.71418, 5.0923),
        PathFlux("other", "other", 0.1, 0.01, 7),
    )
    light = PathLight(small_scene(), TraceOptions("nonsequential"), DEVICE, paths,
                      (LostFlux("absorbed by stop", 7.0, 0.02), LostFlux("escaped", 0.0, 0.0)), 9.6,
                      np.zeros((3, 3, 2, 1)), np.full(3, 100),
                      {"launched": 1000, "parted": 0, "detected": 957, "escaped": 0, "absorbed by stop": 43}, LEDGER,
                      SECONDS)  # fmt: skip
    facts = plain(path_facts(light, ()))
    assert [(path["focus_mm"], path["blur_mm"]) for path in facts["paths"]] == [
        (-2e-7, 1e-8), (-14.71418, 5.0923), (None, None)
    ]  # fmt: skip
    table, ends = path_tables(path_facts(light, ()))
    assert table.head == ("path", "kind", "flux [W]", "of direct", "rays", "focus [mm]", "blur [mm]")
    absorbed = ("absorbed by stop", "43", "7 +- 0.02")
    assert ends.rows == [("launched", "1,000", "9.6"), ("detected", "957", "2.6"), absorbed]
    assert [row[-2:] for row in table.rows] == [("0.000", "0.000"), ("-14.714", "5.092"), ("", "")]
