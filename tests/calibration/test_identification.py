"""All that `identify` says of a design, as one result."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

import irtscots_cl as irt
from irtscots_cl.calibration.identification import identify
from irtscots_cl.calibration.parameters import known_parameters
from irtscots_cl.calibration.priors import Priors
from irtscots_cl.scene.calibration_known import Calibration
from irtscots_cl.scene.presets import load_scene


def small_sphere(**changes):
    scene = load_scene("sphere-deviated")
    detector = replace(scene.camera.detector, pixels=(41, 41), pitch_mm=0.037 * 125 / 41)
    return replace(scene, camera=replace(scene.camera, detector=detector), **changes)


@pytest.fixture(scope="module")
def found():
    return identify(small_sphere())


def test_only_the_design_is_used(found):
    assert irt.identify is identify
    design = identify(small_sphere().nominal())
    np.testing.assert_array_equal(design.height_nm, found.height_nm)
    assert found.observation.setup.scene.mirror.zernike == ()


def test_every_known_unknown_is_a_source(found):
    assert list(found.sources) == list(known_parameters(found.observation.setup.scene))
    assert all(len(nm) == 4 and np.isfinite(nm).all() for nm in found.sources.values())
    np.testing.assert_allclose(found.sources["mirror.z_mm"][0], 2368.0, rtol=0.01)  # fewer pixels than in the preset


def test_images_never_make_an_unknown_worse_known(found):
    for name, sigma in found.observation.priors.sigma.items():
        assert 0 < found.posterior[name] <= sigma * (1 + 1e-9)
    assert (found.height_of_noise_nm < found.height_nm).all()


def test_what_the_scene_says_is_known_counts():
    known = dict.fromkeys((f"{device}.{axis}_mm" for device in ("camera", "screen") for axis in "xz"), 1e-3)
    known["mirror.radius_relative"] = 1e-5
    told = identify(small_sphere(calibration=Calibration(known=known)))
    assert told.posterior["camera.z_mm"] <= 1e-3 and "mirror.radius_relative" in told.posterior
    # 9880 nm for 0.1 % of the radius; the rest is known so well that little is added
    power = next(z for z in told.zernikes if z.noll == 4)
    assert 1e3 * power.geometry_um == pytest.approx(98.8, rel=0.05)


def test_more_noise_and_other_terms(found):
    noisy = identify(small_sphere(), Priors({"camera.x_mm": 0.5}), noise_mm=0.02, nolls=range(4, 16))
    assert len(noisy.zernikes) == 12 and list(noisy.posterior) == ["camera.x_mm"]
    assert noisy.zernikes[0].noise_um == pytest.approx(10 * found.zernikes[0].noise_um, rel=0.2)


def test_a_large_detector_is_judged_by_some_of_its_pixels():
    scene = load_scene("sphere")
    detector = replace(scene.camera.detector, pixels=(375, 375), pitch_mm=0.037 / 3)
    large = identify(replace(scene, camera=replace(scene.camera, detector=detector)))
    same = identify(scene, noise_mm=0.002 / 3)  # nine pixels for each
    assert large.observation.response.seen.step == 3
    np.testing.assert_allclose(large.height_of_noise_nm, same.height_of_noise_nm, rtol=1e-3)
    np.testing.assert_allclose(large.sources["camera.x_mm"], same.sources["camera.x_mm"], rtol=1e-3)


def test_it_takes_seconds():
    start = time.process_time()
    identify(load_scene("sphere"))
    assert time.process_time() - start < 30  # of processor time; 2.5 s here
