"""Harmonics: what gamma makes, what images with few steps can show of it, and phases without it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from irtscots_cl.imaging.fringes import equal_steps
from irtscots_cl.measurement.harmonics import (
    ResponseTable,
    correct_phase,
    error_gain,
    gamma_harmonics,
    gamma_of,
    phase_bias,
    response_harmonics,
    second_harmonic,
    without_harmonics,
    wrapped,
)
from irtscots_cl.measurement.phase import FrameNoise, fit_sinusoid

PIXELS = 20_000
FAILURE_CHANCE = 1e-6
Z = float(stats.norm.isf(FAILURE_CHANCE / 2))


def samples_of(phase, steps, gamma, scale=200.0):
    return scale * (0.5 + 0.5 * np.cos(phase - np.asarray(steps)[:, None])) ** gamma


def phases(seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, PIXELS)


@pytest.mark.parametrize("gamma", [0.45, 1.0, 1.8, 2.2, 3.0])
def test_the_closed_form_is_the_fourier_series(gamma):
    shown = np.linspace(0, 1, 20_001) ** 3
    np.testing.assert_allclose(
        gamma_harmonics(gamma), response_harmonics(shown, shown**gamma), atol=1e-6
    )  # of the interpolation between entries


def test_gamma_2_2_at_four_steps_moves_phases_by_0_0106_rad():
    """The known size: third less fifth harmonic, as the sine of four times the phase."""
    phase, steps = 2 * np.pi * np.arange(PIXELS) / PIXELS, np.array(equal_steps(4))
    bias = wrapped(fit_sinusoid(samples_of(phase, steps, 2.2), steps).phase_rad - phase)
    size = -2 * np.mean(bias * np.sin(4 * phase))
    assert size == pytest.approx(0.0106, abs=5e-5)
    harmonics = gamma_harmonics(2.2)
    assert size == pytest.approx(harmonics[3] - harmonics[5], rel=2e-3)  # the square of 0.01
    np.testing.assert_allclose(bias, phase_bias(phase, steps, harmonics), atol=2e-5)  # harmonics beyond the ninth


@pytest.mark.parametrize("steps", [3, 4, 5, 8, (0.0, 0.7, 2.0, 3.1, 4.4)], ids=str)
@pytest.mark.parametrize("gamma", [0.6, 2.2])
def test_phases_are_right_once_harmonics_are_taken_out(steps, gamma):
    steps = np.array(equal_steps(steps) if isinstance(steps, int) else steps)
    phase = phases()
    found = fit_sinusoid(samples_of(phase, steps, gamma), steps).phase_rad
    left = wrapped(correct_phase(found, steps, gamma_harmonics(gamma)) - phase)
    # 0.6: the harmonics from the tenth on, left out, are still up to 2e-3 of the first
    assert np.abs(left).max() < (5e-5 if gamma > 1 else 1e-2) * (3 if len(steps) == 3 else 1)


@pytest.mark.parametrize("count", [4, 5, 8])
def test_images_alone_tell_gamma(count):
    """From the residuals, without bias: pulls over repeats within their limit."""
    steps, pulls = np.array(equal_steps(count)), []
    for seed in range(20):
        values = samples_of(phases(seed)[:4000], steps, 2.2)
        values += np.random.default_rng(100 + seed).normal(size=values.shape)
        found = second_harmonic(values, fit_sinusoid(values, steps))
        pulls.append((found.ratio - (2.2 - 1) / (2.2 + 2)) / found.standard_error)
        assert found.is_seen and found.gamma == pytest.approx(2.2, abs=0.01)
        assert gamma_of(found.ratio) == pytest.approx(found.gamma)
    # bias below a fifth of a standard error: that of harmonics beyond the ninth
    assert abs(np.mean(pulls)) < Z / np.sqrt(20) + 0.2
    assert 0.15 < np.var(pulls) < 3.5  # chance of failure 1e-6


def test_an_even_screen_has_no_second_harmonic():
    steps = np.array(equal_steps(4))
    values = samples_of(phases(), steps, 1.0) + np.random.default_rng(1).normal(size=(4, PIXELS))
    found = second_harmonic(values, fit_sinusoid(values, steps))
    assert abs(found.ratio) < Z * found.standard_error and not found.is_seen


def test_three_steps_show_no_harmonic():
    steps = np.array(equal_steps(3))
    values = samples_of(phases(), steps, 2.2)
    assert np.isnan(second_harmonic(values, fit_sinusoid(values, steps)).ratio)


def test_error_bars_follow_the_correction():
    """With three steps gamma 2.2 nearly folds the phases: errors grow where it is taken out."""
    steps, harmonics = np.array(equal_steps(3)), gamma_harmonics(2.2)
    phase = phases()
    values = samples_of(phase, steps, 2.2) + 0.1 * np.random.default_rng(1).normal(size=(3, PIXELS))
    fit = fit_sinusoid(values, steps)
    error = fit.phase_error_rad(FrameNoise(0.01)) * error_gain(fit.phase_rad, steps, harmonics)
    pull = wrapped(correct_phase(fit.phase_rad, steps, harmonics) - phase) / error
    assert np.var(pull) == pytest.approx(1.0, abs=Z * np.sqrt(2 / PIXELS) + 0.03)  # second order in the noise
    assert error.max() > 3 * error.min()


def test_harmonics_that_fold_phases_are_refused():
    steps = np.array(equal_steps(3))
    with pytest.raises(ValueError, match="too strong for 3 steps: two phases look the same; must be taken with more"):
        correct_phase(phases(), steps, np.array([1.0, 1.0, 1.2, 0.0]))


def test_a_table_inverted_and_its_harmonics_taken_out_are_the_same():
    shown = np.linspace(0, 255, 27)
    table = ResponseTable(shown, 3 + 230 * (shown / 255) ** 1.9)
    phase, steps = phases(), np.array(equal_steps(4))
    light = np.interp(255 * (0.5 + 0.5 * np.cos(phase - steps[:, None])), table.shown, table.camera)
    bright = np.random.default_rng(3).uniform(0.3, 1.0, PIXELS)  # pixels differ
    dark, white = bright * table.camera[0], bright * table.camera[-1]
    straight = fit_sinusoid(table.linearised(bright * light, dark, white), steps).phase_rad
    np.testing.assert_allclose(wrapped(straight - phase), 0, atol=1e-9)
    taken_out = correct_phase(fit_sinusoid(bright * light, steps).phase_rad, steps, table.harmonics)
    np.testing.assert_allclose(wrapped(taken_out - phase), 0, atol=1e-3)  # kinks of the table beyond its ninth harmonic


@pytest.mark.parametrize(
    ("shown", "camera", "message"),
    [
        ([0, 1], [0, 1], "must be two rows of at least three numbers"),
        ([0, 1, 2], [0, 1], "must be two rows"),
        ([0, 1, 1], [0, 1, 2], "the values shown must be finite and grow"),
        ([0, 1, 2], [0, 2, 1], "the camera values must be finite and grow"),
        ([0, 1, 2], [0, 2, np.nan], "the camera values must be finite and grow"),
    ],
)
def test_tables_that_cannot_be_inverted_are_refused(shown, camera, message):
    with pytest.raises(ValueError, match=message):
        ResponseTable(np.array(shown, float), np.array(camera, float))


def test_a_pixel_without_some_samples_does_not_depend_on_the_others():
    random, steps = np.random.default_rng(4), np.array(equal_steps(8))
    ratios, angle = gamma_harmonics(2.2), random.uniform(-np.pi, np.pi, 400) - steps[:, None]
    values = np.minimum(100 + 60 * sum(ratios[k] * np.cos(k * angle) for k in range(1, 10)), 140.0)
    whole = without_harmonics(values, fit_sinusoid(values, steps, 140.0), ratios)
    for part in (slice(0, 3), slice(3, 200)):
        some = without_harmonics(values[:, part], fit_sinusoid(values[:, part], steps, 140.0), ratios)
        np.testing.assert_allclose(some.phase_rad, whole.phase_rad[part], atol=1e-12)
    assert len(whole.incomplete) > 50
    np.testing.assert_allclose(wrapped(whole.phase_rad[whole.incomplete] - angle[0, whole.incomplete]), 0, atol=1e-6)
