"""The misfit of integration: what has none, what noise leaves, what faults leave."""

from __future__ import annotations

import numpy as np
import pytest
from nodes import BRIDGE, disk, lines, polynomial, sheared_grid

from irtscots_cl.maths.integration import integration_misfit, white_noise
from irtscots_cl.maths.integration.misfit import (
    LEAST_LIMIT,
    NOISE_LIMIT,
    SHARE_LIMIT,
    UNKNOWN_NOISE_SHARE,
    Misfit,
)

MASK = disk(31, 33)
X, Y = sheared_grid(31, 33)
NAN = float("nan")


def test_slopes_of_a_surface_have_none():
    _, p, q = polynomial(2, X, Y)
    found = integration_misfit(X, Y, p, q, MASK)
    assert found.slope < 1e-15 < 1e-3 < found.rms_slope  # slopes of 0.02, rounding
    assert np.isnan(found.expected) and not found.suspicious
    _, p, q = polynomial(5, X, Y)
    assert integration_misfit(X, Y, p, q, MASK).slope < 1e-4 * found.rms_slope  # the cubics' own


def test_a_rotation_is_all_misfit():
    """p = -y, q = x: around a cell of area A the rises add up to 2 A. By hand for one square of 10 mm."""
    x, y = np.meshgrid([0.0, 10.0], [0.0, 10.0])
    found = integration_misfit(x, y, -y, x, np.ones((2, 2), bool))
    # 200 mm shared by four sides: 50 each over 10 mm; one loop, so sqrt(4 x 25)
    assert found.slope == pytest.approx(10.0, rel=1e-12)
    assert integration_misfit(x, y, y, x, np.ones((2, 2), bool)).slope < 1e-15  # p = y, q = x is the slope of x y


@pytest.mark.parametrize("mask", [MASK, BRIDGE, np.random.default_rng(1).random((31, 33)) < 0.8], ids=str)
def test_white_noise_is_found_again(mask):
    x, y = sheared_grid(*mask.shape)
    _, p, q = polynomial(2, x, y)
    found = []
    for seed in range(20):
        noise = 3e-6 * np.random.default_rng(seed).standard_normal((2, *mask.shape))
        found.append(white_noise(integration_misfit(x, y, p + noise[0], q + noise[1], mask), x, y, mask))
    assert np.mean(found) == pytest.approx(3e-6, rel=0.05)  # 20 x 90 loops and more, and 16 draws: 2 %


def test_noise_of_the_stated_size_is_expected_and_more_is_suspicious():
    _, p, q = polynomial(2, X, Y)
    random = np.random.default_rng(2)
    size = 1e-4 * (1 + random.random((2, *MASK.shape)))  # differs from node to node
    noise = size * random.standard_normal(size.shape)
    for factor, suspicious in ((1.0, False), (2.0, True)):
        found = integration_misfit(X, Y, p + factor * noise[0], q + factor * noise[1], MASK, *size)
        assert found.slope / found.expected == pytest.approx(factor, rel=0.1)  # 900 loops: 2.4 %
        assert found.suspicious is suspicious


def test_known_errors_are_no_fault_but_others_beside_them_are():
    """False alarms among 20 maps of noise beside errors that alternate: none. The least margin is 20 sigma."""
    _, p, q = polynomial(2, X, Y)
    wave = 3e-4 * np.stack([np.sin(1.9 * Y), np.sin(2.3 * X)])
    size = np.full(MASK.shape, 1e-4)
    for seed in range(20):
        noise = size * np.random.default_rng(seed).standard_normal(wave.shape)
        slopes = (p + wave[0] + noise[0], q + wave[1] + noise[1])
        found = integration_misfit(X, Y, *slopes, MASK, size, size, tuple(wave))
        assert not found.suspicious
        assert found.slope == pytest.approx(np.hypot(found.expected, found.systematic), rel=0.1)
        if seed == 0:
            assert integration_misfit(X, Y, *slopes, MASK, size, size).suspicious  # not known
            doubled = (slopes[0] + wave[0], slopes[1] + wave[1])
            assert integration_misfit(X, Y, *doubled, MASK, size, size, tuple(wave)).suspicious


def test_exchanged_axes_and_shifted_rows_are_suspicious():
    _, p, q = polynomial(4, X, Y)
    small = np.full(MASK.shape, 1e-6)
    right = integration_misfit(X, Y, p, q, MASK, small, small)
    assert not right.suspicious
    for wrong in ((q, p), (p[::-1], q), (np.roll(p, 2, axis=0), q), (p, 1.2 * q), (p[:, ::-1], q[:, ::-1])):
        found = integration_misfit(X, Y, *wrong, MASK, small, small)
        assert found.suspicious and found.slope > 5 * right.slope


def test_limits():
    assert Misfit(1.0, NAN, 5.0).limit == UNKNOWN_NOISE_SHARE * 5.0
    assert Misfit(1.0, 2.0, 5.0).limit == NOISE_LIMIT * 2.0
    assert Misfit(1.0, 1e-3, 5.0).limit == SHARE_LIMIT * 5.0
    assert Misfit(1.0, NAN, 0.0).limit == Misfit(1.0, 0.0, 0.0).limit == LEAST_LIMIT
    assert Misfit(1.0, 3.0, 5.0, 4.0).limit == NOISE_LIMIT * 5.0
    assert Misfit(1.0, NAN, 5.0, 4.0).limit == NOISE_LIMIT * 4.0
    assert Misfit(1.0, 0.0, 5.0).suspicious and not Misfit(NAN, NAN, 5.0).suspicious


def test_without_a_loop_there_is_none_to_tell():
    mask = lines("###", "#..", "#.#")
    x, y = sheared_grid(3, 3)
    found = integration_misfit(x, y, x, y, mask)
    assert np.isnan(found.slope) and np.isnan(white_noise(found, x, y, mask)) and not found.suspicious


def test_refusals_name_the_argument():
    with pytest.raises(ValueError, match="^noise_x has shape"):
        integration_misfit(X, Y, X, Y, MASK, np.zeros(3), np.zeros(3))
