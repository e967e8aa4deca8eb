"""Zernike numbering, values, gradients, tables and fit against the literature and exact arithmetic."""

from __future__ import annotations

from fractions import Fraction
from math import factorial, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from irtscots_cl.maths.zernike import polynomials as zk
from irtscots_cl.maths.zernike.evaluation import evaluate_series
from irtscots_cl.maths.zernike.fit import zernike_fit
from irtscots_cl.maths.zernike.indices import (
    ORDERINGS,
    fringe_to_nm,
    nm_to_fringe,
    nm_to_index,
    nm_to_noll,
    nm_to_osa,
    noll_to_nm,
    osa_to_nm,
)
from irtscots_cl.maths.zernike.series import PowerRows, power_rows, radial_series

# (n, m) in order of the index, typed from Noll (1976) table I, Wyant & Creath (1992) and ANSI Z80.28.
LITERATURE = {
    "noll": [
        (0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (3, -3), (3, 3), (4, 0),
        (4, 2), (4, -2), (4, 4), (4, -4), (5, 1), (5, -1), (5, 3), (5, -3), (5, 5), (5, -5), (6, 0),
    ],
    "fringe": [
        (0, 0), (1, 1), (1, -1), (2, 0), (2, 2), (2, -2), (3, 1), (3, -1), (4, 0), (3, 3), (3, -3),
        (4, 2), (4, -2), (5, 1), (5, -1), (6, 0), (4, 4), (4, -4), (5, 3), (5, -3), (6, 2), (6, -2),
        (7, 1), (7, -1), (8, 0),
    ],
    "osa": [
        (0, 0), (1, -1), (1, 1), (2, -2), (2, 0), (2, 2), (3, -3), (3, -1), (3, 1), (3, 3),
        (4, -4), (4, -2), (4, 0), (4, 2), (4, 4),
    ],
}  # fmt: skip

# Noll index -> the polynomial written out, r2 = x^2 + y^2.
CLOSED_FORMS = {
    1: lambda x, y, r2: 1 + 0 * x,
    2: lambda x, y, r2: 2 * x,
    3: lambda x, y, r2: 2 * y,
    4: lambda x, y, r2: sqrt(3) * (2 * r2 - 1),
    5: lambda x, y, r2: sqrt(6) * 2 * x * y,
    6: lambda x, y, r2: sqrt(6) * (x**2 - y**2),
    7: lambda x, y, r2: sqrt(8) * (3 * r2 - 2) * y,
    8: lambda x, y, r2: sqrt(8) * (3 * r2 - 2) * x,
    9: lambda x, y, r2: sqrt(8) * (3 * x**2 * y - y**3),
    10: lambda x, y, r2: sqrt(8) * (x**3 - 3 * x * y**2),
    11: lambda x, y, r2: sqrt(5) * (6 * r2**2 - 6 * r2 + 1),
    22: lambda x, y, r2: sqrt(7) * (20 * r2**3 - 30 * r2**2 + 12 * r2 - 1),
    29: lambda x, y, r2: 4 * (35 * r2**3 - 60 * r2**2 + 30 * r2 - 4) * y,
    37: lambda x, y, r2: 3 * (70 * r2**4 - 140 * r2**3 + 90 * r2**2 - 20 * r2 + 1),
    38: lambda x, y, r2: sqrt(18) * (56 * r2**3 - 105 * r2**2 + 60 * r2 - 10) * (x**2 - y**2),
}


def disk_points(count: int, seed: int = 7) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    rho, angle = np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    return rho * np.cos(angle), rho * np.sin(angle)


def exact(n: int, m: int, x: float, y: float) -> tuple[float, float, float]:
    """Value, d/dx, d/dy by the factorial sum in rational arithmetic; the normalisation alone is rounded."""
    x, y, size = Fraction(x), Fraction(y), abs(m)
    s, half = x * x + y * y, (n - size) // 2
    fall = [factorial(k) * factorial(n - half - k) * factorial(half - k) for k in range(half + 1)]
    coefficient = [Fraction((-1) ** k * factorial(n - k), fall[k]) for k in range(half + 1)]
    radial = sum(c * s ** (half - k) for k, c in enumerate(coefficient))
    radial_ds = sum(c * (half - k) * s ** (half - k - 1) for k, c in enumerate(coefficient[:-1]))
    powers = [(Fraction(1), Fraction(0))]
    for _ in range(size):
        real, imaginary = powers[-1]
        powers.append((real * x - imaginary * y, real * y + imaginary * x))
    real, imaginary = powers[-1]
    lower_real, lower_imaginary = powers[-2] if size else (Fraction(0), Fraction(0))
    part, part_dx, part_dy = real, size * lower_real, -size * lower_imaginary
    if m < 0:
        part, part_dx, part_dy = imaginary, size * lower_imaginary, size * lower_real
    factor = sqrt((n + 1) * (2 if m else 1))
    return (
        factor * float(radial * part),
        factor * float(radial * part_dx + 2 * x * radial_ds * part),
        factor * float(radial * part_dy + 2 * y * radial_ds * part),
    )


@pytest.mark.parametrize("ordering", LITERATURE)
def test_numbering_follows_the_literature(ordering):
    first = 0 if ordering == "osa" else 1
    for j, nm in enumerate(LITERATURE[ordering], start=first):
        assert zk.index_to_nm(j, ordering) == nm
        assert nm_to_index(*nm, ordering) == j


@pytest.mark.parametrize(
    ("j", "nm", "ordering"),
    [
        (29, (7, -1), "noll"), (37, (8, 0), "noll"), (38, (8, 2), "noll"), (36, (7, 7), "noll"),
        (36, (10, 0), "fringe"), (37, (6, 6), "fringe"), (49, (12, 0), "fringe"),
        (35, (7, 7), "osa"), (36, (8, -8), "osa"),
    ],
)  # fmt: skip
def test_numbering_of_single_higher_terms(j, nm, ordering):
    assert zk.index_to_nm(j, ordering) == nm


@pytest.mark.parametrize("ordering", ORDERINGS)
def test_numbering_goes_round_and_names_every_term_once(ordering):
    first = 0 if ordering == "osa" else 1
    named = [zk.index_to_nm(j, ordering) for j in range(first, first + 2000)]
    assert len(set(named)) == len(named)
    assert [nm_to_index(n, m, ordering) for n, m in named] == list(range(first, first + 2000))


def test_short_names_are_the_orderings():
    assert (noll_to_nm(7), fringe_to_nm(7), osa_to_nm(7)) == ((3, -1), (3, 1), (3, -1))
    assert (nm_to_noll(3, 1), nm_to_fringe(3, 1), nm_to_osa(3, 1)) == (8, 7, 8)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: zk.index_to_nm(0, "noll"), "index 0 is below the first noll index, 1"),
        (lambda: zk.index_to_nm(0, "fringe"), "below the first fringe index, 1"),
        (lambda: zk.index_to_nm(-1, "osa"), "below the first osa index, 0"),
        (lambda: zk.index_to_nm(2.5, "noll"), "must be an integer, got 2.5"),
        (lambda: zk.index_to_nm(3, "born-wolf"), "'born-wolf'; allowed: noll, fringe, osa"),
        (lambda: nm_to_index(3, 1, "Noll"), "'Noll'; allowed: noll, fringe, osa"),
        (lambda: nm_to_index(3, 0, "noll"), r"\(3, 0\)"),
        (lambda: nm_to_index(2, -4, "osa"), r"\(2, -4\)"),
        (lambda: nm_to_index(-2, 0, "fringe"), r"\(-2, 0\)"),
        (lambda: zk.zernike(0, 0.0, 0.0), "below the first noll index"),
        (lambda: zk.zernike_gradient(4, 0.0, 0.0, "zemax"), "allowed"),
        (lambda: radial_series({(2, 1): 1.0}), r"\(2, 1\)"),
        (lambda: radial_series({(2, 0): float("nan")}), r"\(2, 0\) is not finite"),
    ],
)
def test_refusals_say_why_in_one_line(call, words):
    with pytest.raises(ValueError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("j", CLOSED_FORMS)
def test_closed_forms(j):
    x, y = disk_points(200)
    expected = CLOSED_FORMS[j](x, y, x * x + y * y)
    # the written-out sums cancel: largest coefficient 140 x 3 x 2^-52 x a few operations
    np.testing.assert_allclose(zk.zernike(j, x, y), expected, rtol=0, atol=1e-12)


def test_ordering_changes_the_number_and_not_the_values():
    x, y = disk_points(20)
    for n, m in [(1, 1), (2, -2), (3, 1), (4, 0), (7, -1)]:
        noll = zk.zernike(nm_to_noll(n, m), x, y)
        for ordering in ("fringe", "osa"):
            assert np.array_equal(zk.zernike(nm_to_index(n, m, ordering), x, y, ordering), noll)
    assert not np.allclose(zk.zernike(5, x, y, "fringe"), zk.zernike(5, x, y, "noll"))


def test_orthonormal_over_the_disk():
    nodes, weights = np.polynomial.legendre.leggauss(16)  # exact to degree 31 in s; products need 12
    angle = 2 * np.pi * np.arange(32) / 32  # exact for azimuthal orders below 32; products reach 24
    rho = np.sqrt((nodes[:, None] + 1) / 2)
    x, y = rho * np.cos(angle), rho * np.sin(angle)
    basis = np.array([zk.zernike(j, x, y) for j in range(1, 92)])
    gram = np.einsum("arc,brc,r->ab", basis, basis, weights / 2 / angle.size)
    np.testing.assert_allclose(gram, np.eye(91), rtol=0, atol=1e-13)  # 512 terms of up to 26, a few ulp each


@pytest.mark.parametrize("n, m", [(40, 0), (40, 2), (40, -20), (40, 40), (39, 1), (39, -13)])
def test_order_40_is_stable(n, m):
    j = nm_to_noll(n, m)
    x, y = disk_points(60, seed=3)
    x, y = np.r_[x, 1.0, 0.0, 0.999, 1e-9], np.r_[y, 0.0, -1.0, 0.001, -1e-7]
    expected = np.array([exact(n, m, *point) for point in zip(x, y, strict=True)]).T
    peak = sqrt(2 * (n + 1))
    # 40 steps of the recurrence and 1 ulp of t = 2 s - 1 times a slope of up to n^2: 1600 x 2^-52 = 4e-13
    np.testing.assert_allclose(zk.zernike(j, x, y), expected[0], rtol=0, atol=4e-13 * peak)
    # the same ulp times a second derivative of up to n^4/8 of the peak: 3e5 x 2^-52 = 7e-11
    np.testing.assert_allclose(zk.zernike_gradient(j, x, y), expected[1:], rtol=0, atol=7e-11 * peak)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 40), st.data())
