"""Fits of Zernike terms over pupils: what can be told apart, errors, groups with pistons of their own."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.maths.zernike.fit import (
    MAX_INFLATION,
    SAMPLES_OF_PART,
    applied,
    large_smoothing_matrix,
    separable_terms,
    smoothing_matrix,
)
from irtscots_cl.maths.zernike.polynomials import zernike

NOLLS = range(1, 46)


def annulus(hole: float, nodes: int = 61) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(*2 * [np.linspace(-1, 1, nodes)])
    on = (np.hypot(x, y) <= 1) & (np.hypot(x, y) >= hole)
    return x[on], y[on]


def test_a_disk_tells_all_terms_apart():
    fit = separable_terms(*annulus(0), NOLLS)
    assert fit.nolls == tuple(NOLLS) and fit.dropped == ()
    assert fit.condition == fit.condition_all == pytest.approx(1.1, abs=0.15)  # orthogonal but for the pixels
    assert np.all(fit.inflation < 1.1) and np.all(fit.inflation > 0.9)


def test_coefficients_come_out_and_leave_the_rest():
    x, y = annulus(0)
    fit = separable_terms(x, y, [11, 4, 4, 8])
    assert fit.nolls == (4, 8, 11)
    maps = np.stack([0.3 * zernike(8, x, y) - 0.2 * zernike(11, x, y), zernike(4, x, y)])
    np.testing.assert_allclose(fit.coefficients(maps), [[0, 0.3, -0.2], [1, 0, 0]], rtol=0, atol=1e-14)
    assert fit.residual_rms(maps[0]) < 1e-14
    extra = fit.residual_rms(maps[0] + 0.1 * zernike(13, x, y))
    assert extra == pytest.approx(0.1, rel=0.05)  # orthogonal to the others but for the pixels


@pytest.mark.parametrize(("hole", "scale"), [(0.0, 1.0), (0.5, 1.0), (0.7, 1.0), (0.0, 0.8)])
def test_inflation_is_the_scatter_of_coefficients_of_noise(hole, scale):
    x, y = annulus(hole)
    fit = separable_terms(x * scale, y * scale, NOLLS)
    noise = np.random.default_rng(0).standard_normal((4000, x.size))
    scatter = fit.coefficients(noise).std(axis=0) * np.sqrt(x.size)
    np.testing.assert_allclose(scatter, fit.inflation, rtol=0.055)  # 1.1 % each; 5 sigma


@pytest.mark.parametrize(
    ("hole", "scale", "least", "most"),
    [(0.0, 1.0, 45, 45), (0.3, 1.0, 45, 45), (0.9, 1.0, 6, 15), (0.0, 0.5, 3, 10), (0.0, 1 / 3.8, 1, 3)],
)
def test_orders_that_the_pupil_cannot_support_are_dropped(hole, scale, least, most):
    """Obscured to 0.9; a disk of 2 and of 3.8 times the pupil: terms that looked the same came back as microns."""
    x, y = annulus(hole, 125)
    fit = separable_terms(x * scale, y * scale, NOLLS)
    assert least <= len(fit.nolls) <= most and fit.nolls + fit.dropped == tuple(NOLLS)
    assert fit.inflation.max() <= MAX_INFLATION
    if fit.dropped:
        assert fit.condition_all > 10 * fit.condition


@pytest.mark.parametrize("hole", [0.5, 0.9])
def test_annular_terms_stay_apart(hole):
    fit = separable_terms(*annulus(hole, 125), NOLLS, ratio=hole)
    assert not fit.dropped and fit.condition < 1.3 and fit.ratio == hole


def test_fewer_samples_than_terms_leave_the_low_orders():
    x, y = annulus(0, 7)
    fit = separable_terms(x, y, NOLLS)
    assert x.size < 45 and fit.condition_all == np.inf and 6 <= len(fit.nolls) < x.size
    alone = separable_terms(x[:1], y[:1], NOLLS)
    assert alone.nolls == (1,)
    line = separable_terms(np.linspace(-1, 1, 9), np.zeros(9), NOLLS)  # y is not seen: tilt in y cannot be told
    assert line.nolls == (1,)


def test_groups_have_pistons_of_their_own():
    x, y = annulus(0)
    groups = (x > 0.1).astype(int)
    x, y, groups = x[np.abs(x) > 0.1], y[np.abs(x) > 0.1], groups[np.abs(x) > 0.1]
    z = 0.3 * zernike(6, x, y) + 0.1 * zernike(8, x, y) + 0.05
    stepped = z + 7.0 * groups
    plain, free = separable_terms(x, y, NOLLS), separable_terms(x, y, NOLLS, groups=groups)
    assert abs(plain.coefficients(stepped)[1]) > 1  # the step is read as tilt
    found = dict(zip(free.nolls, free.coefficients(stepped), strict=True))
    expected = {1: 0.05, 6: 0.3, 8: 0.1}
    assert all(abs(value - expected.get(noll, 0.0)) < 1e-12 for noll, value in found.items())
    assert free.residual_rms(stepped) < 1e-12
    # the same as with a column for the step
    columns = np.stack([*(zernike(j, x, y) for j in free.nolls), groups], axis=1)
    wild = np.random.default_rng(2).standard_normal(x.size)
    np.testing.assert_allclose(free.coefficients(wild), np.linalg.lstsq(columns, wild)[0][:-1], rtol=0, atol=1e-10)
    assert np.array_equal(separable_terms(x, y, NOLLS, groups=groups * 0).matrix, plain.matrix)


def test_smoothing_leaves_out_what_cannot_be_told():
    x = np.linspace(-1, 1, 9)
    basis = np.stack([np.ones(9), x, x + 0.0])
    z = 2 + 3 * x
    np.testing.assert_allclose(smoothing_matrix(basis) @ z, [2, 1.5, 1.5], atol=1e-12)
    groups = (x > 0).astype(int)
    np.testing.assert_allclose(smoothing_matrix(basis, groups) @ (z + 5 * groups), [0, 1.5, 1.5], atol=1e-12)


@pytest.mark.parametrize("grouped", [False, True])
def test_a_large_matrix_in_parts_is_the_same_but_for_single_precision(grouped):
    count = SAMPLES_OF_PART + 1000  # the last part is shorter
    random = np.random.default_rng(3)
    x, y = random.uniform(-0.7, 0.7, (2, count))
    basis, values = np.stack([zernike(j, x, y) for j in range(1, 22)]), random.standard_normal(count) + 5 * (x > 0.1)
    groups = (x > 0.1).astype(int) if grouped else None
    large = large_smoothing_matrix(lambda part: basis[:, part], len(basis), count, groups)
    assert large.dtype == np.float32
    expected = smoothing_matrix(basis, groups) @ values
    np.testing.assert_allclose(applied(large, values), expected, rtol=0, atol=3e-6)
    assert np.array_equal(applied(smoothing_matrix(basis, groups), values), expected)


def test_refusals():
    for x, nolls in ((np.zeros(3), []), (np.zeros(0), [1])):
        with pytest.raises(ValueError, match="needs at least one term and one sample"):
            separable_terms(x, x, nolls)
