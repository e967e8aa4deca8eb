"""What further measurements buy, against problems that are set up anew with them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from irtscots_cl.calibration.jacobian import centroid_jacobian
from irtscots_cl.calibration.measures import (
    MIRROR_POSE,
    REMOUNT_MM,
    REMOUNT_RAD,
    plan,
    ranked_measures,
    zernike_turn,
)
from irtscots_cl.calibration.observability import observe
from irtscots_cl.calibration.parameters import zernike_names
from irtscots_cl.calibration.priors import Distance, Priors
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene

SIGMA = {"camera.x_mm": 0.5, "camera.y_mm": 0.3, "camera.z_mm": 0.5, "screen.x_mm": 0.5, "screen.z_mm": 0.5,
         "screen.clocking_rad": 1e-3}  # fmt: skip
NOLLS = tuple(range(4, 16))
NOISE_MM = 2e-3


def small(name="sphere"):
    scene = load_scene(name)
    detector = replace(scene.camera.detector, pixels=(41, 41), pitch_mm=0.037 * 125 / 41)
    return Setup(replace(scene, camera=replace(scene.camera, detector=detector)))


@pytest.fixture(scope="module")
def sphere():
    return observe(small(), Priors(SIGMA), NOISE_MM, NOLLS)


@pytest.fixture(scope="module")
def measures(sphere):
    return {measure.name: measure for measure in ranked_measures(sphere)}


def rms_nm(observation):
    p = observation.count
    return observation.rms_nm(observation.covariance()[p:, p:])


@pytest.mark.parametrize("name", ["camera.z_mm", "screen.clocking_rad"])
def test_a_number_measured_better_is_a_better_prior(sphere, measures, name):
    measure = measures[name]
    sigma = 1 / np.hypot(1 / SIGMA[name], 1 / measure.sigma)
    after = observe(sphere.setup, Priors(SIGMA | {name: sigma}), NOISE_MM, NOLLS, sphere.response)
    np.testing.assert_allclose(measure.after_nm, rms_nm(after), rtol=1e-6)
    np.testing.assert_allclose(measure.before_nm, rms_nm(sphere), rtol=1e-9)


@pytest.mark.parametrize("ends", [("camera", "screen"), ("camera", "mirror")])
def test_a_distance_measured_is_a_prior_on_it(sphere, measures, ends):
    measure = measures[" to ".join(ends)]
    after = observe(sphere.setup, Priors(SIGMA, (Distance(*ends, measure.sigma),)), NOISE_MM, NOLLS, sphere.response)
    np.testing.assert_allclose(measure.after_nm, rms_nm(after), rtol=1e-6)


def test_it_needs_to_be_so_good_that_it_buys_nine_tenths(sphere, measures):
    measure = measures["camera.z_mm"]
    perfect = rms_nm(observe(sphere.setup, Priors(SIGMA | {"camera.z_mm": 1e-9}), NOISE_MM, NOLLS, sphere.response))
    square = measure.before_nm**2 - measure.after_nm**2
    assert square[0] == pytest.approx(0.9 * (measure.before_nm[0] ** 2 - perfect[0] ** 2), rel=1e-5)


def test_turned_zernike_terms():
    """The turned mirror's height at a point is the mirror's own at the point turned back."""
    random = np.random.default_rng(2)
    values, angle = random.standard_normal(len(NOLLS)), 0.7
    x, y = random.uniform(-0.7, 0.7, (2, 50))
    back_x, back_y = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    seen = zernike_turn(NOLLS, angle) @ values
    expected = sum(v * zernike(noll, back_x, back_y) for v, noll in zip(values, NOLLS, strict=True))
    found = sum(v * zernike(noll, x, y) for v, noll in zip(seen, NOLLS, strict=True))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    with pytest.raises(ValueError, match="4 and 5|5 and 6|6 and 5"):
        zernike_turn((4, 5), 0.1)


def stacked_covariance(sphere, angles_deg):
    """Of the mirror's terms, from the centroids of all images and the priors as one tall matrix."""
    names = (*SIGMA, *zernike_names(NOLLS), *MIRROR_POSE)
    jacobian = centroid_jacobian(sphere.setup, names, sphere.response.seen.pixels).reshape(-1, len(names))
    jacobian /= sphere.noise_mm
    geometry, mirror, pose = np.split(jacobian, [6, 18], axis=1)
    remount = [REMOUNT_RAD if "rad" in name else REMOUNT_MM for name in MIRROR_POSE]
    again = len(angles_deg) - 1
    width = 18 + 6 * again
    priors = np.delete(np.diag(1 / np.array([*SIGMA.values(), *[1.0] * 12, *remount * again])), range(6, 18), axis=0)
    blocks = [priors]
    for k, angle in enumerate(angles_deg):
        rows = np.zeros((len(jacobian), width))
        rows[:, :6], rows[:, 6:18] = geometry, mirror @ zernike_turn(NOLLS, np.radians(angle))
        if k:
            rows[:, 12 + 6 * k : 18 + 6 * k] = pose
        blocks.append(rows)
    inverse = np.linalg.pinv(np.concatenate(blocks), rcond=1e-15)
    return inverse[6:18] @ inverse[6:18].T