def test_value_and_gradient_equal_exact_arithmetic(n, data):
    m = data.draw(st.sampled_from(range(-n, n + 1, 2)))
    x = data.draw(st.floats(-1, 1))
    y = data.draw(st.floats(-1, 1)) * sqrt(1 - x * x)
    value, along_x, along_y = exact(n, m, x, y)
    j = nm_to_noll(n, m)
    ulp = 2.0**-52 * sqrt(2 * (n + 1))
    assert abs(zk.zernike(j, x, y) - value) <= ulp * (n + 1) ** 2  # an ulp of t times d/dt <= n^2 (Markov)
    miss = np.abs(np.subtract(zk.zernike_gradient(j, x, y), (along_x, along_y)))
    assert miss.max() <= ulp * (n + 1) ** 4  # and an ulp of t times d2/dt2 <= n^4/3


@pytest.mark.parametrize("n, m", [(3, 1), (8, -2), (11, 11), (20, 0)])
def test_points_outside_the_disk_get_the_polynomial(n, m):
    got = [zk.zernike(nm_to_noll(n, m), 1.5, -0.75), *zk.zernike_gradient(nm_to_noll(n, m), 1.5, -0.75)]
    np.testing.assert_allclose(got, exact(n, m, 1.5, -0.75), rtol=1e-13)  # 20 steps of a few ulp


