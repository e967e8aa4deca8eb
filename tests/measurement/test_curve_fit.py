"""Fits of light curves: exact without noise, unbiased with it, with standard errors that are the scatter's.

Images are of the design itself, whose profiles the fits use: what is left is the fit's own.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
from noisy_images import images_of, setup_of, small
from significance import sidak_z

from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.measurement.curve_fit import (
    Profiles,
    SampleNoise,
    centroid_fits,
    covariances,
    fit_profiles,
    relinearised,
)
from irtscots_cl.measurement.curve_windows import find_light, line_pitch, place_windows

SCENE = small(25).nominal()
PITCH = SCENE.screen.pitch_mm
CHANCE = 1e-6  # of a failure of right code, for every test
DRAWS = 30


@cache
def whole_pixels() -> np.ndarray:
    """Pixels whose own area and whose light lie on mirror and screen altogether."""
    light = setup_of(SCENE).pixel_response
    middle, half = light.extent("u")
    inside = (np.abs(middle) + half < 1.7) & (light.coverage() > 0.999) & light.valid()
    return light.pixels[inside]


def scan_of(pixels: np.ndarray, curves: np.ndarray) -> Scan:
    """The x scan with these curves [n, lines] of different pixels [n]."""
    scan = images_of(SCENE).stack().x
    return dataclasses.replace(
        scan,
        pixels=pixels,
        first_line=np.zeros(len(pixels), np.int64),
        flux_w=curves[None],
        hits=np.full(len(pixels), np.nan),
    )


def clean(pixels: np.ndarray) -> np.ndarray:
    """Noise-free curves [n, lines], whose highest sample is 1."""
    curves = images_of(SCENE).stack().x.flux_w[0][pixels]
    return curves / curves.max()


class Fit:
    """Everything that a fit of some curves needs and gives."""

    def __init__(self, pixels, curves, noise: SampleNoise, gain=None, tilted=False, usable=None):
        setup = setup_of(SCENE)
        scan = self.scan = scan_of(pixels, curves)
        half_width, box_row, box_column = setup.chief_rays.light_shape(0)
        reach = (half_width + (box_row + box_column) / 2).ravel()[pixels]
        usable = np.ones(curves.shape[1], bool) if usable is None else usable
        places = find_light(scan, curves, reach, usable)
        self.windows = place_windows(scan, curves, places, reach, usable, float(reach.max()))
        gain = np.ones(curves.shape[1]) if gain is None else gain
        self.gain = gain[np.clip(self.windows.lines, 0, len(gain) - 1)]
        self.noise, self.tilted = noise, tilted
        self.profiles = Profiles(scan, setup.pixel_response)
        start = scan.positions_mm[0] + line_pitch(scan) * places
        rough, _ = fit_profiles(self.windows, self.profiles, noise, self.gain, start, tilted)
        self.fits, self.inverse = fit_profiles(
            self.windows, self.profiles, noise, self.gain, rough.place_mm, tilted, exact=True
        )
        self.error_mm, self.bound_mm = covariances(self.windows, self.fits, noise, tilted)
        self.truth_mm = setup.pixel_response.means("u")[0][self.profiles.index]

    @property
    def lines(self) -> np.ndarray:
        """Errors of the places, in lines."""
        return (self.fits.place_mm - self.truth_mm) / PITCH

    @property
    def pulls(self) -> np.ndarray:
        return (self.fits.place_mm - self.truth_mm) / self.error_mm


def some(count: int = 24) -> np.ndarray:
    pixels = whole_pixels()
    return pixels[np.linspace(0, len(pixels) - 1, count).astype(int)]


def drawn(deviation, per_light: float = 0.0, background=0.0, seed: int = 0, missing: float = 0.0, **options):
    """DRAWS fits of all whole pixels' noisy curves."""
    pixels = whole_pixels()
    light = clean(pixels)
    random = np.random.default_rng(seed)
    noise = SampleNoise(np.full(len(pixels), deviation**2), per_light)
    fits = []
    for _ in range(DRAWS):
        curves = light + background + random.normal(size=light.shape) * np.sqrt(deviation**2 + per_light * light)
        curves[random.random(curves.shape) < missing] = np.nan
        fits.append(Fit(pixels, curves, noise, **options))
    return fits


