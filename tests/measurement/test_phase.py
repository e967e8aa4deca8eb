"""Phases of known samples: their values, their error bars, what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.imaging.fringes import equal_steps
from irtscots_cl.measurement import phase as phase_module
from irtscots_cl.measurement.fringe_noise import estimate_noise
from irtscots_cl.measurement.harmonics import wrapped
from irtscots_cl.measurement.phase import FrameNoise, fit_sinusoid

PIXELS = 40_000
FAILURE_CHANCE = 1e-6  # of each statistical test here, by its limits in standard errors
Z = float(stats.norm.isf(FAILURE_CHANCE / 4))
UNEQUAL = (0.0, 0.7, 2.0, 3.1, 4.4)


def samples_of(phase, steps, offset=110.0, amplitude=90.0):
    return offset + amplitude * np.cos(phase - np.asarray(steps)[:, None])


def noisy(mean, noise: FrameNoise, seed=1):
    return mean + np.random.default_rng(seed).normal(size=mean.shape) * np.sqrt(noise.variance(mean))


def phases(seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, PIXELS)


@pytest.mark.parametrize("steps", [equal_steps(3), equal_steps(4), equal_steps(16), UNEQUAL], ids=len)
def test_samples_without_noise_give_offset_amplitude_and_phase(steps):
    phase = phases()
    fit = fit_sinusoid(samples_of(phase, steps), np.array(steps))
    np.testing.assert_allclose(wrapped(fit.phase_rad - phase), 0, atol=1e-13)  # rounding of numbers near 100
    np.testing.assert_allclose(fit.amplitude, 90, rtol=1e-12)
    np.testing.assert_allclose(fit.offset, 110, rtol=1e-12)
    np.testing.assert_array_equal(fit.freedom, len(steps) - 3)


def test_four_equal_steps_are_the_four_bucket_formula():
    values = np.random.default_rng(3).uniform(0, 255, (4, 100))
    fit = fit_sinusoid(values, np.array(equal_steps(4)))
    np.testing.assert_allclose(fit.phase_rad, np.arctan2(values[1] - values[3], values[0] - values[2]), atol=1e-12)
    expected = ((values[0] - values[1] + values[2] - values[3]) / 2) ** 2
    np.testing.assert_allclose(fit.square, expected, rtol=1e-9)


@pytest.mark.parametrize("noise", [FrameNoise(4.0), FrameNoise(0.5, 0.05)], ids=["even", "photons"])
@pytest.mark.parametrize("steps", [equal_steps(3), equal_steps(4), equal_steps(8), UNEQUAL], ids=len)
def test_phase_errors_are_normal_with_their_error_bars(steps, noise):
    """Pulls with mean 0 and variance 1: also with three steps and photon noise, whose error depends on the phase."""
    phase = phases()
    fit = fit_sinusoid(noisy(samples_of(phase, steps), noise), np.array(steps))
    pull = wrapped(fit.phase_rad - phase) / fit.phase_error_rad(noise)
    assert abs(pull.mean()) < Z / np.sqrt(PIXELS)
    # the second-order terms of noise over amplitude, 0.02 here, add up to 1e-3 of the variance
    assert abs(pull.var() - 1) < Z * np.sqrt(2 / PIXELS) + 1e-3


def test_photon_noise_at_three_steps_depends_on_the_phase():
    noise = FrameNoise(0.0, 1.0)
    fit = fit_sinusoid(samples_of(phases(), equal_steps(3)), np.array(equal_steps(3)))
    error = fit.phase_error_rad(noise)
    assert error.max() > 1.5 * error.min()


@pytest.mark.parametrize("steps", [equal_steps(4), equal_steps(5), equal_steps(12)], ids=len)
@pytest.mark.parametrize("noise", [FrameNoise(4.0), FrameNoise(0.5, 0.05)], ids=["even", "photons"])
def test_noise_is_found_in_the_residuals(steps, noise):
    random = np.random.default_rng(5)
    offset = random.uniform(40, 200, PIXELS)
    mean = samples_of(phases(), steps, offset, 0.8 * offset)
    fit = fit_sinusoid(noisy(mean, noise), np.array(steps))
    found = estimate_noise(fit.square, fit.freedom.astype(float), fit.offset)
    for level in (40.0, 120.0, 200.0):
        # Few degrees of freedom of unequal samples have other tails than the trimmed mean allows for: 3 %
        assert found.variance(level) == pytest.approx(noise.variance(level), rel=0.05)


def test_noise_does_not_follow_a_few_broken_pixels():
    mean = samples_of(phases(), equal_steps(6))
    values = noisy(mean, FrameNoise(4.0))
    values[2, : PIXELS // 50] += 60  # 2 % of the pixels
    fit = fit_sinusoid(values, np.array(equal_steps(6)))
    found = estimate_noise(fit.square, fit.freedom.astype(float), fit.offset)
    assert found.variance(110.0) == pytest.approx(4.0, rel=0.06)


def test_three_steps_say_nothing_of_the_noise():
    fit = fit_sinusoid(noisy(samples_of(phases(), equal_steps(3)), FrameNoise(4.0)), np.array(equal_steps(3)))
    assert estimate_noise(fit.square, fit.freedom.astype(float), fit.offset) is None
    assert np.isnan(fit.residual_rms).all()


def test_saturated_samples_are_left_out():
    """Half of all pixels are cut off at their peaks: without these samples the phases are exact, with them far off."""
    phase, steps = phases(), np.array(equal_steps(8))
    values = np.minimum(samples_of(phase, steps), 160.0)
    assert np.mean((values >= 160).any(0)) > 0.5
    fit = fit_sinusoid(values, steps, saturation=160.0)
    np.testing.assert_allclose(wrapped(fit.phase_rad - phase), 0, atol=1e-12)
    assert (fit.samples < 8).any()
    cut = fit_sinusoid(values, steps)
    assert np.abs(wrapped(cut.phase_rad - phase)).max() > 0.02


def test_integers_and_missing_samples():
    phase, steps = phases()[:1000], np.array(equal_steps(8))
    exact = samples_of(phase, steps)
    whole = np.rint(exact).astype(np.uint8)
    by_integers, by_floats = (fit_sinusoid(v, steps, saturation=190) for v in (whole, whole.astype(float)))
    np.testing.assert_array_equal(by_integers.phase_rad, by_floats.phase_rad)
    exact[3] = np.nan
    np.testing.assert_allclose(wrapped(fit_sinusoid(exact, steps).phase_rad - phase), 0, atol=1e-12)


def test_error_bars_hold_where_samples_are_left_out():
    phase, steps, noise = phases(), np.array(equal_steps(8)), FrameNoise(1.0)
    values = noisy(samples_of(phase, steps), noise)
    missing = np.random.default_rng(7).uniform(size=values.shape) < 0.3  # by chance, not by their value
    values[missing] = np.nan
    fit = fit_sinusoid(values, steps)
    error = fit.phase_error_rad(noise)
    good = np.isfinite(error) & (error < 0.1)
    pull = (wrapped(fit.phase_rad - phase) / error)[good]
    assert abs(pull.mean()) < Z / np.sqrt(good.sum())
    assert abs(pull.var() - 1) < Z * np.sqrt(2 / good.sum()) + 5e-3


def test_too_few_samples_give_no_phase():
    steps = np.array([0, np.pi / 2, np.pi, 2 * np.pi])  # the last is the first again
    values = samples_of(np.array([0.3, 0.3, 0.3]), steps)
    values[1, 1] = np.nan  # leaves 0, pi, 2 pi: the sine is unknown
    values[:2, 2] = np.nan  # leaves two
    fit = fit_sinusoid(values, steps)
    assert np.isfinite(fit.phase_rad[0]) and np.isnan(fit.phase_rad[1:]).all()
    assert np.isnan(fit.phase_error_rad(FrameNoise(1.0))[1:]).all()


def test_a_pixel_without_amplitude_has_an_infinite_error():
    fit = fit_sinusoid(np.full((4, 1), 7.0), np.array(equal_steps(4)))
    error = fit.phase_error_rad(FrameNoise(1.0))[0]
    assert error > 1e6  # rounding may leave an amplitude of 1e-15


def test_pieces_and_neighbours_do_not_change_a_fit(monkeypatch):
    """Pixels alone, in blocks and all together; also of more steps than a word has bits."""
    for count in (5, 70):
        steps = np.array(equal_steps(count))
        amplitude = np.random.default_rng(9).uniform(30, 90, 3000)
        values = np.minimum(samples_of(phases()[:3000], steps, 110.0, amplitude), 170.0)
        whole = fit_sinusoid(values, steps, 170.0)
        assert 0.2 < len(whole.incomplete) / 3000 < 0.9
        monkeypatch.setattr(phase_module, "FEWEST_AT_ONCE", 7)
        monkeypatch.setattr(phase_module, "BLAS_TASK", 1)
        for part in (slice(0, 1), slice(1, 1000), slice(1000, 3000)):
            some = fit_sinusoid(values[:, part], steps, 170.0)
            for name in ("offset", "cosine", "sine", "square"):
                np.testing.assert_allclose(getattr(some, name), getattr(whole, name)[part], rtol=1e-9, atol=1e-9)
        monkeypatch.undo()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_left_out_also_without_a_ceiling(bad):
    steps = np.array(equal_steps(6))
    values = samples_of(phases()[:50], steps)
    values[2, 7] = bad
    fit = fit_sinusoid(values, steps)
    assert fit.incomplete.tolist() == [7]
    np.testing.assert_allclose(wrapped(fit.phase_rad - phases()[:50]), 0, atol=1e-12)