def test_small_values_near_the_origin_keep_their_relative_accuracy():
    x, y = 3e-9, -5e-9
    for n, m in [(4, 4), (5, -3), (8, 6), (9, 1)]:
        j = nm_to_noll(n, m)
        got = [zk.zernike(j, x, y), *zk.zernike_gradient(j, x, y)]
        np.testing.assert_allclose(got, exact(n, m, x, y), rtol=1e-13)  # 450 ulp: nothing cancels


def test_the_origin_is_an_ordinary_point():
    for j in range(1, 200):
        n, m = noll_to_nm(j)
        value, along_x, along_y = exact(n, m, 0.0, 0.0)
        assert zk.zernike(j, 0.0, 0.0) == pytest.approx(value, rel=1e-13, abs=0)  # 18 steps, no cancellation
        gradient = zk.zernike_gradient(j, 0.0, 0.0)
        assert gradient == pytest.approx((along_x, along_y), rel=1e-13, abs=0)  # as above; zeros are exact


def test_gradient_is_the_slope_of_the_value():
    x, y = disk_points(50)
    step = 1e-3
    weight = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / step
    offset = step * np.arange(-4, 5)[:, None]
    for j in (2, 3, 4, 11, 29, 38, 120):
        along_x, along_y = zk.zernike_gradient(j, x, y)
        # rounding 1e-15 x 5 / step = 5e-12 and the eighth-order remainder, both times up to 14^2
        np.testing.assert_allclose(along_x, weight @ zk.zernike(j, x + offset, y), rtol=0, atol=1e-9)
        np.testing.assert_allclose(along_y, weight @ zk.zernike(j, x, y + offset), rtol=0, atol=1e-9)


