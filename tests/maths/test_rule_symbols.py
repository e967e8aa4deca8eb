"""The symbols of zonal integration against the rules themselves on grids of nodes."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.maths.integration.rule_symbols import ZONAL, height_symbol, noise_symbol, rise_symbol

STEP = (0.7, 1.1)  # mm, along columns and rows
TURNS = ([0.3, 0.0], [2.5, 0.0], [0.0, 1.7], [1.2, -0.8], [2.9, 2.0])


def grid(size: int):
    x, y = np.meshgrid(np.arange(size) * STEP[0], np.arange(size) * STEP[1])
    return x, y, np.ones(x.shape, bool)


def seen(method: str, turns, size: int = 81) -> complex:
    """Height in the middle of what integration makes of the slopes of a wave of height 1, over the wave."""
    x, y, mask = grid(size)
    k = np.array(turns) / STEP
    found = []
    for phase in (0.0, np.pi / 2):  # cosine and sine
        falling = -np.sin(k[0] * x + k[1] * y - phase)
        found.append(integrate_slopes(x, y, k[0] * falling, k[1] * falling, mask, method, join=False))
    middle = slice(size // 2 - 8, size // 2 + 9)
    wave = np.exp(1j * (k[0] * x + k[1] * y))[middle, middle]
    heights = (found[0] + 1j * found[1])[middle, middle]
    basis = np.stack([wave.ravel(), np.ones(wave.size), x[middle, middle].ravel(), y[middle, middle].ravel()], -1)
    return complex(np.linalg.lstsq(basis, heights.ravel(), rcond=None)[0][0])


@pytest.mark.parametrize("method", ZONAL)
@pytest.mark.parametrize("turns", TURNS, ids=str)
def test_heights_of_a_wave_are_those_of_the_rule(method, turns):
    """Oblique waves leave something of the edges in the middle, which falls with the distance."""
    assert seen(method, turns) == pytest.approx(float(height_symbol(method, np.array(turns))), abs=2e-3)


def test_a_wave_beyond_half_the_rate_is_seen_as_its_alias():
    turns = np.array([4.0, 0.5])
    alias = turns - [2 * np.pi, 0.0]
    # the same samples; the rises are those of the true slopes
    assert seen("cubic", turns) == pytest.approx(float(height_symbol("cubic", turns)), abs=2e-3)
    assert height_symbol("cubic", turns) == pytest.approx(height_symbol("cubic", alias, turns), rel=1e-12)


def test_slow_waves_are_kept_to_the_order_of_each_rule():
    """1 - theta^2 / 12 of trapezoids, 1 - O(theta^4) of cubics and splines."""
    slow = np.array([0.1, 0.0])
    assert 1 - height_symbol("southwell", slow) == pytest.approx(0.1**2 / 12, rel=1e-2)
    assert 1 - height_symbol("cubic", slow) == pytest.approx(11 * 0.1**4 / 720, rel=1e-2)
    assert abs(1 - height_symbol("spline", slow)) < 1.1 * 0.1**4 / 720


def test_a_wave_that_is_the_same_at_all_nodes_has_no_height():
    assert np.isnan(height_symbol("southwell", np.array([2 * np.pi, 0.0])))
    assert np.isnan(noise_symbol("southwell", np.zeros(2), np.ones(2)))


@pytest.mark.parametrize("method", ["southwell", "cubic"])
def test_noise_has_the_spectrum_of_its_symbol(method):
    size, draws = 48, 60
    x, y, mask = grid(size)
    p, q = np.random.default_rng(1).standard_normal((2, draws, size, size))
    heights = integrate_slopes(x, y, p, q, mask, method, join=False)
    window = np.sin(np.pi * (np.arange(size) + 0.5) / size) ** 2
    window = np.outer(window, window)
    power = np.mean(np.abs(np.fft.fft2(heights * window)) ** 2, 0) / np.sum(window**2)
    for turn in ((12, 0), (0, 12), (9, 7), (20, 5)):
        angles = 2 * np.pi * np.array(turn) / size
        near = power[turn[1] - 1 : turn[1] + 2, turn[0] - 1 : turn[0] + 2] if min(turn) else power[turn[1], turn[0]]
        wanted = float(noise_symbol(method, angles, np.array(STEP)))
        # 60 draws of one sample have 13 % a sigma; neighbours are correlated: 5 sigma
        assert np.mean(near) == pytest.approx(wanted, rel=0.65)
    middles = 2 * np.pi * np.stack(np.meshgrid(np.arange(8, 24), np.arange(8, 24)), -1) / size
    ratio = power[8:24, 8:24] / noise_symbol(method, middles, np.array(STEP))
    assert ratio.mean() == pytest.approx(1.0, abs=0.06)  # 256 samples of 60 draws, 4 alike: 1.6 % a sigma


def test_other_methods_have_none():
    with pytest.raises(ValueError, match="'modal' has no transfer function; must be one of southwell"):
        rise_symbol("modal", np.zeros(1))
