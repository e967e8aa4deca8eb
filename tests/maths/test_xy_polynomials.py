"""Chebyshev series over rectangles: values, slopes, other bases and other rectangles, against definitions in mpmath."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from irtscots_cl.maths.xy_polynomials import ChebyshevSeries, series_of, sum_of

CENTRE, HALF = (3.0, -2.0), (40.0, 50.0)
FUNCTIONS = {
    "chebyshev": mpmath.chebyt,
    "legendre": mpmath.legendre,
    "monomial": lambda n, t: t**n,
}


def places(count: int = 12):
    u, v = np.random.default_rng(3).uniform(-1, 1, (2, count))
    return CENTRE[0] + HALF[0] * u, CENTRE[1] + HALF[1] * v


def by_definition(kind, terms, x, y):
    """Value and slopes with 40 digits, the slopes by differences."""

    def value(x, y):
        u, v = (x - CENTRE[0]) / HALF[0], (y - CENTRE[1]) / HALF[1]
        return mpmath.fsum(c * FUNCTIONS[kind](i, u) * FUNCTIONS[kind](j, v) for i, j, c in terms)

    with mpmath.workdps(40):
        step = mpmath.mpf(10) ** -12
        at = [(mpmath.mpf(float(a)), mpmath.mpf(float(b))) for a, b in zip(x, y, strict=True)]
        found = [
            (value(a, b), (value(a + step, b) - value(a - step, b)) / (2 * step),
             (value(a, b + step) - value(a, b - step)) / (2 * step)) for a, b in at
        ]  # fmt: skip
    return np.array(found, dtype=float).T


@pytest.mark.parametrize("kind", FUNCTIONS)
@pytest.mark.parametrize("order", [3, 30])
def test_every_basis_is_what_its_definition_says(kind, order):
    random = np.random.default_rng(order)
    terms = [(int(i), int(j), float(random.normal())) for i, j in {(order, 0), (0, order), (2, 1), (order, 3), (0, 0)}]
    x, y = places()
    found, expected = series_of(kind, terms, CENTRE, HALF).at(x, y), by_definition(kind, terms, x, y)
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-13)  # rounding of sums of 30
    np.testing.assert_allclose(found[1:], expected[1:], rtol=0, atol=1e-12)  # of slopes of up to 30^2 / 40


def test_a_polynomial_of_one_rectangle_is_the_same_on_another():
    random = np.random.default_rng(0)
    series = ChebyshevSeries(random.normal(size=(9, 13)), CENTRE, HALF)
    moved = series.on((10.0, 4.0), (20.0, 30.0))
    x, y = 10 + 20 * random.uniform(-1, 1, 100), 4 + 30 * random.uniform(-1, 1, 100)
    for one, other in zip(series.at(x, y), moved.at(x, y), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)  # rounding of 117 terms of size 1
    assert moved.coefficient.shape == (9, 13)
    assert series.on(CENTRE, HALF) is series


def test_sums_are_on_the_common_rectangle_and_add_up():
    random = np.random.default_rng(1)
    first = ChebyshevSeries(random.normal(size=(4, 2)), (0.0, 0.0), (10.0, 20.0))
    second = ChebyshevSeries(random.normal(size=(1, 5)), (2.0, -1.0), (9.0, 30.0))
    total = sum_of([first, second])
    assert total.coefficient.shape == (4, 5)
    assert (total.centre_mm, total.half_size_mm) == ((1.5, 0.0), (8.5, 20.0))
    x, y = random.uniform(-7, 10, 50), random.uniform(-20, 20, 50)
    for both, one, other in zip(total.at(x, y), first.at(x, y), second.at(x, y), strict=True):
        np.testing.assert_allclose(both, one + other, rtol=0, atol=1e-12)  # rounding
    assert sum_of([first]).coefficient is not None and sum_of([first]).half_size_mm == (10.0, 20.0)


def test_rounding_leaves_no_terms():
    """x^3 = (3 T_1 + T_3) / 4: even terms are 0, not 1e-17, and the table ends with the highest power."""
    series = series_of("monomial", [(3, 0, 1.0), (7, 2, 0.0)], (0.0, 0.0), (1.0, 1.0))
    np.testing.assert_allclose(series.coefficient, [[0, 0.75, 0, 0.25]], rtol=1e-15, atol=0)
    assert np.count_nonzero(series.coefficient) == 2


def test_points_of_any_shape():
    series = ChebyshevSeries(np.ones((3, 2)), CENTRE, HALF)
    assert series.at(np.zeros((2, 1)), np.zeros(3))[1].shape == (2, 3)
    assert np.shape(series.at(np.float64(1.0), np.float64(2.0))[0]) == ()
    many = np.linspace(-30, 30, 20_000)
    np.testing.assert_array_equal(series.at(many, many)[0][::1000], series.at(many[::1000], many[::1000])[0])