def pooled(fits: list[Fit], name: str) -> np.ndarray:
    """[draws, pixels] of a property of every fit, or of its fits."""
    return np.stack([getattr(fit, name) if hasattr(fit, name) else getattr(fit.fits, name) for fit in fits])


def assert_pulls(pulls: np.ndarray) -> None:
    """[draws, pixels]: of mean 0 for each pixel and all together, and of standard deviation 1 in all parts."""
    assert np.isfinite(pulls).all()
    of_pixel = pulls.mean(0) * np.sqrt(len(pulls))
    assert np.abs(of_pixel).max() < sidak_z(pulls.shape[1], CHANCE)
    assert abs(pulls.mean()) < 3 / np.sqrt(pulls.size)
    assert 0.93 < pulls.std() < 1.07
    for part in np.array_split(pulls, 8, axis=1):  # of the detector: rows from the first to the last
        assert abs(part.std() - 1) < sidak_z(8, CHANCE) / np.sqrt(2 * part.size)


# --- without noise ------------------------------------------------------------------------------------------


def test_places_without_noise_are_the_closed_form_s():
    pixels = whole_pixels()
    fit = Fit(pixels, clean(pixels), SampleNoise(np.zeros(len(pixels)), 0.0))
    assert len(pixels) > 250
    assert np.median(np.abs(fit.lines)) < 1e-4
    assert np.abs(fit.lines).max() < 2e-4  # 40 nm on the screen, of detector pixels 5 times too large
    assert np.abs(fit.fits.residual).max() < 2e-3  # of the peak
    np.testing.assert_allclose(fit.fits.level, 0, atol=3e-4)


def test_images_without_noise_have_no_error():
    fit = Fit(some(), clean(some()), SampleNoise(np.zeros(24), 0.0))
    np.testing.assert_array_equal(fit.error_mm, 0.0)
    np.testing.assert_allclose(fit.bound_mm, 0.0, atol=1e-12)


@pytest.mark.parametrize("away", [-1.3, 0.6, 1.3])
def test_a_start_one_line_away_leads_to_the_same_place(away):
    fit = Fit(some(), clean(some()), SampleNoise(np.zeros(24), 0.0))
    again, _ = fit_profiles(fit.windows, fit.profiles, fit.noise, fit.gain, fit.truth_mm + away * PITCH, fit.tilted)
    np.testing.assert_allclose(again.place_mm, fit.truth_mm, atol=1e-3 * PITCH)


def test_gains_of_frames_that_are_known_move_no_place():
    gain = 1 + 0.3 * np.sin(np.arange(21.0))
    fit = Fit(some(), clean(some()) * gain, SampleNoise(np.zeros(24), 0.0), gain=gain)
    assert np.abs(fit.lines).max() < 1e-3
    assert np.abs(Fit(some(), clean(some()) * gain, fit.noise).lines).max() > 0.1  # unknown ones do


# --- noise --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("deviation", "per_light", "background", "tilted"),
    [(0.002, 0.0, 0.0, False), (0.01, 0.0, 0.0, False), (0.01, 0.0, 0.2, False), (0.01, 0.0, -0.1, False),
     (0.003, 1e-3, 0.05, False), (0.01, 0.0, "slope", True)],
)  # fmt: skip
def test_fits_are_unbiased_and_their_errors_are_the_scatter(deviation, per_light, background, tilted):
    if background == "slope":
        background = 0.1 + 0.004 * np.arange(21)
    fits = drawn(deviation, per_light, background, tilted=tilted, seed=7)
    assert_pulls(pooled(fits, "pulls"))
    if deviation >= 0.01:  # with less noise the profile's own error counts, too
        chi_square = pooled(fits, "chi_square") / pooled(fits, "freedom")
        assert abs(chi_square.mean() - 1) < 0.1  # `freedom` leaves out what the background takes
    if tilted:
        np.testing.assert_allclose(pooled(fits, "slope").mean(), 0.004, atol=3e-5)


