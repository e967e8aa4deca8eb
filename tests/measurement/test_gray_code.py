"""Bits of a Gray code under noise: read, misread as often as stated, and joined with a phase without slips."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from irtscots_cl.imaging.gray_code import GraySet
from irtscots_cl.measurement.gray_code import (
    GrayImages,
    candidates,
    gray_noise,
    gray_shares,
    misread,
    most_likely,
    read_bits,
    two_or_more,
)
from irtscots_cl.measurement.phase import FrameNoise

TRIALS = 10_000
DARK, WHITE = 60.0, 1060.0


def images_of(code, share, sigma, seed=1, inverted=True, references=10**6):
    """Samples of pixels with true shares [planes, n], with noise of so many counts; means of dark and white without."""
    random = np.random.default_rng(seed)

    def recorded(values):
        return DARK + (WHITE - DARK) * values + sigma * random.standard_normal(share.shape)

    levels = np.ones(share.shape[1])
    other = recorded(1 - share) if inverted else None
    return GrayImages(code, recorded(share), other, DARK * levels, WHITE * levels, references, references)


def blurred(code, place, width):
    """Shares [planes, n] of pixels whose light is even over `width` cells around places in cells."""
    fine = np.linspace(-1, code.cells + 1, 200 * (int(code.cells) + 2) + 1)
    values = code.values(np.clip(fine / code.cells, 0, 1 - 1e-12))
    below = np.concatenate(
        [np.zeros((code.planes, 1)), np.cumsum((values[:, 1:] + values[:, :-1]) / 2, axis=1)], axis=1
    )
    below *= fine[1] - fine[0]
    return (
        np.stack([np.interp(place + width / 2, fine, b) - np.interp(place - width / 2, fine, b) for b in below]) / width
    )


@pytest.mark.parametrize("inverted", [True, False])
@pytest.mark.parametrize("sigma", [200.0, 300.0])
def test_bits_are_misread_as_often_as_predicted_and_as_stated(inverted, sigma):
    """10^4 trials of a plane, counted within 4 binomial standard errors: wrong once in 4000 runs of the four."""
    code = GraySet("x", 2)
    cell = np.arange(TRIALS) % 2
    truth = code.values((cell + 0.5) / 2)
    shares = gray_shares(images_of(code, truth, sigma, 3, inverted), FrameNoise(sigma**2))
    counted = float((read_bits(shares) != truth).mean())
    error = sigma / (WHITE - DARK) / (np.sqrt(2) if inverted else 1.0)
    predicted = norm.sf(0.5 / error)
    spread = np.sqrt(predicted * (1 - predicted) / TRIALS)
    assert counted == pytest.approx(predicted, abs=4 * spread) and counted > 0
    assert misread(shares).mean() == pytest.approx(predicted, abs=4 * spread)
    np.testing.assert_allclose(shares.error, error, rtol=1e-3)


@pytest.mark.parametrize("inverted", [True, False])
def test_the_noise_is_found_in_the_planes(inverted):
    """Within 3 %, also where some pixels see an edge; single planes tell it by what is plainly black or white."""
    code = GraySet("x", 16)
    truth = code.values(np.random.default_rng(1).random(4000))
    truth[:, :200] = 0.5 if inverted else truth[:, :200]
    found = gray_noise(images_of(code, truth, 12.0, 2, inverted))
    assert np.sqrt(found.variance(np.array(500.0))) == pytest.approx(12.0, rel=0.03)


def test_no_phase_slips_by_a_fringe_at_the_edges_of_cells():
    """10^4 pixels within a twentieth of a fringe of an edge, light of 0.6 fringes, shares and phases with noise."""
    code = GraySet("x", 23.4)
    random = np.random.default_rng(5)
    place = random.integers(1, 23, TRIALS) + random.uniform(-0.05, 0.05, TRIALS)
    place, turns, shares = with_noise(code, place, 100.0, 0.02, random)
    order, wrong = chosen(code, turns, shares)
    assert np.abs(order + turns % 1 - place).max() < 0.2  # ten standard errors of the phase
    assert wrong.mean() < 1e-3
    # the bits alone do slip there: half of these pixels are read on the other side
    assert (code.number(read_bits(shares)) != np.floor(place)).mean() > 0.2


def test_orders_are_wrong_as_often_as_stated():
    """Shares with an error of 0.28 each: counted within 4 binomial standard errors of the mean stated probability."""
    code = GraySet("x", 23.4)
    random = np.random.default_rng(6)
    place, turns, shares = with_noise(code, random.uniform(0.1, 23.3, TRIALS), 400.0, 0.01, random)
    order, wrong = chosen(code, turns, shares)
    failed = np.abs(order + turns % 1 - place) > 0.5
    spread = np.sqrt(failed.mean() / TRIALS)
    assert failed.mean() > 0.01 and failed.mean() == pytest.approx(wrong.mean(), abs=4 * spread + 0.2 * wrong.mean())
    for low, high in ((0.02, 0.1), (0.1, 0.3), (0.3, 1.0)):
        of = (wrong >= low) & (wrong < high)
        assert of.sum() > 200 and failed[of].mean() == pytest.approx(wrong[of].mean(), rel=0.4)


def with_noise(code, place, sigma, phase_error, random):
    truth = blurred(code, place, 0.6)
    shares = gray_shares(images_of(code, truth, sigma, 7), FrameNoise(sigma**2))
    return place, place + phase_error * random.standard_normal(place.shape), shares


def chosen(code, turns, shares):
    def model(cell):
        return blurred(code, cell + turns % 1, 0.6)

    several = two_or_more(misread(shares, 0.05))
    return most_likely(shares, candidates(code, read_bits(shares)), model, 0.05, several=several)


def test_saturated_samples_and_pixels_without_light_tell_nothing():
    code = GraySet("x", 8)
    images = images_of(code, code.values(np.full(3, 0.3)), 5.0)
    images.planes[1, 0] = np.nan
    images.white[1] = DARK + 2
    shares = gray_shares(images, FrameNoise(25.0))
    assert np.isnan(shares.share[1, 0]) and np.isfinite(shares.share[:, 2]).all()
    assert misread(shares)[1, 0] == 0.5 and (misread(shares)[:, 2] < 1e-9).all()
    with pytest.raises(ValueError, match="needs a dark and a white image"):
        gray_shares(GrayImages(code, images.planes, None, None, None))


def test_inverted_planes_need_no_dark_and_white_images():
    code = GraySet("x", 8)
    truth = code.values(np.linspace(0.01, 0.99, 500))
    images = images_of(code, truth, 5.0)
    shares = gray_shares(GrayImages(code, images.planes, images.inverted, None, None), FrameNoise(25.0))
    assert np.abs(shares.share - truth).max() < 0.03


def test_two_or_more():
    chance = np.array([[0.1, 0.5], [0.2, 0.0], [0.3, 0.0]])
    wanted = 1 - 0.9 * 0.8 * 0.7 - (0.1 * 0.8 * 0.7 + 0.9 * 0.2 * 0.7 + 0.9 * 0.8 * 0.3)
    np.testing.assert_allclose(two_or_more(chance), [wanted, 0.0], atol=1e-15)
