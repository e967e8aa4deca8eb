"""Runs with the noise of a camera and a screen, from the scene to the measured mirror."""

from __future__ import annotations

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from loaded_modules import loaded_modules
from scenes import coarse, with_part

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.imaging.recording import record
from irtscots_cl.pipeline.noise import check_noise
from irtscots_cl.pipeline.output import write_run
from irtscots_cl.pipeline.simulate import simulate
from irtscots_cl.pipeline.target import run_to_target
from irtscots_cl.scene.detector_noise import DetectorNoise
from irtscots_cl.scene.instrument import Detector
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.scene.screen_response import ScreenResponse
from irtscots_cl.tracing.trace import trace

SCENE = coarse("sphere-deviated", 25)
NOISE = DetectorNoise(electrons_at_peak=1e6, shot_noise=True, read_noise_e=5.0, offset_dn=0.0, exposures=4)
UNEVEN = ScreenResponse(brightness_polynomial=(0.05, 0.0, -0.1, 0.0, 0.0), dead_columns=(2,))


def with_noise(scene: Scene, noise=None, response=None) -> Scene:
    detector = scene.camera.detector
    scene = with_part(scene, "camera", detector=Detector(detector.pixels, detector.pitch_mm, noise))
    return with_part(scene, "screen", response=response)


def assert_same_images(one, two):
    for axis in ("x", "y"):
        first, second = getattr(one, axis), getattr(two, axis)
        np.testing.assert_array_equal(first.flux_w, second.flux_w)
        np.testing.assert_array_equal(first.first_line, second.first_line)
        assert (first.unit, first.saturation_w) == (second.unit, second.saturation_w)


# --- off ----------------------------------------------------------------------------------------------------


def test_tables_with_every_effect_off_give_the_bits_of_the_plain_run():
    plain = simulate(SCENE, estimator="analytic")
    for scene, given in (
        (with_noise(SCENE, DetectorNoise(), ScreenResponse()), {}),
        (SCENE, {"noise": DetectorNoise(electrons_at_peak=1e4), "response": ScreenResponse(gamma=2.2)}),
    ):
        off = simulate(scene, estimator="analytic", **given)
        assert_same_images(off.stack, plain.stack)
        np.testing.assert_array_equal(off.result.deviation_mm, plain.result.deviation_mm)
        assert off.report.keys() == plain.report.keys()


def test_a_run_without_noise_imports_nothing_of_it():
    loaded = loaded_modules(
        "from irtscots_cl.pipeline.simulate import simulate; "
        "from irtscots_cl.scene.presets import parse_scene, preset_text; "  # no support of tests: it imports more
        "text = preset_text('sphere').replace('[125, 125]', '[15, 15]').replace('0.037', '0.3083'); "
        "simulate(parse_scene(text), estimator='analytic')"
    )
    assert "irtscots_cl.imaging.patterns" in loaded
    modules = (
        "imaging.detector imaging.recording imaging.screen_response imaging.maps imaging.streams pipeline.noise "
        "report.noise_facts scene.detector_noise scene.screen_response scene.optional_tables maths.poisson"
    )
    assert not {f"irtscots_cl.{name}" for name in modules.split()} & loaded


# --- on -----------------------------------------------------------------------------------------------------


def test_the_images_that_are_measured_are_the_recorded_ones_and_the_report_says_what_was_done(tmp_path):
    scene = with_noise(SCENE, NOISE, ScreenResponse(drift=0.01))
    run = simulate(scene, estimator="analytic")
    clean = trace(SCENE, estimator="analytic").images(LineScan(SCENE))
    assert_same_images(run.stack, record(clean, scene))
    assert run.stack.x.unit == "DN" and len(run.stack.x.weights) == 4
    told, peak = run.report["noise"], max(clean.x.flux_w.max(), clean.y.flux_w.max())
    assert told["unit"] == "DN" and told["saturation"] == np.inf
    assert told["electrons_at_peak"] == pytest.approx(1e6)
    assert told["electrons_per_w"] == pytest.approx(1e6 / peak)
    assert told["detector"] == {
        "electrons_at_peak": 1e6, "shot_noise": True, "read_noise_e": 5.0, "exposures": 4, "seed": 1,
    }  # fmt: skip
    assert told["screen"] == {"drift": 0.01, "seed": 1}
    write_run(run, tmp_path)
    assert json.loads((tmp_path / "report.json").read_text())["noise"]["saturation"] is None
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["images/x"].attrs["unit"] == file["images/y_standard_error"].attrs["unit"] == "DN"
        # two ways to add up four exposures of at most 1e6 DN
        np.testing.assert_allclose(file["images/x"][3], run.stack.x.image(3), rtol=0, atol=1e-8)
        assert "[camera.detector.noise]" in file.attrs["scene"] and "[screen.response]" in file.attrs["scene"]
    assert "electrons at peak" in (tmp_path / "report.html").read_text()


def test_one_exposure_s_file_holds_the_errors_that_its_images_show(tmp_path):
    noise = replace(NOISE, exposures=1)
    run = simulate(with_noise(SCENE, noise), estimator="analytic", measure="likelihood")
    write_run(run, tmp_path)
    with h5py.File(tmp_path / "result.h5") as file:
        for name in ("height_standard_error_nm", "centroid/x_standard_error_mm", "slope/y_standard_error_rad"):
            assert (file[name][()][run.result.mask] > 0).all(), name


def test_arguments_take_the_place_of_the_scene_s_own_tables():
    own = with_noise(SCENE, NOISE, ScreenResponse(drift=0.5))
    run = simulate(own, estimator="analytic", response=ScreenResponse(drift=0.01))
    expected = simulate(with_noise(SCENE, NOISE, ScreenResponse(drift=0.01)), estimator="analytic")
    assert_same_images(run.stack, expected.stack)
    assert run.transport.scene == expected.transport.scene


