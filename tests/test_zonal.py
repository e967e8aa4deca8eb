"""Zonal integration on irregular nodes: exactness, order, islands, noise, reuse, refusals, helpers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from irtscots_cl import zonal


def sheared_grid(rows: int, columns: int, size_mm: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    """Smoothly distorted quadrilaterals: every neighbour vector has both components, no two pitches agree."""
    v, u = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    x = u + 0.10 * v + 0.08 * u * u - 0.05 * u * v
    y = v - 0.15 * u + 0.06 * v * v + 0.07 * u * v
    return size_mm / 2 * x, size_mm / 2 * y


def disk(rows: int, columns: int) -> np.ndarray:
    v, u = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    return u * u + v * v <= 1


def quadratic(x, y, c):
    z = c[0] * x + c[1] * y + c[2] * x * x + c[3] * x * y + c[4] * y * y
    return z, c[0] + 2 * c[2] * x + c[3] * y, c[1] + c[3] * x + 2 * c[4] * y


def cubic(x, y):
    return x**3 - 2 * x * x * y + y**3, 3 * x * x - 4 * x * y, -2 * x * x + 3 * y * y


def levelled(z: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """z with zero mean over each island; the islands found by flooding, not by the code under test."""
    result, left = np.full(mask.shape, np.nan), {tuple(p) for p in np.argwhere(mask).tolist()}
    while left:
        front = [left.pop()]
        members = list(front)
        while front:
            r, c = front.pop()
            for p in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                if p in left:
                    left.remove(p)
                    front.append(p)
                    members.append(p)
        at = tuple(np.array(members).T)
        result[at] = z[at] - z[at].mean()
    return result


def dense_southwell(x, y, p, q, mask):
    """Minimum-norm least squares of the written-out pair equations; the null space is the pistons."""
    number = {tuple(node): k for k, node in enumerate(np.argwhere(mask).tolist())}
    rows, rises = [], []
    for (r, c), first in number.items():
        for other in ((r, c + 1), (r + 1, c)):
            if other not in number:
                continue
            row = np.zeros(len(number))
            row[first], row[number[other]] = -1, 1
            dx, dy = x[other] - x[r, c], y[other] - y[r, c]
            rows.append(row)
            rises.append(dx * (p[r, c] + p[other]) / 2 + dy * (q[r, c] + q[other]) / 2)
    z = np.full(mask.shape, np.nan)
    z[mask] = np.linalg.lstsq(np.array(rows), np.array(rises))[0] if rows else 0.0
    return z


def assert_heights(got, expected, limit):
    assert np.array_equal(np.isnan(got), np.isnan(expected))
    assert np.nanmax(np.abs(got - expected)) <= limit


def test_slope_signs():
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    mask = np.ones((3, 4), bool)
    uphill_x = zonal.integrate_slopes(x, y, np.full((3, 4), 0.5), np.zeros((3, 4)), mask)
    uphill_y = zonal.integrate_slopes(x, y, np.zeros((3, 4)), np.full((3, 4), 0.5), mask)
    np.testing.assert_allclose(uphill_x, 0.5 * (x - 1.5), rtol=0, atol=1e-14)  # a few ulp of 1
    np.testing.assert_allclose(uphill_y, 0.5 * (y - 1.0), rtol=0, atol=1e-14)  # a few ulp of 1


@pytest.mark.parametrize("coefficients", [(3e-4, -2e-4, 0, 0, 0), (1e-4, 2e-4, 3e-5, -4e-5, 1e-5)])
def test_exact_on_planes_and_quadratics_over_sheared_nodes(coefficients):
    x, y = sheared_grid(31, 40)
    mask = disk(31, 40)
    z, p, q = quadratic(x, y, coefficients)
    got = zonal.integrate_slopes(x, y, p, q, mask)
    # rounding alone: heights of 0.1 mm, pair errors of 1e-17 summed over 40 nodes, 20 times what was seen
    assert_heights(got, levelled(z, mask), 1e-14)


def test_both_components_of_the_pair_vector_count():
    x, y = sheared_grid(20, 20)
    mask = np.ones((20, 20), bool)
    _, p, q = quadratic(x, y, (0, 3e-4, 0, 0, 0))
    straight = zonal.integrate_slopes(x, y, p, q, mask)
    tilted = zonal.integrate_slopes(x, y, p, np.zeros_like(q), mask)
    assert zonal.rms(straight, mask) > 1e-3
    assert not tilted.any()  # p is zero everywhere, so nothing else can make a height


def test_second_order_on_a_cubic_over_sheared_nodes():
    errors = []
    for count in (17, 33, 65):
        x, y = sheared_grid(count, count, 2.0)
        mask = np.ones((count, count), bool)
        z, p, q = cubic(x, y)
        got = zonal.integrate_slopes(x, y, p, q, mask)
        errors.append(zonal.rms(got - levelled(z, mask), mask))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert 1e-4 < errors[0] < 1e-2  # h^2/12 x z''' = 0.0013 x 6: there is an error to see
    assert np.all(np.abs(orders - 2) < 0.1)  # the edges' share of nodes falls by half each time


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 7), st.integers(1, 7), st.integers(0, 2**32 - 1), st.floats(0.1, 1))
def test_equals_dense_least_squares_on_any_mask(rows, columns, seed, fill):
    random = np.random.default_rng(seed)
    mask = random.random((rows, columns)) < fill
    mask[random.integers(rows), random.integers(columns)] = True
    x, y, p, q = random.normal(size=(4, rows, columns))
    got = zonal.integrate_slopes(x, y, p, q, mask)
    # 49 nodes, rises of up to 30, smallest eigenvalue about (pi/49)^2 for a snake: 1e-13 x 30
    assert_heights(got, dense_southwell(x, y, p, q, mask), 1e-11)


ISLANDS = np.array([list(line) for line in ("##.#.", "##...", "..##.", "..##.", ".....", "#####")]) == "#"


def test_islands_have_their_own_piston_and_diagonals_do_not_join():
    x, y = sheared_grid(*ISLANDS.shape)
    z, p, q = quadratic(x, y, (1e-3, 2e-3, 3e-5, 1e-5, -2e-5))
    expected = levelled(z, ISLANDS)
    got = zonal.integrate_slopes(x, y, p, q, ISLANDS)
    assert_heights(got, expected, 1e-14)  # heights of 0.1 mm, rounding
    assert got[0, 3] == 0.0  # alone
    islands = zonal.zonal_integrator(ISLANDS).islands
    assert islands.max() == 4 and islands[0, 0] != islands[2, 2]
    for island in range(1, 5):
        assert abs(got[islands == island].mean()) < 1e-16  # an ulp of 0.1 mm


def test_a_bridge_of_one_node_carries_the_height_across():
    x, y = sheared_grid(9, 21)
    mask = np.ones((9, 21), bool)
    mask[:, 10] = False
    z, p, q = quadratic(x, y, (1e-3, 2e-3, 3e-5, 1e-5, -2e-5))
    apart = zonal.integrate_slopes(x, y, p, q, mask)
    assert np.nanmax(np.abs(apart - (z - z[mask].mean()))) > 1e-2  # the sides do not know of each other
    mask[4, 10] = True
    joined = zonal.integrate_slopes(x, y, p, q, mask)
    assert_heights(joined, np.where(mask, z - z[mask].mean(), np.nan), 1e-14)  # rounding of 0.1 mm


def test_ring_mask():
    x, y = sheared_grid(31, 31)
    mask = disk(31, 31)
    mask[10:21, 9:20] = False
    z, p, q = quadratic(x, y, (1e-4, 2e-4, 3e-5, -4e-5, 1e-5))
    got = zonal.integrate_slopes(x, y, p, q, mask)
    assert_heights(got, levelled(z, mask), 1e-14)  # rounding of 0.1 mm


@pytest.mark.parametrize("shape", [(1, 1), (4, 5)])
def test_a_single_node_has_height_zero(shape):
    mask = np.zeros(shape, bool)
    mask[-1, -1] = True
    got = zonal.integrate_slopes(*np.ones((4, *shape)), mask)
    assert got[-1, -1] == 0.0 and np.count_nonzero(~np.isnan(got)) == 1


def test_a_batch_equals_a_loop():
    x, y = sheared_grid(12, 15)
    p, q = np.random.default_rng(5).normal(size=(2, 2, 3, 12, 15))
    for mask in (disk(12, 15), np.eye(12, 15, dtype=bool)):
        got = zonal.integrate_slopes(x, y, p, q, mask)
        assert got.shape == (2, 3, 12, 15)
        for index in np.ndindex(2, 3):
            # solves of several columns may add up in another order: ulps of heights of up to 50
            assert_heights(got[index], zonal.integrate_slopes(x, y, p[index], q[index], mask), 1e-12)
    assert zonal.integrate_slopes(x, y, p[:0], q[:0], mask).shape == (0, 3, 12, 15)


def test_values_outside_the_mask_are_never_read():
    x, y = sheared_grid(12, 15)
    mask = disk(12, 15)
    p, q = np.random.default_rng(5).normal(size=(2, 12, 15))
    clean = zonal.integrate_slopes(x, y, p, q, mask)
    dirty = [np.where(mask, a, np.nan) for a in (x, y, p, q)]
    assert np.array_equal(zonal.integrate_slopes(*dirty, mask), clean, equal_nan=True)


def test_noise_gain_of_a_110_pixel_pupil():
    r, c = np.mgrid[:125, :125] - 62.0
    mask = r * r + c * c <= 55.87**2
    assert mask.sum() == 9785
    p, q = np.random.default_rng(11).normal(size=(2, 96, 125, 125))
    z = zonal.integrate_slopes(9.6 * c, 9.6 * r, p, q, mask)
    gain = {}
    for terms in ("piston", "piston_tilt", "piston_tilt_power"):
        left = [zonal.remove_terms(c, r, one, mask, terms) for one in z]
        gain[terms] = np.sqrt(np.mean([zonal.rms(one, mask) ** 2 for one in left]))
    print({terms: f"{value:.2f} nm per urad" for terms, value in gain.items()})
    # 9.1 and 7.9 known independently to a digit; 96 maps scatter by 1.4/sqrt(96) = 0.14 and 0.06: 4 sigma
    assert gain["piston"] == pytest.approx(9.1, abs=0.6)
    assert gain["piston_tilt"] == pytest.approx(7.9, abs=0.27)
    assert gain["piston_tilt_power"] < gain["piston_tilt"]


def test_the_factorisation_is_reused(monkeypatch):
    zonal._cached_integrator.cache_clear()
    calls = []
    real = zonal.splu
    monkeypatch.setattr(zonal, "splu", lambda *a, **k: calls.append(1) or real(*a, **k))
    mask = disk(12, 15)
    for seed in range(3):
        arrays = np.random.default_rng(seed).normal(size=(4, 12, 15))
        zonal.integrate_slopes(*arrays, mask.copy())
    assert len(calls) == 1
    other = mask.copy()
    other[6, 7] = False
    zonal.integrate_slopes(*arrays, other)
    zonal.integrate_slopes(*(a.reshape(15, 12) for a in arrays), mask.reshape(15, 12))  # same bytes
    assert len(calls) == 3
    zonal._cached_integrator.cache_clear()


def test_the_integrator_does_not_see_later_changes_of_the_mask():
    x, y = sheared_grid(6, 6)
    mask = np.ones((6, 6), bool)
    integrator = zonal.ZonalIntegrator.from_mask(mask)
    mask[:] = False
    assert not np.isnan(integrator.heights(x, y, x, y)).any()
    with pytest.raises(ValueError, match="read-only"):
        integrator.mask[0, 0] = False


def arguments() -> dict:
    x, y = sheared_grid(5, 4)
    mask = np.ones((5, 4), bool)
    mask[0, 0] = False
    return {"x_mm": x, "y_mm": y, "slope_x": x * 0, "slope_y": y * 0, "mask": mask}


@pytest.mark.parametrize("name", ["x_mm", "y_mm", "slope_x", "slope_y"])
def test_refuses_a_wrong_shape_by_name(name):
    for wrong in (np.zeros((4, 5)), np.zeros(4), np.zeros((2, 5, 5))):
        with pytest.raises(ValueError, match=rf"^{name} has shape .*, expected \((2, )?5, 4\) for this mask"):
            zonal.integrate_slopes(**(arguments() | {name: wrong}))


@pytest.mark.parametrize("name", ["x_mm", "y_mm", "slope_x", "slope_y"])
def test_refuses_non_finite_values_with_their_number(name):
    wrong = arguments()
    wrong[name] = wrong[name].copy()
    wrong[name][[0, 1, 2], [0, 1, 2]] = np.nan, np.inf, np.nan  # the first lies outside the mask
    with pytest.raises(ValueError, match=f"^{name} is not finite at 2 of 19 points inside the mask$"):
        zonal.integrate_slopes(**wrong)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"method": "fried"}, "^unknown integration method 'fried'; allowed: southwell$"),
        ({"mask": np.zeros((5, 4), bool)}, "^mask is empty"),
        ({"mask": np.ones((5, 4))}, r"^mask must be boolean .* got float64 of shape \(5, 4\)$"),
        ({"mask": np.ones(4, bool)}, r"^mask must be boolean .* shape \(4,\)$"),
        ({"slope_x": np.zeros((2, 5, 4))}, r"^slope_y has shape \(5, 4\), expected \(2, 5, 4\)"),
    ],
)
def test_refuses_other_bad_input(change, words):
    with pytest.raises(ValueError, match=words):
        zonal.integrate_slopes(**(arguments() | change))


def test_remove_terms_takes_out_what_its_name_says_and_no_more():
    x, y = sheared_grid(21, 24)
    x, y, mask = x + 500.0, y - 80.0, disk(21, 24)
    shapes = [np.full_like(x, 3.0), 0.02 * x - 0.01 * y, 1e-3 * (x * x + y * y)]
    astigmatism = x * y * 1e-3
    for k, terms in enumerate(zonal.TERMS):
        got = zonal.remove_terms(x, y, sum(shapes[:k], astigmatism), mask, terms)
        plain = zonal.remove_terms(x, y, astigmatism, mask, terms)
        assert np.array_equal(np.isnan(got), ~mask)
        assert np.nanmax(np.abs(got - plain)) < 1e-12  # sums of up to 300, off-centre by ten radii
        if k < 3:
            more = zonal.remove_terms(x, y, sum(shapes[: k + 1], astigmatism), mask, terms)
            assert zonal.rms(more - plain, mask) > 0.1  # the next term stays
    assert np.array_equal(zonal.remove_terms(x, y, x, mask, "none")[mask], x[mask])


def test_remove_terms_is_a_projection_over_the_finite_samples():
    x, y = sheared_grid(21, 24)
    mask = disk(21, 24)
    z = np.random.default_rng(2).normal(size=mask.shape)
    z[10, 10] = np.nan
    used = mask & np.isfinite(z)
    got = zonal.remove_terms(x, y, z, mask, "piston_tilt_power")
    assert np.array_equal(np.isfinite(got), used)
    for column in (np.ones_like(x), x, y, x * x + y * y):
        assert abs(np.sum(got[used] * column[used])) < 1e-10  # 400 samples of up to 5000, rounding
    assert np.isnan(z[10, 10]) and np.isfinite(z[0, 0])  # the input is left alone


def test_remove_terms_does_not_care_where_the_origin_is():
    x, y = sheared_grid(21, 24)
    mask = disk(21, 24)
    z = np.random.default_rng(2).normal(size=mask.shape)
    near = zonal.remove_terms(x, y, z, mask, "piston_tilt_power")
    far = zonal.remove_terms(x + 1e6, y - 2e6, z, mask, "piston_tilt_power")
    assert np.nanmax(np.abs(far - near)) < 1e-10  # the shifted positions round at 2e-10 of 50 mm


def test_rms_is_about_zero_and_inside_the_mask():
    z = np.array([[3.0, 4.0, 100.0, np.nan]])
    mask = np.array([[True, True, False, True]])
    assert zonal.rms(z, mask) == pytest.approx(np.sqrt(12.5), rel=1e-15)  # one rounding


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda x, m: zonal.remove_terms(x, x, x, m, "tilt"), "'tilt'; allowed: none, piston, piston_tilt, "),
        (lambda x, m: zonal.remove_terms(x, x, x[:2], m, "piston"), "^z has shape"),
        (lambda x, m: zonal.remove_terms(x[:2], x, x, m, "piston"), "^x_mm has shape"),
        (lambda x, m: zonal.remove_terms(x, x[:2], x, m, "piston"), "^y_mm has shape"),
        (lambda x, m: zonal.remove_terms(x, x / 0, x, m, "piston"), "^y_mm is not finite at 9 of 9"),
        (lambda x, m: zonal.remove_terms(x, x, x * np.nan, m, "piston"), "1 terms cannot be fitted to 0"),
        (lambda x, m: zonal.remove_terms(x, x, x, ~m, "none"), "^mask is empty"),
        (lambda x, m: zonal.rms(x * np.nan, m), "no finite sample"),
        (lambda x, m: zonal.rms(x[:2], m), "^z has shape"),
        (lambda x, m: zonal.rms(x, m * 1), "^mask must be boolean"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
def test_helpers_refuse_bad_input(call, words):
    with pytest.raises(ValueError, match=words):
        call(np.ones((3, 3)), np.ones((3, 3), bool))
