"""The noise of samples as it was put into synthetic images: of dark pixels, and its growth with the light."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from noisy_images import images_of, setup_of, small
from significance import sidak_z

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.measurement.curve_fit import CurveFits, SampleNoise
from irtscots_cl.measurement.curve_windows import place_windows
from irtscots_cl.measurement.sample_noise import dark_noise, noise_with_light
from irtscots_cl.measurement.scan_estimates import estimate_centroids

CURVES, LINES, HALF = 600, 41, 4.0
SIGMA = 0.02  # of dark samples
CHANCE = 1e-6  # of a failure of right code, for every test
DARK = SampleNoise(np.full(CURVES, SIGMA**2), 0.0)


def windows_of(curves: np.ndarray, usable=None):
    scan = Scan.from_images("x", np.arange(float(curves.shape[1])), curves.T[:, None, :])
    usable = np.ones(curves.shape[1], bool) if usable is None else usable
    middle = np.full(len(curves), (curves.shape[1] - 1) / 2)
    return place_windows(scan, curves, middle, np.full(len(curves), HALF), usable, HALF)


def profile() -> np.ndarray:
    return np.maximum(1 - ((np.arange(LINES) - (LINES - 1) / 2) / HALF) ** 2, 0.0)


def drawn(per_light: float = 0.0, seed: int = 0, sigma=SIGMA, background=0.0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=(CURVES, LINES))
    return profile() + background + noise * np.sqrt(sigma**2 + per_light * profile())


def fits_of(windows) -> CurveFits:
    """Least squares of flux and place, from the true ones on: as the weights of dark noise have it."""
    index = np.clip(windows.lines, 0, LINES - 1)
    modelled = np.where(windows.allowed, profile()[index], 0.0)
    derivative = np.where(windows.allowed, -np.gradient(profile())[index], 0.0)
    columns = np.stack([modelled[0], derivative[0]], 1)
    change = np.linalg.lstsq(columns, (windows.samples - modelled).T, rcond=None)[0]
    residual = np.where(windows.allowed, windows.samples - modelled - (columns @ change).T, 0.0)
    one = np.ones(len(windows.first))
    return CurveFits(one, one, 0 * one, 0 * one, modelled, derivative, residual, one, one)


# --- dark samples -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("background", "tilted"), [(0.0, False), (3.0, False), (3.0 - 0.05 * np.arange(LINES), True)])
def test_the_dark_noise_is_what_was_put_in(background, tilted):
    floor = dark_noise(windows_of(drawn(background=background)), tilted)
    assert (floor == floor[0]).mean() > 0.99  # one value for all pixels
    # the median of 600 variances of 28 samples each: 27 % / sqrt(600) x 1.25
    assert np.median(floor) / SIGMA**2 == pytest.approx(1, abs=sidak_z(1, CHANCE) * 0.27 * 1.25 / np.sqrt(CURVES))


def test_a_slope_of_the_background_that_is_not_told_looks_like_noise():
    curves = drawn(background=0.05 * np.arange(LINES))
    assert np.median(dark_noise(windows_of(curves), False)) > 10 * SIGMA**2


def test_a_hot_pixel_has_its_own_noise_and_the_others_do_not_mind():
    sigma = np.full((CURVES, 1), SIGMA)
    hot = [5, 77, 400]
    sigma[hot] = [[6 * SIGMA], [20 * SIGMA], [100 * SIGMA]]
    floor = dark_noise(windows_of(drawn(sigma=sigma)), False)
    assert np.abs(np.log(floor[hot] / sigma[hot, 0] ** 2)).max() < sidak_z(3, CHANCE) * 0.27
    others = np.delete(floor, hot)
    assert np.median(others) / SIGMA**2 == pytest.approx(1, abs=0.07)
    assert (others > np.median(others)).sum() <= 2  # expected: 600 x 1e-5


def test_images_without_noise_have_none():
    for background in (0.0, 7.3):
        curves = np.tile(profile() + background, (CURVES, 1))
        np.testing.assert_array_equal(dark_noise(windows_of(curves), False), 0.0)


def test_missing_samples_and_frames_that_do_not_count_do_not_matter():
    curves = drawn()
    curves[np.random.default_rng(1).random(curves.shape) < 0.2] = np.nan
    curves[:, 3] += 100.0
    floor = dark_noise(windows_of(curves, np.arange(LINES) != 3), False)
    assert np.median(floor) / SIGMA**2 == pytest.approx(1, abs=0.08)


def test_a_scan_without_dark_samples_tells_nothing():
    curves = drawn()[:, 16:25]
    np.testing.assert_array_equal(dark_noise(windows_of(curves), False), 0.0)


# --- growth with the light ----------------------------------------------------------------------------------


@pytest.mark.parametrize("per_light", [2e-4, 1e-3, 1e-2])
def test_the_growth_of_the_noise_with_the_light_is_what_was_put_in(per_light):
    windows = windows_of(drawn(per_light))
    noise = noise_with_light(windows, fits_of(windows), DARK)
    np.testing.assert_array_equal(noise.floor, SIGMA**2)
    # 600 x 7 samples: 2.2 % of their variance, and a median of seven frames
    assert noise.per_light == pytest.approx(per_light, abs=5 * 0.04 * (per_light + SIGMA**2))


def test_noise_that_does_not_grow_is_told_not_to():
    found = []
    for seed in range(30):
        windows = windows_of(drawn(seed=seed))
        found.append(noise_with_light(windows, fits_of(windows), DARK).per_light)
    assert np.count_nonzero(found) <= 3  # beyond 3 standard errors by chance: 0.04 expected; medians have wider tails
    assert max(found) < 0.2 * SIGMA**2


def test_a_wrong_frame_is_no_noise_of_the_light():
    """The typical frame tells the growth, if the wrong one is one of many in the same curves."""
    windows = windows_of(drawn(1e-3))
    fits = fits_of(windows)
    here = windows.lines == LINES // 2 + 2
    wrong = dataclasses.replace(fits, residual=fits.residual + 0.1 * here)
    right, found = (noise_with_light(windows, f, DARK).per_light for f in (fits, wrong))
    assert right == pytest.approx(1e-3, rel=0.2)
    assert found < 1.3 * right


def test_the_scatter_of_exposures_tells_the_growth_too():
    windows = windows_of(drawn())
    truth = SIGMA**2 + 5e-3 * fits_of(windows).modelled
    random = np.random.default_rng(2)
    scatter = truth * random.chisquare(7, truth.shape) / 7
    noise = noise_with_light(windows, fits_of(windows), DARK, scatter)
    assert noise.per_light == pytest.approx(5e-3, rel=0.1)


def test_curves_without_a_fit_tell_nothing():
    windows = windows_of(drawn(1e-2))
    fits = fits_of(windows)
    fits.place_mm[:] = np.nan
    assert noise_with_light(windows, fits, DARK).per_light == 0.0


@pytest.mark.parametrize("exposures", [None, 8])
def test_the_noise_of_whole_images_is_what_was_put_in(exposures):
    """Read noise and photons, through all steps of an estimate: single, and as the mean of several exposures."""
    scene = small(25)
    images = images_of(scene)
    electrons = 5000.0 / images.peak
    random = np.random.default_rng(3)
    read, count = 20.0, exposures or 1

    def expose(light):
        shape = light.shape if exposures is None else (exposures, *light.shape)
        return random.poisson(np.broadcast_to(light * electrons, shape)) + random.normal(0, read, shape)

    for estimate in estimate_centroids(images.each(expose).stack(), setup_of(scene), "likelihood"):
        assert np.median(estimate.noise.floor) == pytest.approx(read**2 / count, rel=0.15)
        assert estimate.noise.per_light == pytest.approx(1 / count, rel=0.15)  # an electron's variance is its number