def test_a_background_s_slope_that_is_not_fitted_moves_places():
    """Or the test of fitting it would test nothing."""
    fits = drawn(0.003, 0.0, 0.1 + 0.004 * np.arange(21), tilted=False)
    assert abs(pooled(fits, "pulls").mean()) > 1


@pytest.mark.parametrize("per_light", [0.0, 1e-3])
@pytest.mark.parametrize("deviation", [1e-4, 0.003, 0.02])
def test_no_error_is_below_the_bound(deviation, per_light):
    fit = drawn(deviation, per_light)[0]
    assert (fit.bound_mm > 0).all()
    assert (fit.bound_mm <= fit.error_mm * (1 + 1e-9)).all()
    if deviation >= 0.003:  # there the weights are the noise's own
        assert np.median(fit.error_mm / fit.bound_mm) < 1.06


def test_the_error_grows_with_the_noise():
    one, ten = (np.median(drawn(deviation)[0].error_mm) for deviation in (0.001, 0.01))
    assert ten / one == pytest.approx(10, rel=0.15)


def test_other_samples_by_one_step_are_where_a_fit_finds_them():
    """As the exposures that are left out in turn: their differences are of the size of noise."""
    pixels = whole_pixels()
    random = np.random.default_rng(4)
    noise = SampleNoise(np.full(len(pixels), 0.003**2), 0.0)
    mean = clean(pixels) + random.normal(0, 0.003, (len(pixels), 21))
    other = mean + random.normal(0, 0.001, mean.shape)
    fit, refit = Fit(pixels, mean, noise), Fit(pixels, other, noise)
    same = (fit.windows.first == refit.windows.first) & (fit.windows.allowed == refit.windows.allowed).all(1)
    assert same.mean() > 0.9
    moved = relinearised(fit.fits, fit.windows, noise, fit.inverse, refit.windows)[same]
    change = (refit.fits.place_mm - fit.fits.place_mm)[same]
    assert np.std(moved - refit.fits.place_mm[same]) < 0.05 * np.std(change)  # second order of small changes


# --- samples that are missing, curves that are none ---------------------------------------------------------


def test_missing_samples_are_left_out():
    fits, complete = drawn(0.01, missing=0.05, seed=5), drawn(0.01, seed=5)
    holes = [f.windows.allowed.sum(1) < c.windows.allowed.sum(1) for f, c in zip(fits, complete, strict=True)]
    assert 0.1 < np.mean(holes) < 0.9
    assert_pulls(pooled(fits, "pulls"))
    lost = np.median(pooled(fits, "error_mm")[holes]) / np.median(pooled(complete, "error_mm")[holes])
    assert lost > 1.02  # what is missing tells nothing


def test_curves_of_noise_have_no_place_or_one_with_a_large_error_and_nothing_infinite():
    random = np.random.default_rng(6)
    pixels = whole_pixels()
    noise = SampleNoise(np.full(len(pixels), 1e-4), 0.0)
    fit = Fit(pixels, random.normal(0, 0.01, (len(pixels), 21)), noise)
    for name in ("place_mm", "flux", "level", "slope", "modelled", "derivative", "residual", "chi_square"):
        assert not np.isinf(getattr(fit.fits, name)).any(), name
    found = np.isfinite(fit.fits.place_mm)
    assert (~found).mean() > 0.05
    assert np.nanmedian(fit.error_mm[found]) > 20 * np.median(drawn(0.01)[0].error_mm)
    assert np.isfinite(fit.fits.residual).all() and (fit.fits.modelled[~found] == 0).all()


