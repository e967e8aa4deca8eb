"""What images leave open: covariances against drawn errors, directions, Zernike terms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.calibration.height_response import HeightResponse
from irtscots_cl.calibration.jacobian import centroid_jacobian, design_centroids
from irtscots_cl.calibration.observability import (
    covariance_of,
    default_noise_mm,
    observe,
    weak_directions,
    zernike_errors,
)
from irtscots_cl.calibration.parameters import moved, zernike_names
from irtscots_cl.calibration.priors import Distance, Priors, default_priors
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene

SIGMA = {"camera.x_mm": 0.5, "camera.z_mm": 0.5, "camera.tilt_y_rad": 1e-3, "camera.principal_x_px": 0.3,
         "screen.x_mm": 0.5, "screen.clocking_rad": 1e-3, "screen.pitch_relative": 1e-4}  # fmt: skip
PRIORS = Priors(SIGMA, (Distance("camera", "mirror", 0.1),))
NOLLS = tuple(range(4, 16))


def small_sphere():
    scene = load_scene("sphere")
    detector = replace(scene.camera.detector, pixels=(41, 41), pitch_mm=0.037 * 125 / 41)
    return Setup(replace(scene, camera=replace(scene.camera, detector=detector)))


@pytest.fixture(scope="module")
def sphere():
    return observe(small_sphere(), PRIORS, noise_mm=2e-3, nolls=NOLLS)


def test_the_covariance_is_that_of_fits_to_moved_tests(sphere):
    """Errors drawn from the priors move the scene itself; a fit by other means finds them, off as was foreseen.

    Pulls of 400 draws of 19 unknowns: the mean square of each against chi-square, and the mean against a normal. 38
    two-sided tests at 1e-5 in all fail by chance in one of 10^5 seeds; the seed is fixed.
    """
    setup, random = sphere.setup, np.random.default_rng(3)
    names = (*PRIORS.names, *zernike_names(NOLLS))
    pixels = sphere.response.seen.pixels
    jacobian = centroid_jacobian(setup, names, pixels).reshape(-1, len(names))
    design = design_centroids(setup, setup, pixels).ravel()
    covariance_geometry = PRIORS.root(setup.scene) @ PRIORS.root(setup.scene).T
    information = np.zeros((len(names), len(names)))
    information[:7, :7] = np.linalg.inv(covariance_geometry)
    scale = np.array([*SIGMA.values(), *[0.1] * len(NOLLS)])
    normal = (jacobian.T @ jacobian / 4e-6 + information) * np.outer(scale, scale)
    unscale = np.block([[sphere.root, np.zeros((7, 12))], [np.zeros((12, 7)), np.eye(12)]])
    predicted = unscale @ sphere.covariance() @ unscale.T
    pulls = []
    for _ in range(400):
        # a hundredth of the errors and of the noise: linear, as the prediction is
        true = np.concatenate([random.multivariate_normal(np.zeros(7), covariance_geometry), 0.1 * np.ones(12)]) / 100
        changed = moved(setup.scene, dict(zip(names, true, strict=True)))
        noise = 2e-5 * random.standard_normal(design.shape)
        data = design_centroids(changed, setup, pixels).ravel() - design + noise
        found = np.linalg.solve(normal, (jacobian.T @ data / 4e-6) * scale) * scale
        pulls.append((found - true) * 100 / np.sqrt(np.diag(predicted)))
    pulls, chance = np.array(pulls), 1e-5 / 38 / 2
    low, high = stats.chi2.ppf([chance, 1 - chance], 400)
    assert (low < (pulls**2).sum(0)).all() and ((pulls**2).sum(0) < high).all()
    assert np.abs(pulls.mean(0)).max() < stats.norm.isf(chance) / np.sqrt(400)


def test_noise_alone_scales_and_perfect_knowledge_leaves_only_noise(sphere):
    setup = sphere.setup
    exact = Priors({name: value * 1e-7 for name, value in SIGMA.items()})
    one, three = (zernike_errors(observe(setup, exact, noise, NOLLS)) for noise in (1e-3, 3e-3))
    for a, b in zip(one, three, strict=True):
        assert b.noise_um == pytest.approx(3 * a.noise_um) and a.total_um == pytest.approx(a.noise_um, rel=1e-6)
        assert a.geometry_um <= 1e-3 * a.noise_um


def test_what_the_priors_do_to_zernike_terms_is_what_they_do_to_heights():
    """Two ways from an unknown to a height: a fit of Zernike terms to centroids, and the integration of slopes."""
    setup = small_sphere()
    response = HeightResponse.of(setup)
    for name, step in (("camera.x_mm", 0.1), ("screen.clocking_rad", 1e-3), ("screen.pitch_y_relative", 1e-3)):
        priors = Priors({name: step})
        observation = observe(setup, priors, 2e-3, response=response)
        alone = zernike_errors(observation)
        jacobian = centroid_jacobian(setup, [name], response.seen.pixels)
        expected = response.left(response.heights_mm(np.moveaxis(jacobian, -1, 0)))[0] * step * 1e6
        sizes = np.array([1e3 * z.uncalibrated_um for z in alone])
        assert np.sqrt(np.sum(sizes**2)) == pytest.approx(expected[0], rel=0.02)
        # the rim of the pixels is not round
        assert np.sqrt(np.sum(sizes[1:] ** 2)) == pytest.approx(expected[1], rel=0.02)


def test_the_total_is_noise_and_geometry_and_images_help(sphere):
    for z in zernike_errors(sphere):
        assert z.total_um == pytest.approx(np.hypot(z.noise_um, z.geometry_um))
        assert z.noise_um > 0 and z.geometry_um < z.uncalibrated_um * 1.01


def test_the_directions_are_all_that_is_left_open(sphere):
    setup, p = sphere.setup, sphere.count
    jacobian = centroid_jacobian(setup, PRIORS.names, sphere.response.seen.pixels)
    heights = sphere.response.heights_mm(np.moveaxis(jacobian, -1, 0))
    found = weak_directions(sphere, heights, count=p)
    covariance = sphere.root @ sphere.covariance()[:p, :p] @ sphere.root.T
    maps = sphere.response.without(heights, "piston_tilt") * 1e6
    total = np.einsum("in,ij,jn->n", maps, covariance, maps).mean()
    assert sum(d.rms_nm[0] ** 2 for d in found) == pytest.approx(total, rel=1e-9)
    sizes = [d.rms_nm[0] for d in found]
    assert sizes == sorted(sizes, reverse=True)
    changes = np.array([[d.change[name] for name in PRIORS.names] for d in found])
    np.testing.assert_allclose(changes.T @ changes, covariance, rtol=1e-6, atol=1e-12)  # they make up the covariance
    assert all(0 < d.left <= 1 + 1e-9 for d in found)
    assert found[0].height_nm.shape == (41, 41)
    mean_square = np.nanmean(found[0].height_nm ** 2)
    assert np.sqrt(mean_square) == pytest.approx(found[0].rms_nm[0], rel=1e-6)


def test_on_the_sphere_both_distances_together_are_left_open():
    setup = small_sphere()
    priors = default_priors(setup.scene)
    observation = observe(setup, priors)
    jacobian = centroid_jacobian(setup, priors.names, observation.response.seen.pixels)
    first = weak_directions(observation, observation.response.heights_mm(np.moveaxis(jacobian, -1, 0)))[0]
    assert first.main_parts(priors) in (["camera.z_mm", "screen.z_mm"], ["screen.z_mm", "camera.z_mm"])
    assert first.left == pytest.approx(1.0, abs=1e-3)
    # 0.5 mm / sqrt 2 each: 236.8 nm for 0.1 mm of both; without power nearly nothing
    assert first.rms_nm[0] == pytest.approx(2368.05 * 0.5 / np.sqrt(2), rel=0.01)
    assert first.rms_nm[1] < 0.01 * first.rms_nm[0]


def test_defaults_and_refusals():
    setup = small_sphere()
    assert default_noise_mm(setup.scene) == pytest.approx(2e-3)
    with pytest.raises(ValueError, match=r"noise = 0.0 mm: must be a finite number above 0"):
        observe(setup, PRIORS, 0.0)
    detector = replace(setup.scene.camera.detector, pixels=(13, 13), pitch_mm=0.35)
    few = replace(setup.scene, camera=replace(setup.scene.camera, detector=detector))
    with pytest.raises(ValueError, match="pixels do not tell 492 Zernike terms apart; ask for fewer"):
        observe(few, PRIORS, nolls=range(4, 496))


def test_covariance_of_rows_of_very_different_size():
    rows = np.array([[1e8, 0.0], [0.0, 1e-8], [1e8, 1e-8]])
    np.testing.assert_allclose(covariance_of([rows[:2], rows[2:]]) * 1.0, np.linalg.inv(rows.T @ rows), rtol=1e-6)
