"""The whole way on the device: scene to measured mirror, against truth and predicted error."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from synthetic import small_scene

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement.reconstruction import reconstruct
from irtscots_cl.pipeline.measure import measure
from irtscots_cl.pipeline.output import write_run
from irtscots_cl.pipeline.simulate import simulate
from irtscots_cl.scene.mirror import ZernikeTerms
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.results.transport import LineLight


@pytest.fixture(scope="module")
def deviated(device):
    """The deviated sphere with 65,536 rays per detector pixel: a few seconds on two cores."""
    return simulate(load_scene("sphere-deviated"), device=device, estimator="adjoint", rays_per_pixel=65_536, seed=1)


def urad(run, axis) -> float:
    return run.comparison.slope_error_urad[axis].value


def test_the_deviated_sphere_is_measured_to_nanometres(deviated):
    """Ray noise 0.12 urad and 0.95 nm, sampling 0.095 urad and 1.45 nm: 0.155 urad and 1.7 nm together."""
    assert deviated.result.pixels_used > 9700  # the mirror's image spans about 111 pixels
    for axis in ("x", "y"):
        assert 0.12 < urad(deviated, axis) < 0.2  # urad: the sum above and a third
    assert deviated.comparison.height_error_nm["piston_tilt"].value < 2.5  # nm: the sum above and half


def test_the_six_coefficients_come_out(deviated):
    given = load_scene("sphere-deviated").mirror.zernike[0].coefficients_um
    found = {row.noll: row for row in deviated.comparison.zernike}
    for noll, value in given.items():
        assert found[noll].input_um == value
        assert found[noll].output_um == pytest.approx(
            value,
            abs=1.5e-3,  # um: as the height error, in one term
        )
        assert 0 < found[noll].standard_error_um < 5e-4  # um: the part that rays make
    others = [row.output_um for row in found.values() if row.noll > 3 and row.noll not in given]
    assert max(np.abs(others)) < 1.5e-3  # um: the same for terms that are not there


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_slope_error_is_the_predicted_one(deviated, axis):
    predicted = deviated.report["predicted"]["slope_error_urad_rms"][axis]
    # the rms over 9800 pixels has 0.7 %; the rest is for the profile's local linear map
    assert urad(deviated, axis) == pytest.approx(predicted, rel=0.05)


def test_the_height_error_is_the_predicted_one(deviated):
    predicted = deviated.report["predicted"]["height_error_nm_rms_piston_tilt"]
    actual = deviated.comparison.height_error_nm["piston_tilt"].value
    # ray noise is a third of the square and one draw of it scatters by 7 %; neighbours' sampling errors agree
    assert actual == pytest.approx(predicted, rel=0.15)


def test_the_height_s_standard_error_is_the_predicted_ray_noise(deviated):
    predicted = deviated.report["predicted"]["height_ray_noise_nm_rms"]
    # 7 % for one set of eight replicates, 1.3 % for the prediction's draws: 4 sigma, chance 6e-5
    assert deviated.comparison.height_standard_error_nm == pytest.approx(predicted, rel=0.28)


def test_the_ledger_closes_and_the_mean_flux_is_the_scene_s(deviated):
    report = deviated.report
    assert sum(count for fate, count in report["ledger"].items() if fate != "launched") == report["rays_total"]
    assert report["rays_total"] == 65_536 * len(deviated.transport.windows.pixels)
    centre = sum(deviated.stack.x.image(line)[62, 62] for line in range(21))
    assert centre == pytest.approx(4.168e-6, rel=1e-3)  # W, paper-sized scene; all rays of this pixel arrive


def test_a_truth_that_is_not_told_changes_nothing(deviated):
    """The same images, measured with the design of a scene that claims another deviation."""
    scene = load_scene("sphere-deviated")
    claimed = ZernikeTerms(radius_mm=532.0, ordering="noll", coefficients_um={5: 0.7, 12: -0.2})
    other = dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, zernike=(claimed,)))
    again = reconstruct(deviated.transport.images(LineScan(other)), other.nominal())
    for name in ("slope_x", "slope_y", "height_mm", "jackknife_deviation_mm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(deviated.result, name))


def test_the_same_seed_gives_the_same_result_and_another_an_independent_one(device):
    scene = load_scene("sphere")
    runs = [simulate(scene, device=device, rays_per_pixel=64, replicates=2, seed=seed).result for seed in (3, 3, 4)]
    one, same, other = runs
    np.testing.assert_array_equal(one.deviation_mm, same.deviation_mm)
    np.testing.assert_array_equal(one.jackknife_slope_x, same.jackknife_slope_x)
    # Two independent errors of 3.85 urad each: sqrt(2) of it. 4 sigma of the rms over 9800 pixels are 3 %.
    assert rms(one.slope_x - other.slope_x, one.mask) * 1e6 == pytest.approx(3.85 * np.sqrt(2), rel=0.03)


def test_the_paper_s_estimator_agrees_with_its_own_prediction(device):
    """156,250 rays per screen pixel, all of them aimed at the mirror."""
    run = simulate(load_scene("sphere-deviated"), device=device, estimator="forward", rays_per_pixel=156_250, seed=2)
    predicted = run.report["predicted"]["slope_error_urad_rms"]
    for axis in ("x", "y"):
        assert predicted[axis] == pytest.approx(1.76, rel=0.03)  # 0.2566 mm / sqrt(305 hits) / 8333 mm
        # 0.7 % of the rms over 9800 pixels, as much for the counts it is predicted from: 4 sigma, chance 6e-5
        assert urad(run, axis) == pytest.approx(predicted[axis], rel=0.04)
    assert run.report["rays_total"] == 156_250 * 441


@pytest.mark.slow
def test_the_off_axis_segment_is_measured_as_predicted(device):
    run = simulate(load_scene("off-axis"), device=device, rays_per_pixel=4096, seed=1)
    predicted = run.report["predicted"]["slope_error_urad_rms"]
    for axis in ("x", "y"):
        # 0.7 % of the rms over 8900 pixels; pixel averaging, 0.15 urad along x, is not predicted: 3 %
        assert urad(run, axis) == pytest.approx(predicted[axis], rel=0.10)
    assert run.result.pixels_used > 8500
    assert sum(run.result.refused().values()) < 20  # the screen is just large enough for the light


def test_an_argument_out_of_range_is_refused(device):
    with pytest.raises(ValueError, match="replicates = 0: must be 1 to 1024"):
        simulate(load_scene("sphere"), device=device, replicates=0)


def test_progress_reaches_the_total(device):
    seen = []
    simulate(load_scene("sphere"), device=device, rays_per_pixel=64, progress=lambda *numbers: seen.append(numbers))
    assert seen[-1][0] == seen[-1][1] == 64 * 10_043 and seen == sorted(seen)


@pytest.mark.parametrize("sampler", ["sobol", "lattice"])
def test_even_samplers_have_less_noise_and_it_is_predicted_from_their_replicates(device, sampler):
    run = simulate(load_scene("sphere-deviated"), device=device, sampler=sampler, rays_per_pixel=2048, seed=2)
    predicted, actual = run.report["predicted"], run.report["slope_error_urad_rms"]
    for axis in ("x", "y"):
        # Poisson noise would be 0.2566 mm / sqrt(2048 rays) / 8333.5 mm = 0.68 urad
        assert predicted["slope_ray_noise_urad_rms"][axis] < 0.34  # half of it: the smallest gain seen is 3
        # jackknife of 8 replicates over 9,796 pixels: 0.3 % of scatter; the rest is line sampling, known to 2 %
        assert predicted["slope_error_urad_rms"][axis] == pytest.approx(actual[axis], rel=0.05)
    assert np.isnan(run.stack.x.hits).all() and np.isnan(run.stack.y.hits).all()


def test_an_old_report_does_not_vouch_for_a_rerun_that_failed(device, monkeypatch, tmp_path):
    run = simulate(load_scene("sphere"), device=device, rays_per_pixel=64, replicates=2, seed=1)
    (tmp_path / "report.json").write_text("{}")
    full = lambda *_: (_ for _ in ()).throw(OSError("disk full"))  # noqa: E731
    for module in ("output", "measure"):
        monkeypatch.setattr(f"irtscots_cl.pipeline.{module}.write_result", full)
    with pytest.raises(OSError, match="disk full"):
        write_run(run, tmp_path)
    assert not (tmp_path / "report.json").exists()
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(OSError, match="disk full"):
        measure(run.stack, run.transport.scene.nominal(), tmp_path)
    assert not (tmp_path / "report.json").exists()


# --- light in closed form, smoothed rays, ways to measure ------------------------------------------------------


@pytest.fixture(scope="module")
def analytic():
    """The deviated sphere without noise: by no device."""
    return simulate(load_scene("sphere-deviated"), estimator="analytic")


def test_without_noise_the_error_is_the_predicted_systematic_one(analytic):
    predicted = analytic.report["predicted"]
    assert predicted["slope_ray_noise_urad_rms"] == {"x": 0.0, "y": 0.0}
    assert predicted["height_ray_noise_nm_rms"] == 0.0
    for axis in ("x", "y"):
        line_sampling = predicted["slope_line_sampling_urad_rms"][axis]
        assert line_sampling == pytest.approx(0.095, rel=0.02)  # urad, as on the paper's sphere
        # averaging over pixels of 9.6 mm and the deviation's part of the profile come on top
        assert urad(analytic, axis) == pytest.approx(line_sampling, rel=0.05)
        assert urad(analytic, axis) == pytest.approx(predicted["slope_error_urad_rms"][axis], rel=0.01)
    actual = analytic.report["height_error_nm_rms"]["piston_tilt"]
    # the measured surface stands for the true one: its error differs by a few percent of itself
    assert actual == pytest.approx(predicted["height_error_nm_rms_piston_tilt"], rel=0.03)
    assert predicted["height_systematic_nm_rms"] == predicted["height_error_nm_rms_piston_tilt"]
    assert predicted["height_rounding_nm_rms"] == 0.0 and predicted["bound"] == ""


def test_without_noise_the_report_says_so(analytic):
    report = analytic.report
    assert isinstance(analytic.transport, LineLight)
    assert (report["estimator"], report["device"]["kind"], report["replicates"]) == ("analytic", "host", 1)
    assert (report["smoothing"], report["measure"], report["refinement_updates_nm"]) == (False, "paper", [])
    assert np.isnan(report["height_standard_error_nm"])
    assert sum(count for fate, count in report["ledger"].items() if fate != "launched") == report["rays_total"]
    assert np.isinf(analytic.stack.x.hits).all()


def test_its_flux_is_that_of_rays(analytic, deviated):
    for pixel in ((62, 62), (40, 80)):
        by_rays, closed = (sum(run.stack.x.image(line)[pixel] for line in range(21)) for run in (deviated, analytic))
        # all rays of these pixels arrive; the curvature of cos^4 over a pixel, (0.037 / 16)^2 / 3, is left out: 1.8e-6
        assert closed == pytest.approx(by_rays, rel=3e-6)


def test_a_fine_measure_has_neither_sampling_nor_integration_error(analytic):
    fine = simulate(load_scene("sphere-deviated"), estimator="analytic", measure="fine")
    assert fine.report["measure"] == "fine" and fine.result.method == "cubic"
    assert fine.report["predicted"]["slope_line_sampling_urad_rms"] == {"x": 0.0, "y": 0.0}  # it is modelled
    nm = [run.report["height_error_nm_rms"]["piston_tilt"] for run in (analytic, fine)]
    assert nm[0] > 1.2 and nm[1] < 0.05  # nm: sampling by lines; 0.015 of the profiles that a deviation changes


def test_smoothed_rays_are_measured_with_the_error_their_replicates_tell(device):
    scene = small_scene("sphere-deviated")
    options = {"device": device, "rays_per_pixel": 1024, "seed": 3}
    smooth, rough = (simulate(scene, smoothing=on, **options) for on in (True, False))
    assert smooth.report["smoothing"] is True and isinstance(smooth.transport, LineLight)
    assert np.isnan(smooth.stack.x.hits).all()  # no number of independent rays has their noise
    for axis in ("x", "y"):
        noise, of_rough = (run.report["predicted"]["slope_ray_noise_urad_rms"][axis] for run in (smooth, rough))
        assert noise < 0.75 * of_rough  # the aperture's part of the noise goes, that of pixels of 29 mm stays
        free = simulate(scene, estimator="analytic").result
        found = rms(getattr(smooth.result, f"slope_{axis}") - getattr(free, f"slope_{axis}"), free.mask) * 1e6
        # 1049 pixels tell the rms to 2.2 %, 8 replicates of each the prediction to 0.9 %: 4 sigma, chance 6e-5
        assert found == pytest.approx(noise, rel=0.10)


def test_an_unknown_measure_is_refused():
    with pytest.raises(ValueError, match=r"measure = 'finest': must be one of paper, fine, refined"):
        simulate(small_scene("sphere", 25), estimator="analytic", measure="finest")


@pytest.mark.parametrize("how", ["paper", "fine", "refined"])
def test_images_alone_are_measured_as_a_simulation_s(how, tmp_path):
    run = simulate(small_scene("sphere-deviated", 25), estimator="analytic", measure=how)
    facts = measure(run.stack, run.transport.scene.nominal(), tmp_path, how=how)
    assert facts["measure"] == how
    for key in ("refinement_updates_nm", "pixels_used", "light_curves_refused", "scene"):
        assert facts[key] == run.report[key]
    assert len(facts["refinement_updates_nm"]) in ((2, 3, 4) if how == "refined" else (0,))  # until it changes nothing
    assert list(facts["deviation_nm_rms"]) == ["piston", "piston_tilt", "piston_tilt_power"]


def test_a_run_without_a_device_is_written_whole(tmp_path):
    run = simulate(small_scene("sphere-deviated", 25), estimator="analytic", measure="refined")
    write_run(run, tmp_path)
    report = json.loads((tmp_path / "report.json").read_text(), parse_constant=pytest.fail)
    assert report["refinement_updates_nm"] == list(run.result.updates_nm)
    assert report["height_standard_error_nm"] is None  # no replicates, no error bar
    assert (tmp_path / "report.html").stat().st_size > 1000 and (tmp_path / "result.h5").is_file()