def test_drift_alone_leaves_the_images_in_watts():
    run = simulate(SCENE, estimator="analytic", response=ScreenResponse(drift=0.02))
    assert run.stack.x.unit == "W" and run.report["noise"]["detector"] == {}
    assert np.isnan(run.report["noise"]["electrons_per_w"])


def curves_of(scan: Scan) -> np.ndarray:
    """The light curves [pixels, lines] of all pixels of a detector."""
    return np.stack([scan.image(line).ravel() for line in range(len(scan.positions_mm))], -1)


def test_shot_noise_of_a_centroid_is_the_light_curve_s_width_over_the_root_of_its_photons():
    """sigma = w / sqrt(N); w^2 = a^2 / 4 + d^2 / 12 for an aperture of radius a = 0.5 mm and lines d = 0.2 mm wide:
    0.2566 mm. Nothing but shot noise on 9000 pixels of each scan, at three levels of light."""
    scene = load_scene("sphere-deviated")
    clean = trace(scene, estimator="analytic").images(LineScan(scene))
    light = [curves_of(scan) for scan in (clean.x, clean.y)]
    peak = max(curves.max() for curves in light)
    for electrons in (300.0, 3000.0, 30_000.0):
        noise = DetectorNoise(electrons_at_peak=electrons, shot_noise=True, seed=int(electrons))
        noisy = record(clean, with_noise(scene, noise))
        scaled = []
        for truth, scan in zip(light, (noisy.x, noisy.y), strict=True):
            whole = truth.sum(-1) > 0.9 * truth.sum(-1).max()  # the light falls to 0.97 at the mirror's rim
            seen, expected = curves_of(scan)[whole], truth[whole] * electrons / peak
            centroid, place = (c @ scan.positions_mm / c.sum(-1) for c in (seen, expected))
            scaled.append((centroid - place) * expected.sum(-1) ** 0.5)
        scaled = np.concatenate(scaled)
        assert len(scaled) > 15_000
        assert abs(scaled.mean()) < 4.5 * 0.2566 / len(scaled) ** 0.5  # 4.5 sigma
        # 4.5 sigma of a standard deviation; 1 % for the width of the light, which varies by the deviation
        assert scaled.std() == pytest.approx(0.2566, rel=4.5 / (2 * len(scaled)) ** 0.5 + 0.01)


def test_exposures_tell_the_noise_of_rays_and_detector_together(device):
    """Few rays and few electrons: both count, and the exposures' scatter holds both."""
    noise = DetectorNoise(electrons_at_peak=200.0, shot_noise=True, exposures=8)
    run = simulate(SCENE, noise=noise, device=device, rays_per_pixel=4096, replicates=8, seed=3)
    clean = trace(SCENE, estimator="analytic").images(LineScan(SCENE))
    scan, truth = run.stack.x, curves_of(clean.x) * run.report["noise"]["electrons_per_w"]
    bright = truth > 0.2 * truth.max()
    pulls = (scan.mean_w() - truth)[bright] / scan.standard_error_w()[bright]
    # Student's t with 7 degrees of freedom has the variance 7 / 5
    assert pulls.std() == pytest.approx((7 / 5) ** 0.5, rel=0.1)  # about 2000 samples: 3 %, and 3 % of the peak's noise
    assert abs(pulls.mean()) < 0.25  # the exposure is set by the brightest traced sample, some percent too bright


# --- uneven screens -----------------------------------------------------------------------------------------


def test_an_uneven_screen_is_in_the_images_of_a_transport_map(device):
    scene = with_noise(SCENE, None, UNEVEN)
    run = simulate(scene, device=device, rays_per_pixel=256, seed=2)
    columns = np.arange(21)
    x = (columns + 0.5) / 10.5 - 1
    brightness = np.broadcast_to((1 + 0.05 * x - 0.1 * x * x) * (columns != 2), (21, 21))
    expected = trace(SCENE, device=device, rays_per_pixel=256, seed=2).images(LineScan(SCENE, brightness))
    for axis in ("x", "y"):
        np.testing.assert_allclose(
            getattr(run.stack, axis).flux_w, getattr(expected, axis).flux_w, rtol=1e-12
        )  # rounding
    assert not run.stack.x.image(2).any() and run.stack.y.image(10).any()


@pytest.mark.parametrize(
    ("options", "way"),
    [
        ({"estimator": "analytic"}, "estimator analytic"),
        ({"smoothing": True}, "smoothing"),
        ({"estimator": "nonsequential"}, "estimator nonsequential"),
    ],
)
def test_an_uneven_screen_needs_a_map_of_transport(options, way):
    line = (
        f"scene sphere-deviated: screen.response: uneven brightness and dead pixels need the light of each screen "
        f"pixel, which {way} does not give; must be traced by adjoint without smoothing, or by forward"
    )
    with pytest.raises(ValueError, match="screen.response") as caught:
        simulate(SCENE, response=UNEVEN, **options)
    assert str(caught.value) == line
    assert check_noise(with_noise(SCENE, None, UNEVEN), estimator="forward")


# --- what does not go with noise ----------------------------------------------------------------------------


def test_terms_and_targets_are_for_images_without_noise(device):
    with pytest.raises(ValueError, match="parts: must be left out with noise"):
        simulate(SCENE, estimator="analytic", noise=NOISE, parts=True)
    must = r"target_nm: must be left out with a table \[camera.detector.noise\]"
    with pytest.raises(ValueError, match=must):
        run_to_target(with_noise(SCENE, NOISE), 5.0, device=device)