def test_shapes_broadcast():
    x, y = np.linspace(-1, 1, 5), np.linspace(-1, 1, 3)[:, None]
    assert zk.zernike(4, x, y).shape == (3, 5)
    assert [part.shape for part in zk.zernike_gradient(4, x, y)] == [(3, 5)] * 2
    assert zk.zernike(4, 3, 0) == pytest.approx(sqrt(3) * 17, rel=1e-15)  # integers in, one rounding out
    assert np.isnan(zk.zernike(4, np.nan, 0.0))


TERMS = {(0, 0): 0.3, (2, 0): -1.2, (6, 0): 0.4, (1, 1): 0.7, (5, 1): -0.2, (3, -1): 0.5, (2, -2): 1.1,
         (7, 5): -0.6, (9, -5): 0.25, (40, -12): 0.05}  # fmt: skip


def test_series_tables():
    series = radial_series(TERMS)
    assert series.m.tolist() == [0, 1, 2, 5, 12]
    assert series.count.tolist() == [4, 3, 1, 3, 15]
    assert series.offset.tolist() == [0, 4, 7, 8, 11]
    assert series.cosine.shape == series.sine.shape == series.gamma.shape == (26,)
    assert series.cosine[:4].tolist() == [0.3, -1.2 * sqrt(3), 0.0, 0.4 * sqrt(7)]
    assert series.sine[:4].tolist() == [0.0] * 4
    assert series.sine[4:7].tolist() == [0.0, 0.5 * sqrt(8), 0.0]
    assert not series.gamma[series.offset].any()
    assert not series.alpha.flags.writeable


def test_series_recurrence_gives_the_jacobi_polynomials():
    from scipy.special import eval_jacobi

    series = radial_series({(40, 0): 1.0, (21, 1): 1.0, (38, -6): 1.0})
    t = np.linspace(-1, 1, 21)
    for row, m in enumerate(series.m.tolist()):
        previous, value = np.zeros_like(t), np.ones_like(t)
        for k in range(series.count[row]):
            # 20 steps of a few ulp on the largest value, at t = -1
            limit = 1e-13 * abs(eval_jacobi(k, 0, m, -1.0))
            np.testing.assert_allclose(value, eval_jacobi(k, 0, m, t), rtol=0, atol=limit)
            at = series.offset[row] + k
            line = series.alpha[at] * t + series.beta[at]
            previous, value = value, line * value + series.gamma[at] * previous


