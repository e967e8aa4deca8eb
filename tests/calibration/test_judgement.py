"""Each check of a fit passes for good data and says what is wrong with others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibrations import NOISE_MM, fitted, measured, paraboloid
from scipy import stats
from significance import sidak_z

from irtscots_cl.calibration.bundle_adjustment import Adjustment
from irtscots_cl.calibration.consequences import candidates, height_effects, widened
from irtscots_cl.calibration.judgement import judge, patch_means, prior_pulls, verdict
from irtscots_cl.measurement.quality import OK, WARNING, Check

SCENE = paraboloid(31)
UNKNOWNS = "camera,screen,zernike.4-15"


def checks_of(fit: Adjustment) -> dict[str, Check]:
    wide = widened(fit, candidates(fit))
    return {check.name: check for check in judge(fit, wide, height_effects(wide))}


def failed(checks: dict[str, Check]) -> set[str]:
    return {name for name, check in checks.items() if check.level != OK}


def test_good_data_pass_every_check():
    checks = checks_of(fitted(measured(SCENE, {"camera.x_mm": 0.3, "zernike.6_um": 0.2}), UNKNOWNS))
    assert failed(checks) == set()
    assert verdict(list(checks.values())) == "good: the fitted set-up explains the images within their noise"
    assert all(c.text and "\n" not in c.text and c.text.isprintable() for c in checks.values())


def test_higher_orders_of_the_mirror_are_told_as_slopes_of_a_surface():
    checks = checks_of(fitted(measured(SCENE, {"zernike.30_um": 0.3}), UNKNOWNS))
    assert {"chi-square", "pattern"} <= failed(checks) and checks["surface"].level == OK
    assert checks["surface"].text.startswith(("9", "100")) and "could be those of a surface" in checks["surface"].text


def test_a_screen_that_is_not_flat_is_told_as_slopes_of_no_surface():
    """Bent to the third order across x and y it moves light sideways as no mirror does."""
    fit = fitted(measured(SCENE, {"screen.sag_1_2_mm": 8.0}), UNKNOWNS)
    checks = checks_of(fit)
    assert checks["surface"].level == WARNING and "those of no surface" in checks["surface"].text


def test_values_far_from_their_priors_are_told():
    checks = checks_of(fitted(measured(SCENE, {"camera.x_mm": 5.0, "screen.x_mm": -4.0}), "camera,screen"))
    assert "priors" in failed(checks)
    assert "_mm = " in checks["priors"].text and "standard deviations of its prior (0.5)" in checks["priors"].text
    assert verdict(list(checks.values())).startswith("the model does not explain the data: ")


def test_pulls_from_the_priors_have_variance_one():
    """Of data that say as much as the prior: value less prior, over the root of the difference of their variances."""
    scene, sigma, pulls = paraboloid(15), 0.5, []
    noise = NOISE_MM * sigma / fitted(measured(scene, {}), "camera.x_mm").errors[0]
    for seed in range(150):
        true = {"camera.x_mm": sigma * np.random.default_rng(seed).normal()}
        pulls.append(prior_pulls(fitted(measured(scene, true, seed, noise), "camera.x_mm"))[0])
    assert abs(np.mean(pulls)) < sidak_z(2, 1e-6) / np.sqrt(len(pulls))
    assert abs(np.var(pulls) - 1) < sidak_z(2, 1e-6) * np.sqrt(2 / len(pulls))


def test_many_rejected_pixels_are_told():
    m = measured(SCENE, {})
    places = m.places_mm.copy()
    places[:, ::20] += 0.5
    checks = checks_of(fitted(replace(m, places_mm=places), UNKNOWNS))
    assert (
        checks["rejected"].level == WARNING and f"{len(m.pixels[::20])} of {len(m.pixels)}" in checks["rejected"].text
    )
    assert verdict(list(checks.values())).startswith("with reservations: ")


def test_residuals_of_several_measurements_are_told_apart():
    first = measured(SCENE, {}, name="a.h5")
    second = measured(SCENE, {"zernike.30_um": 0.02}, seed=1, name="b.h5")
    text = checks_of(fitted([first, second], UNKNOWNS))["chi-square"].text
    assert "a.h5 " in text and "b.h5 " in text and "are their turns and moves those stated?" in text


def test_a_fit_that_has_not_converged_is_told():
    fit = replace(fitted(measured(SCENE, {}), UNKNOWNS), converged=False)
    assert "not converged" in checks_of(fit)["converged"].text


@pytest.mark.parametrize("size", [0.0, 0.6])
def test_patterns_below_the_noise_of_a_pixel_are_found(size):
    """White noise has means of variance 1; 0.6 noise levels of a smooth pattern are plain over patches."""
    m, random = measured(paraboloid(61), {}), np.random.default_rng(0)
    row, column = m.place_of()
    pattern = size * np.stack([np.sin(row / 12), np.cos(column / 12)])
    means = patch_means(m, random.standard_normal(pattern.shape) + pattern, np.ones(len(m.pixels), bool))
    squares, count = np.sum(means**2), means.size
    assert (stats.chi2(count).sf(squares) > 1e-6) == (size == 0)