@pytest.mark.parametrize("noise_mm", [NOISE_MM, 5.0])  # much noise, so that the priors of the pose count
def test_a_turned_mirror_is_a_second_set_of_images(sphere, noise_mm):
    sphere = observe(sphere.setup, Priors(SIGMA), noise_mm, NOLLS, sphere.response)
    measures = {measure.name: measure for measure in ranked_measures(sphere)}
    for name, angles in (("mirror at 0 and 90 degrees", (0, 90)), ("mirror at 0, 120 and 240 degrees", (0, 120, 240))):
        expected = sphere.rms_nm(stacked_covariance(sphere, angles))
        np.testing.assert_allclose(measures[name].after_nm, expected, rtol=1e-6)  # a condition of 1e9


def test_turning_removes_astigmatism_and_not_power(measures):
    measure = measures["mirror at 0, 120 and 240 degrees"]
    assert measure.mainly == "astigmatism"
    assert measure.after_nm[1] < 0.1 * measure.before_nm[1]
    assert measure.after_nm[0] > 0.95 * measure.before_nm[0]


def test_a_reference_of_the_same_form_removes_what_the_geometry_does(measures):
    measure = measures["reference of the mirror's own form, known to 5 nm rms"]
    assert (measure.after_nm < measure.before_nm).all()
    assert measure.after_nm[1] < 0.1 * measure.before_nm[1]
    flat = measures["reference flat, known to 5 nm rms"]
    assert "the camera sees the screen in it through" in flat.why_not and not flat.buys_nm.any()


def test_a_flat_is_of_use_where_the_screen_is_large():
    """A screen of two metres a metre away from a small mirror: the flat shows enough of it."""
    scene = small().scene
    scene = replace(
        scene,
        mirror=replace(scene.mirror, diameter_mm=300.0),
        screen=replace(scene.screen, position_mm=(100.0, 0.0, 1500.0), pixels=(500, 500), pitch_mm=4.0),
        camera=replace(scene.camera, position_mm=(-100.0, 0.0, 1500.0),
                       detector=replace(scene.camera.detector, pitch_mm=0.08)),
    )  # fmt: skip
    observation = observe(Setup(scene), Priors(SIGMA), 0.04, NOLLS)
    flat = next(m for m in ranked_measures(observation) if m.name.startswith("reference flat"))
    assert not flat.why_not and flat.buys_nm[0] > 0.1 * flat.before_nm[0]


def test_an_off_axis_mirror_is_not_turned():
    found = {m.name: m for m in ranked_measures(observe(small("off-axis"), Priors(SIGMA), NOISE_MM, NOLLS))}
    assert found["mirror at 0 and 90 degrees"].why_not.startswith("an off-axis segment looks different")


def test_the_ranking_and_the_plan(sphere, measures):
    most = [measure.buys_nm.max() for measure in measures.values()]
    assert most == sorted(most, reverse=True)
    steps = plan(sphere)
    assert len(steps) >= 3
    for before, after in pairwise(steps):
        np.testing.assert_allclose(after.before_nm, before.after_nm, rtol=1e-9)
        assert after.after_nm[0] < before.after_nm[0]
    numbers = [m for m in measures.values() if m.sigma is not None]
    assert steps[0].buys_nm[0] == max(m.buys_nm[0] for m in numbers)