def test_series_twin_equals_the_sum_of_terms():
    x, y = disk_points(300)
    x, y = np.r_[x, 0.0, 1e-12, 1.02].reshape(3, 101), np.r_[y, 0.0, 0.0, 0.1].reshape(3, 101)
    value, *gradient = evaluate_series(radial_series(TERMS), x, y)
    assert value.shape == (3, 101)
    expected = sum(c * zk.zernike(nm_to_noll(*nm), x, y) for nm, c in TERMS.items())
    slopes = [c * np.array(zk.zernike_gradient(nm_to_noll(*nm), x, y)) for nm, c in TERMS.items()]
    np.testing.assert_allclose(value, expected, rtol=0, atol=2e-13)  # order 40 at 0.05: 4e-13 x 9 x 0.05
    np.testing.assert_allclose(gradient, sum(slopes), rtol=0, atol=3e-11)  # 7e-11 x 9 x 0.05


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(st.integers(1, 91), st.floats(-1, 1), max_size=12))
def test_series_twin_for_any_set_of_terms(coefficients):
    x, y = disk_points(20)
    series = radial_series({noll_to_nm(j): c for j, c in coefficients.items()})
    expected = np.zeros((3, 20))
    for j, c in coefficients.items():
        expected += c * np.array([zk.zernike(j, x, y), *zk.zernike_gradient(j, x, y)])
    got = evaluate_series(series, x, y)
    np.testing.assert_allclose(got[0], expected[0], rtol=0, atol=2e-12)  # 12 terms of up to 5, 12^2 ulp each
    np.testing.assert_allclose(got[1:], expected[1:], rtol=0, atol=3e-10)  # 12^2 times more


@pytest.mark.parametrize(("order", "limit"), [(20, 1e-11), (28, 1e-10)])  # the steepest rows lose two, three digits
def test_all_terms_of_a_high_order_are_evaluated_to_rounding(order, limit):
    x, y = disk_points(200)
    count = (order + 1) * (order + 2) // 2
    coefficients = np.random.default_rng(1).normal(size=count)
    series = radial_series({noll_to_nm(j): c for j, c in enumerate(coefficients, 1)})
    expected = np.zeros((3, 200))
    for j, c in enumerate(coefficients, 1):
        expected += c * np.array([zk.zernike(j, x, y), *zk.zernike_gradient(j, x, y)])
    got = evaluate_series(series, x, y)
    size = np.abs(expected).max(axis=1)
    np.testing.assert_array_less(np.abs(got - expected).max(axis=1), limit * size)


def test_an_empty_series_is_zero():
    series = radial_series({})
    assert series.m.size == series.cosine.size == series.alpha.size == 0
    assert all(np.array_equal(part, np.zeros(3)) for part in evaluate_series(series, np.ones(3), 0.0))


