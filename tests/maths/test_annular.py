"""Annular Zernike polynomials against Mahajan's closed forms and by quadrature."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.maths.zernike.annular import annular_zernike
from irtscots_cl.maths.zernike.evaluation import evaluate_series
from irtscots_cl.maths.zernike.indices import noll_to_nm
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.maths.zernike.series import joined_series, power_rows, radial_series

R2, R3, R5, R6, R8 = np.sqrt([2, 3, 5, 6, 8])


def closed_forms(x, y, e):
    """Noll index -> V. N. Mahajan, J. Opt. Soc. Am. 71, 75 (1981), table 1, times the norm of Noll's polynomials."""
    r, t, e2 = np.hypot(x, y), np.arctan2(y, x), e * e
    coma = (3 * (1 + e2) * r**3 - 2 * (1 + e2 + e2**2) * r) / ((1 - e2) * np.sqrt((1 + e2) * (1 + 4 * e2 + e2**2)))
    astigmatism = r**2 / np.sqrt(1 + e2 + e2**2)
    trefoil = r**3 / np.sqrt(1 + e2 + e2**2 + e2**3)
    return {
        1: np.ones_like(r),
        2: 2 * r * np.cos(t) / np.sqrt(1 + e2),
        3: 2 * r * np.sin(t) / np.sqrt(1 + e2),
        4: R3 * (2 * r**2 - 1 - e2) / (1 - e2),
        5: R6 * astigmatism * np.sin(2 * t),
        6: R6 * astigmatism * np.cos(2 * t),
        7: R8 * coma * np.sin(t),
        8: R8 * coma * np.cos(t),
        9: R8 * trefoil * np.sin(3 * t),
        10: R8 * trefoil * np.cos(3 * t),
        11: R5 * (6 * r**4 - 6 * (1 + e2) * r**2 + 1 + 4 * e2 + e2**2) / (1 - e2) ** 2,
        14: np.sqrt(10) * r**4 / np.sqrt(1 + e2 + e2**2 + e2**3 + e2**4) * np.cos(4 * t),
    }


@pytest.mark.parametrize("ratio", [0.0, 0.2, 0.5, 0.9, 0.99])
def test_closed_forms(ratio):
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 200))
    for noll, expected in closed_forms(x, y, ratio).items():
        got = annular_zernike(noll, x, y, ratio)
        # the printed sums cancel by 1/(1 - ratio^2)^2, to 2500
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.9])
def test_orthonormal_over_the_annulus(ratio):
    """Gauss-Legendre in the squared radius and equal steps in angle: exact for two terms of order 12."""
    node, weight = np.polynomial.legendre.leggauss(16)
    square = (1 + ratio**2) / 2 + (1 - ratio**2) / 2 * node
    angle = np.arange(32) * 2 * np.pi / 32
    x, y = np.sqrt(square)[:, None] * np.cos(angle), np.sqrt(square)[:, None] * np.sin(angle)
    share = np.broadcast_to(weight[:, None] / 2 / 32, x.shape)
    terms = np.array([annular_zernike(j, x, y, ratio) for j in range(1, 92)])
    products = np.einsum("irt,jrt,rt->ij", terms, terms, share)
    assert np.abs(products - np.eye(91)).max() < 1e-11  # rounding of recurrences of 6 steps


def test_without_a_hole_they_are_zernike_s():
    x, y = np.random.default_rng(1).uniform(-0.7, 0.7, (2, 50))
    for j in range(1, 60):
        np.testing.assert_allclose(annular_zernike(j, x, y, 0.0), zernike(j, x, y), rtol=0, atol=1e-12)
    assert np.array_equal(annular_zernike(4, 0.3, 0.1, 0.4, "osa"), annular_zernike(4, 0.3, 0.1, 0.4, "noll"))
    assert annular_zernike(3, [0.3], [0.1], 0.4, "osa") == annular_zernike(5, [0.3], [0.1], 0.4)


def test_refusals():
    for ratio in (-0.1, 1.0, float("nan")):
        with pytest.raises(ValueError, match="^ratio = .*: must be at least 0 and below 1$"):
            annular_zernike(4, 0.0, 0.0, ratio)
    with pytest.raises(ValueError, match="below the first noll index"):
        annular_zernike(0, 0.0, 0.0, 0.5)


@pytest.mark.parametrize("ratio", [0.2, 0.7])
@pytest.mark.parametrize("size", [1.0, 1.3])
def test_sums_of_annular_terms_are_what_their_terms_add_up_to(ratio, size):
    """Noll 496 is of order 30. The disk of the terms is `size` times that of the tables."""
    random = np.random.default_rng(2)
    radius, angle = np.sqrt(random.uniform((ratio * size) ** 2, 1, 300)), random.uniform(0, 2 * np.pi, 300)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    nolls = (1, 2, 3, 4, 6, 7, 11, 22, 33, 45, 231, 496)
    given = {noll_to_nm(j): float(random.normal()) for j in nolls}
    series = radial_series(given, ratio, size)
    found = evaluate_series(series, x, y)
    expected = sum(given[noll_to_nm(j)] * annular_zernike(j, x / size, y / size, ratio) for j in nolls)
    np.testing.assert_allclose(found[0], expected, rtol=0, atol=1e-12)  # rounding of 15 steps
    step = 1e-5
    for slope, dx, dy in ((found[1], step, 0.0), (found[2], 0.0, step)):
        rise = evaluate_series(series, x + dx, y + dy)[0] - evaluate_series(series, x - dx, y - dy)[0]
        np.testing.assert_allclose(slope, rise / (2 * step), rtol=0, atol=1e-4)  # step^2/6 times a third derivative


def test_series_of_several_rings_add_up_term_by_term():
    x, y = np.random.default_rng(3).uniform(-0.7, 0.7, (2, 40))
    parts = [radial_series({(4, 0): 1.0, (5, -3): 0.5}, 0.3), radial_series({(2, 2): 1.0, (7, 3): 0.2}, 0.0, 1.2),
             radial_series({(4, 0): -0.4}, 0.5, 1.1)]  # fmt: skip
    joined = joined_series(parts)
    assert joined.m.tolist() == [0, 0, 2, 3, 3]
    whole = evaluate_series(joined, x, y)
    for k in range(3):
        np.testing.assert_allclose(whole[k], sum(evaluate_series(p, x, y)[k] for p in parts), rtol=0, atol=1e-14)
    rows = power_rows(joined)  # rows of equal order are one
    assert rows.order.tolist() == [0, 2, 3, 3] and sorted(rows.sine.tolist()) == [0, 0, 0, 1]
    assert len(rows.coefficient) == rows.count.sum()
