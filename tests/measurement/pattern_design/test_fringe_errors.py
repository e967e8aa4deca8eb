"""Errors of phases and places by fringes before there are images: closed forms, and many simulated pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from designed import CAMERA, wide_sphere

from irtscots_cl.imaging.fringes import equal_steps
from irtscots_cl.measurement.pattern_design.fringe_errors import (
    Fringes,
    emitted,
    phase_bounds,
    phase_errors,
    place_errors_mm,
    signal_of,
)
from irtscots_cl.measurement.pattern_design.pixels import seen_pixels
from irtscots_cl.measurement.phase import fit_sinusoid


@pytest.fixture(scope="module")
def seen():
    return seen_pixels(wide_sphere())


@pytest.mark.parametrize("steps", [4, 5, 8])
def test_phase_error_in_closed_form(seen, steps):
    """sqrt(2 / N) times the noise at the mean signal over the amplitude; its place error by the period."""
    periods = 3.0
    fringes = Fringes("geometric", (periods,), steps)
    error = phase_errors(seen, CAMERA, 0, fringes, fringes.frames)[0]
    electrons = CAMERA.electrons * seen.bright
    variance = 2.5**2 + 2.44**2 / 12 + electrons / 2
    expected = np.sqrt(2 / steps * variance) / (electrons / 2 * seen.modulation_at(0, periods))
    assert error == pytest.approx(expected, rel=1e-9)
    place = place_errors_mm(seen, 0, (periods,), error[None])
    assert place == pytest.approx(expected * 401 * 0.05 / periods / (2 * np.pi), rel=1e-9)
    # twice the frames
    assert phase_errors(seen, CAMERA, 0, fringes, 2 * fringes.frames)[0] == pytest.approx(error / np.sqrt(2))


@pytest.mark.parametrize("steps", [3, 4])
def test_phase_error_of_simulated_pixels(seen, steps):
    """20000 draws of one pixel: 0.5 %; with three steps and the light's noise it depends on the phase."""
    fringes = Fringes("geometric", (2.0,), steps)
    signal = signal_of(seen, CAMERA, 0, 2.0)
    random = np.random.default_rng(1)
    k = int(np.argmax(seen.bright))
    phase, angle = 2 * np.pi * 2.0 * seen.fraction(0)[k], np.array(equal_steps(steps))[:, None]
    mean = signal.offset_e[k] + signal.amplitude_e[k] * np.cos(phase - angle)
    samples = random.poisson(np.broadcast_to(mean, (steps, 20000))) + 2.6 * random.standard_normal((steps, 20000))
    found = fit_sinusoid(samples, angle[:, 0]).phase_rad
    expected = phase_errors(seen, replace(CAMERA, read_noise_e=2.6, step_e=0.0), 0, fringes, fringes.frames)[0, k]
    assert np.std(np.angle(np.exp(1j * (found - phase)))) == pytest.approx(expected, rel=0.025)  # 5 sigma


def test_bounds_are_the_errors_where_all_samples_have_the_same_noise(seen):
    fringes = Fringes("geometric", (0.9, 5.0), 6)
    quiet = replace(CAMERA, shot=False)
    error, bound = (one(seen, quiet, 1, fringes, 24.0) for one in (phase_errors, phase_bounds))
    assert bound == pytest.approx(error, rel=1e-6)
    error, bound = (one(seen, CAMERA, 1, fringes, 24.0) for one in (phase_errors, phase_bounds))
    assert (bound < error).all() and (bound > 0.7 * error).all()  # dark samples know more than least squares use


def test_series_are_weighed_by_their_errors(seen):
    errors = np.stack([np.full(4, 0.01), np.full(4, 0.05)])
    weight = (0.9 / 0.01) ** 2 + (1.2 / 0.05) ** 2
    assert place_errors_mm(seen, 0, (0.9, 1.2), errors) == pytest.approx(20.05 / (2 * np.pi) / np.sqrt(weight))


def test_emitted_by_a_screen_with_a_gamma():
    assert emitted(1.0) == pytest.approx((0.5, 0.5))
    assert emitted(2.0) == pytest.approx((3 / 8, 1 / 2))  # cos^4 of half the angle


def test_modulation_is_that_of_the_pixels_light(seen):
    """By direct sums over the pixels' light, in steps of the screen's pixels."""
    periods, start = 13.0, -401 * 0.05 / 2
    number = np.floor((seen.place_mm[0] - start) / 0.05)[:, None] + np.arange(-20, 22)
    share = seen.light.light("u", start + 0.05 * number)
    turned = (share * np.exp(2j * np.pi * periods * (number[:, :-1] + 0.5) / 401)).sum(1)
    assert seen.width_mm(0) == pytest.approx(401 * 0.05)
    assert seen.modulation_at(0, periods) == pytest.approx(np.abs(turned) / share.sum(1), abs=0.004)  # of the table