def horner(rows: PowerRows, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """W of power rows: each row's polynomial in t times the real or the imaginary part of zeta^m."""
    t, value, first = 2 * (x * x + y * y) - 1, np.zeros_like(x), 0
    for order, sine, count in zip(rows.order.tolist(), rows.sine, rows.count, strict=True):
        power = (x + 1j * y) ** order
        radial = np.zeros_like(t)
        for coefficient in rows.coefficient[first : first + count]:
            radial = radial * t + coefficient
        value += radial * (power.imag if sine else power.real)
        first += count
    assert first == len(rows.coefficient)
    return value


@settings(max_examples=100, deadline=None)
@given(st.dictionaries(st.tuples(st.integers(0, 5), st.integers(-6, 6)), st.floats(-1, 1), max_size=20))
def test_power_rows_evaluate_to_the_series(terms):
    x, y = disk_points(50)
    x, y = np.r_[x, 0.0, 1.0, 0.0, -0.6], np.r_[y, 0.0, 0.0, -1.0, 0.8]  # the centre and the rim too
    series = radial_series({(2 * k + abs(m), m): value for (k, m), value in terms.items()})
    expected, *_ = evaluate_series(series, x, y)
    size = np.abs(series.cosine).sum() + np.abs(series.sine).sum()
    # The powers of t of k = 5, m = 6 sum up to 550 at t = 1, where the polynomial is 1: 550 roundings of 1.1e-16
    limit = 1e-13 * size + 1e-300  # the last for numbers that underflow
    np.testing.assert_allclose(horner(power_rows(series), x, y), expected, rtol=0, atol=limit)


def test_power_rows_are_those_that_are_not_zero():
    terms = {(2, 2): 1.0, (6, 2): 0.0, (3, -1): 0.5, (5, 1): 0.0, (4, 0): 2.0, (8, 4): 0.0}
    rows = power_rows(radial_series(terms))
    assert rows.order.tolist() == [0, 1, 2]  # ascending, as the kernel raises zeta's power
    assert rows.sine.tolist() == [0, 1, 0]
    assert rows.count.tolist() == [3, 2, 1]  # no powers above the last term that is not zero
    # 2 sqrt(5) (3 t^2 - 1)/2; 0.5 sqrt(8) (3 t - 1)/2; sqrt(6)
    expected = [3 * sqrt(5), 0, -sqrt(5), 0.75 * sqrt(8), -0.25 * sqrt(8), sqrt(6)]
    np.testing.assert_allclose(rows.coefficient, expected, rtol=0, atol=2e-15)  # an ulp of 6.7 and half of one
    both = power_rows(radial_series({(2, 2): 1.0, (2, -2): 1.0}))
    assert both.order.tolist() == [2, 2] and both.sine.tolist() == [0, 1]


@pytest.mark.parametrize("terms", [{}, {(0, 0): 0.0}, {(4, 2): 0.0, (7, -3): 0.0}])
def test_a_series_of_zeros_gives_no_power_rows(terms):
    rows = power_rows(radial_series(terms))
    assert [part.shape for part in (rows.order, rows.sine, rows.count, rows.coefficient)] == [(0,)] * 4
    assert rows.order.dtype == rows.sine.dtype == rows.count.dtype == np.int32


@pytest.mark.parametrize("ordering", ORDERINGS)
def test_fit_recovers_the_coefficients_in_the_given_order(ordering):
    x, y = disk_points(400)
    indices, truth = [11, 4, 29, 2, 6], np.array([0.1, -2.0, 0.03, 1.5, 1e-4])
    values = sum(c * zk.zernike(j, x, y, ordering) for j, c in zip(indices, truth, strict=True))
    got = zernike_fit(x, y, values, indices, ordering)
    np.testing.assert_allclose(got, truth, rtol=0, atol=1e-14)  # well conditioned (about 2), values up to 5


def test_fit_skips_what_is_not_finite_not_on_the_disk_or_weighs_nothing():
    y, x = np.mgrid[-1.2:1.2:41j, -1.2:1.2:41j]
    values = 0.5 * zk.zernike(8, x, y) + 2.0
    values[x * x + y * y > 1] = 1e6
    values[20, 20] = np.nan
    values[20, 21] = 1e6
    weights = np.ones_like(x)
    weights[20, 21] = 0.0
    got = zernike_fit(x, y, values, [1, 8], weights=weights)
    np.testing.assert_allclose(got, [2.0, 0.5], rtol=0, atol=1e-14)  # a few ulp of 2


def test_fit_keeps_samples_on_the_rim():
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    x, y = np.cos(angle), np.sin(angle)
    got = zernike_fit(x, y, 2 * x - 2 * y, [1, 2, 3, 5, 6, 9, 10])  # too few samples without the rim
    np.testing.assert_allclose(got, [0, 1, -1, 0, 0, 0, 0], rtol=0, atol=1e-14)  # a few ulp


def test_fit_weights_are_inverse_variances():
    # two samples of one constant: the weighted mean, (1 x 0 + 3 x 4)/4
    got = zernike_fit([0.1, 0.2], 0.0, [0.0, 4.0], [1], weights=[1.0, 3.0])
    assert got == pytest.approx([3.0], rel=1e-14)  # a few ulp


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"indices": [1, 2, 3, 4, 5]}, "5 Zernike terms cannot be fitted to 4 samples"),
        ({"indices": [1, 2], "weights": [0.0, 0.0, 0.0, 1.0]}, "2 Zernike terms .* to 1 samples"),
        ({"indices": []}, "at least one index"),
        ({"indices": [1, 1]}, "only 1 of the 2"),
        ({"indices": [1, 4]}, "only 1 of the 2"),  # all samples at one radius
        ({"indices": [0, 1]}, "below the first noll index"),
        ({"weights": [1.0, -1.0, 1.0, 1.0]}, "not negative"),
        ({"weights": [1.0, np.nan, 1.0, 1.0]}, "finite"),
    ],
)
def test_fit_refusals(change, words):
    arguments = {"x": [0.5, 0.0, -0.5, 0.0], "y": [0.0, 0.5, 0.0, -0.5], "values": np.ones(4), "indices": [1]}
    with pytest.raises(ValueError, match=words):
        zernike_fit(**(arguments | change))
