"""The fit itself: against another solver, with outliers, several measurements, distances, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibrations import NOISE_MM, fitted, knowing, measured, paraboloid
from scipy.optimize import least_squares

from irtscots_cl.calibration import measured as measured_module
from irtscots_cl.calibration.known import named_unknowns, priors_of
from irtscots_cl.calibration.parameters import moved

SCENE = paraboloid(21)
POSES = "camera,screen"
TRUE = {"camera.x_mm": 0.4, "camera.tilt_y_rad": 1e-3, "screen.z_mm": -0.3, "screen.clocking_rad": 2e-3}


def test_values_and_covariance_are_those_of_scipy():
    unknowns = f"{POSES},camera.k1,zernike.4-6"
    scene = paraboloid(15)
    m = measured(scene, TRUE | {"zernike.5_um": 0.2})
    fit = fitted(m, unknowns)
    names = named_unknowns(unknowns, scene)
    sigmas = np.array([priors_of(names, scene)[name].sigma for name in names])

    def residuals(scaled):
        left = (m.places_mm - m.predicted(dict(zip(names, scaled * sigmas, strict=True)))) / NOISE_MM
        return np.append(left.ravel(), scaled)

    # its derivatives are differences, and each step's size is that of the priors
    other = least_squares(residuals, np.zeros(len(names)), jac="3-point", diff_step=1e-3, xtol=1e-9, ftol=1e-10)
    covariance = np.linalg.inv(other.jac.T @ other.jac) * np.outer(sigmas, sigmas)
    errors = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(fit.values / errors, other.x * sigmas / errors, atol=2e-2)  # of a standard deviation
    np.testing.assert_allclose(fit.errors, errors, rtol=1e-2)  # both are at nearly the same place
    assert 2 * other.cost == pytest.approx(fit.chi_square + np.sum((fit.values / sigmas) ** 2), rel=1e-6)


def test_parts_of_the_pixels_make_no_difference(monkeypatch):
    m = measured(SCENE, TRUE)
    whole = fitted(m, POSES)
    monkeypatch.setattr(measured_module, "AT_ONCE", 17)
    parts = fitted(m, POSES)
    np.testing.assert_allclose(parts.values / whole.errors, whole.values / whole.errors, atol=1e-6)
    np.testing.assert_allclose(parts.errors, whole.errors, rtol=1e-8)


def test_outliers_are_rejected_and_move_nothing():
    clean, random = measured(SCENE, TRUE), np.random.default_rng(5)
    wrong = random.choice(len(clean.pixels), 20, replace=False)
    places = clean.places_mm.copy()
    places[:, wrong] += random.choice([-1, 1], (2, 20)) * random.uniform(0.02, 3.0, (2, 20))
    found = fitted(replace(clean, places_mm=places), POSES)
    assert found.rejected == 20 and not found.used[0][wrong].any()
    kept = np.setdiff1d(np.arange(len(clean.pixels)), wrong)
    alone = fitted(replace(clean, pixels=clean.pixels[kept], places_mm=clean.places_mm[:, kept],
                           errors_mm=clean.errors_mm[:, kept], offsets_mm=clean.offsets_mm[:, kept],
                           mirror_offsets_mm=clean.mirror_offsets_mm[:, kept]), POSES)  # fmt: skip
    np.testing.assert_allclose(found.values / alone.errors, alone.values / alone.errors, atol=1e-2)
    np.testing.assert_allclose(found.errors, alone.errors, rtol=1e-4)


def test_a_minority_of_the_pixels_that_agree_on_something_else_moves_nothing():
    """A second reflection: plain least squares would go half way, and find nothing too far from its model."""
    m = measured(SCENE, TRUE)
    second = np.random.default_rng(4).random(len(m.pixels)) < 0.4
    found = fitted(replace(m, places_mm=m.places_mm + np.where(second, 2.0, 0.0)), POSES)
    assert np.array_equal(~found.used[0], second) and found.noise == 1


def test_errors_that_are_stated_too_small_are_scaled_up():
    m = measured(SCENE, TRUE)
    low = fitted(replace(m, errors_mm=m.errors_mm / 3), POSES)
    assert low.noise == pytest.approx(3, rel=0.1)  # 1 / sqrt(2 n) is 0.03
    np.testing.assert_allclose(low.errors, fitted(m, POSES).errors, rtol=0.1)
    high = fitted(replace(m, errors_mm=m.errors_mm * 3), POSES)
    assert high.noise == 1 and high.chi_square / high.degrees == pytest.approx(1 / 9, rel=0.2)


def test_a_turned_mirror_tells_its_astigmatism_from_the_geometry():
    """Astigmatism turns with the mirror, that of the geometry does not."""
    figure = {"zernike.5_um": 0.3, "zernike.6_um": -0.2, "zernike.7_um": 0.1, "zernike.8_um": 0.1}
    unknowns = f"{POSES},zernike.4-11"
    turned = [measured(SCENE, TRUE | figure, seed=1, name="first")]
    # turned by 90 degrees: astigmatism changes its sign, coma x becomes coma y, and y becomes -x
    quarter = {"zernike.5_um": -0.3, "zernike.6_um": 0.2, "zernike.7_um": 0.1, "zernike.8_um": -0.1}
    turned.append(measured(SCENE, TRUE | quarter, seed=2, name="second", turn_rad=np.pi / 2))
    one, both = fitted(turned[0], unknowns), fitted(turned, unknowns)
    assert both.noise == 1 and both.names == one.names
    for name, true in figure.items():
        k = both.names.index(name)
        assert both.errors[k] < one.errors[k] / 10
        assert abs(both.values[k] - true) < 5 * both.errors[k]  # 6e-7


def test_known_changes_between_measurements():
    """Images with the screen at two distances: what is known is the change, not the place."""
    scenes = [SCENE, moved(SCENE, {"screen.z_mm": 40.0, "camera.x_mm": 15.0})]
    both = fitted([measured(s, TRUE, seed=k, name=f"{k}") for k, s in enumerate(scenes)], POSES)
    assert both.noise == 1
    pulls = [(v - TRUE.get(n, 0.0)) / e for n, v, e in zip(both.names, both.values, both.errors, strict=True)]
    assert np.abs(pulls).max() < 5  # 7e-6 for twelve unknowns


def test_an_unknown_of_a_measurement_of_its_own():
    shifts = {"mirror.tilt_x_rad": 3e-4}
    first = measured(SCENE, TRUE, seed=1, name="first")
    second = measured(SCENE, TRUE | shifts, seed=2, name="second", own=("mirror.tilt_x_rad",))
    found = fitted([first, second], POSES)
    k = found.names.index("mirror.tilt_x_rad of second")
    assert abs(found.values[k] - 3e-4) < 5 * found.errors[k] < 1e-5 and found.noise == 1


def test_a_known_distance_acts_as_measured():
    apart = np.linalg.norm(np.subtract(SCENE.camera.position_mm, SCENE.screen.position_mm))
    names, sigma = ("camera.x_mm", "screen.x_mm"), 0.01
    scene = knowing(SCENE, camera_to_screen=(float(apart) + 0.25, sigma))
    # errors so large that the places say nothing
    found = fitted(measured(scene, {}, noise=1e4), ",".join(names))
    gap = found.values[1] - found.values[0]
    assert gap == pytest.approx(0.25, rel=1e-2)  # the screen is at +x; priors of 0.5 mm pull by 1e-4
    error = np.sqrt(found.covariance[0, 0] + found.covariance[1, 1] - 2 * found.covariance[0, 1])
    assert error == pytest.approx(sigma, rel=1e-2)


def test_what_nothing_determines_is_refused():
    with pytest.raises(ValueError, match=r'^unknown (\w+\.x_mm): no image and no prior determines .*mirror\.x_mm.* '
                       r'together; give \[calibration\.known\] "\1" = 0\.5 or .*, or hold it$'):  # fmt: skip
        fitted(measured(SCENE, {}), "camera,screen,mirror.x_mm", defaults=False)


def test_too_few_pixels_are_refused():
    m = measured(SCENE, {})
    few = replace(m, pixels=m.pixels[:11], places_mm=m.places_mm[:, :11], errors_mm=m.errors_mm[:, :11])
    with pytest.raises(
        ValueError, match="^images: 11 pixels for 12 unknowns; must be at least 12: fit fewer unknowns$"
    ):
        fitted(few, POSES)


def test_pixels_whose_rays_miss_the_mirror_are_refused():
    m = measured(SCENE, {}, name="lab.h5")
    lost = np.where(np.arange(len(m.pixels)) % 3 > 0, np.nan, m.offsets_mm)
    with pytest.raises(ValueError, match=r"^lab\.h5: 66% of the pixels' chief rays miss the mirror or screen"):
        fitted(replace(m, offsets_mm=lost), POSES)


def test_places_by_chance_are_refused():
    clean, random = measured(SCENE, {}), np.random.default_rng(2)
    wrong = random.random(len(clean.pixels)) < 0.6
    places = clean.places_mm + np.where(wrong, random.normal(0, 300.0, clean.places_mm.shape), 0)
    with pytest.raises(ValueError, match="^images: the places contradict the scene: they lead to one that cannot be"):
        fitted(replace(clean, places_mm=places), POSES)


def test_a_measurement_that_contradicts_the_others_is_refused():
    """The lines of the second file are counted from elsewhere."""
    several = [measured(SCENE, TRUE, seed=k, name=name) for k, name in enumerate(("first", "second", "third"))]
    several[1] = replace(several[1], places_mm=several[1].places_mm + 30.0)
    with pytest.raises(ValueError, match=r"^second: 100% of the pixels contradict .*its turn and its moves"):
        fitted(several, POSES)
