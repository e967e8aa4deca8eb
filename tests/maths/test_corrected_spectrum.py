"""Spectra with the instrument's response taken out: levels, error bars, aliases, and where nothing is told."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.maths.corrected_spectrum import Aliases, corrected_psd
from irtscots_cl.maths.map_spectrum import windowed_spectrum

PITCH = (2.0, 2.0)
SIZE = 64


def round_mask() -> np.ndarray:
    axis = np.arange(SIZE) - (SIZE - 1) / 2
    return np.hypot(axis[:, None], axis[None, :]) < SIZE / 2


def noise_map(seed: int, sigma: float = 3.0) -> np.ndarray:
    return np.where(round_mask(), np.random.default_rng(seed).normal(0, sigma, (SIZE, SIZE)), np.nan)


def flat(value: float) -> np.ndarray:
    return np.full((SIZE, SIZE), value)


NO_ALIASES = Aliases(np.ones((1, SIZE, SIZE)), np.zeros((1, SIZE, SIZE)))
LEVEL = 9.0 * PITCH[0] * PITCH[1]


def test_the_response_is_divided_out_and_errors_are_true():
    """White noise seen with a response of 0.5: the density is 4 times that of the map; pulls have a variance of 1.

    A pull is over the error of the level, not of the density found, which is in proportion to it.
    """
    pulls = []
    for seed in range(24):
        found = corrected_psd(windowed_spectrum(noise_map(seed), PITCH), flat(0.5), NO_ALIASES, None)
        pulls.append((found.corrected_mm4 / (4 * LEVEL) - 1) * found.corrected_mm4 / found.standard_error_mm4)
        assert np.isnan(found.noise_mm4).all()
    pulls = np.array(pulls)[:, 2:]
    assert np.isfinite(pulls).all()
    assert abs(pulls.mean()) < 0.25  # 0.04 a sigma, 0.06 with neighbours alike
    assert pulls.std() == pytest.approx(1.0, abs=0.15)  # 24 x 30 rings, neighbours alike: 4 % a sigma


def test_noise_is_subtracted():
    found = corrected_psd(windowed_spectrum(noise_map(3), PITCH), flat(1.0), NO_ALIASES, flat(LEVEL))
    good = np.isfinite(found.corrected_mm4)
    assert np.abs(found.corrected_mm4[good] / found.standard_error_mm4[good]).mean() < 1.3
    # rings count alike, so the inner ones, of 20 % error each, give the mean 5 %: 4 sigma
    assert np.mean(found.corrected_mm4[good]) == pytest.approx(0.0, abs=0.2 * LEVEL)
    np.testing.assert_allclose(found.noise_mm4, LEVEL)


def test_nothing_is_told_below_the_floor_or_next_to_frequency_0():
    response = flat(1.0)
    spectrum = windowed_spectrum(noise_map(1), PITCH)
    radius = np.hypot(spectrum.frequency_x_per_mm[None, :], spectrum.frequency_y_per_mm[:, None])
    response[radius > 0.15] = 0.05
    found = corrected_psd(spectrum, response, NO_ALIASES, None)
    told = np.isfinite(found.corrected_mm4)
    assert not told[found.frequency_per_mm > 0.15].any() and told[found.frequency_per_mm < 0.14].sum() > 10
    assert not told[found.frequency_per_mm < 2 / (SIZE * PITCH[0])].any()
    lower = corrected_psd(spectrum, response, NO_ALIASES, None, floor=0.04)
    assert np.isfinite(lower.corrected_mm4[-1])


def test_what_comes_from_beyond_the_grid_is_taken_out():
    """A flat density: a quarter of the mirror's own from beyond is taken out, three quarters are too much."""
    spectrum = windowed_spectrum(noise_map(2), PITCH)
    for part, told in ((0.25, True), (0.75, False)):
        aliases = Aliases(np.ones((1, SIZE, SIZE)), np.full((1, SIZE, SIZE), np.sqrt(part)))
        found = corrected_psd(spectrum, flat(1.0), aliases, None)
        inner = found.frequency_per_mm > 0.05
        assert np.isfinite(found.corrected_mm4[inner]).all() == told
        assert abs(found.exponent) < 0.2
        if told:
            ratio = found.corrected_mm4[inner] * (1 + found.aliased[inner]) / found.measured_mm4[inner]
            np.testing.assert_allclose(ratio, 1.0, rtol=1e-3)  # the share varies a little within a ring
            assert found.aliased[-1] == pytest.approx(part, rel=0.3)


def test_refusals():
    spectrum = windowed_spectrum(noise_map(1), PITCH)
    with pytest.raises(ValueError, match="floor = 1.0: must be above 0 and below 1"):
        corrected_psd(spectrum, flat(1.0), NO_ALIASES, None, floor=1.0)
    line = windowed_spectrum(np.random.default_rng(1).normal(size=(1, 9)), PITCH)
    with pytest.raises(ValueError, match="more than one row and column"):
        corrected_psd(line, np.ones((1, 9)), Aliases(np.ones((1, 1, 9)), np.zeros((1, 1, 9))), None)