def test_light_on_frames_that_do_not_count_is_none():
    """A fit may put any flux there: nothing contradicts it."""
    pixels = some()
    peak = np.argmax(clean(pixels), 1)
    pixels = pixels[np.abs(peak - 10) <= 1]
    assert len(pixels) >= 2
    usable = np.abs(np.arange(21) - 10) > 7
    curves = clean(pixels) + np.random.default_rng(8).normal(0, 0.01, (len(pixels), 21))
    fit = Fit(pixels, curves, SampleNoise(np.full(len(pixels), 1e-4), 0.0), usable=usable)
    light = clean(pixels).sum(1)
    assert not (fit.fits.flux > 0.1 * light).any()  # NaN, or the noise of the samples that are left
    assert np.isnan(fit.fits.flux).any()


def test_a_pixel_without_a_profile_has_no_fit():
    scene_pixels = np.array([0, 24, *some(3)])  # corners of the detector see no mirror
    curves = clean(some(1)).repeat(5, 0)
    scan = scan_of(scene_pixels, curves)
    known = Profiles(scan, setup_of(SCENE).pixel_response).known
    assert known.tolist() == [False, False, True, True, True]


# --- centroids ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("background", "tilted"), [(0.0, False), (0.2, False), (0.1 + 0.004 * np.arange(21), True)])
def test_centroids_of_windows_are_unbiased_too(background, tilted):
    fits = drawn(0.01, background=background, tilted=tilted, seed=9)
    found = [centroid_fits(fit.windows, fit.noise, fit.gain, fit.scan, tilted) for fit in fits]
    place, error, flux = (np.stack(values) for values in zip(*found, strict=True))
    away = (place - fits[0].truth_mm) / PITCH
    pulls = (away - away.mean(0)) * PITCH / error
    assert 0.93 < pulls.std() * np.sqrt(DRAWS / (DRAWS - 1)) < 1.07
    # sampling by lines moves a centroid by thousandths of a line; beyond that noise has mean 0
    limit = 0.01 + sidak_z(away.shape[1], CHANCE) * error.mean(0) / PITCH / np.sqrt(DRAWS)
    assert (np.abs(away.mean(0)) < limit).all()
    assert 1.0 < np.median(error / pooled(fits, "error_mm")) < 2.0  # less noise is what the profile is for
    np.testing.assert_allclose(flux.mean(), pooled(fits, "flux").mean(), rtol=0.01)


def test_a_gap_in_the_window_leaves_no_centroid():
    pixels = some()
    curves = clean(pixels)
    curves[3, np.argmax(curves[3]) + 1] = np.nan
    fit = Fit(pixels, curves, SampleNoise(np.zeros(24), 0.0))
    place, error, flux = centroid_fits(fit.windows, fit.noise, fit.gain, fit.scan, False)
    for values in (place, error, flux):
        assert np.flatnonzero(np.isnan(values)).tolist() == [3]
    assert np.isfinite(fit.fits.place_mm[3])  # the profile needs no complete curve


# --- noise of samples ---------------------------------------------------------------------------------------


def test_weights_are_those_of_the_noise_and_stay_finite_without_any():
    light = np.array([[0.0, 0.5, 1.0, 0.5, 0.0]])
    noise = SampleNoise(np.array([0.04]), 0.1)
    np.testing.assert_allclose(noise.variance(light), [[0.042, 0.09, 0.14, 0.09, 0.042]])  # at least 2 % of the peak
    np.testing.assert_allclose(noise.weight(light), 1 / noise.variance(light), rtol=1e-4)
    for values in (light, np.zeros_like(light), 1e-300 * light):
        weight = SampleNoise(np.zeros(1), 0.0).weight(values)
        assert np.isfinite(weight).all() and (weight > 0).all()
