"""Integration methods: what each is exact for, order, islands, chains, many maps, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from nodes import BRIDGE, ISLANDS, disk, levelled, lines, polynomial, ring, sheared_grid, straight_grid
from scipy.integrate import quad
from scipy.interpolate import CubicSpline, KroghInterpolator
from tracers import setup_of

from irtscots_cl.maths.integration import METHODS, integrate_slopes, modal
from irtscots_cl.maths.integration import zonal_rules as rises
from irtscots_cl.maths.integration.node_graph import NodeGraph
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.optics.surface import Surface
from irtscots_cl.scene.presets import load_scene

NM = 1e-6  # in mm
ZONAL = ("southwell", "cubic", "spline")
FOURTH_ORDER = ("cubic", "spline")
MASKS = {
    "full": np.ones((12, 15), bool),
    "disk": disk(31, 40),
    "ring": ring(31),
    "islands": ISLANDS,
    "bridge": BRIDGE,
    "short chains": lines("#.##.###.####", ".............", "#.##.###.####", "#.##.###.####"),
}


def assert_heights(got, expected, limit):
    assert np.array_equal(np.isnan(got), np.isnan(expected))
    assert np.nanmax(np.abs(got - expected)) <= limit


@pytest.mark.parametrize("method", METHODS)
def test_slope_signs(method):
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    mask = np.ones((3, 4), bool)
    uphill_x = integrate_slopes(x, y, np.full((3, 4), 0.5), np.zeros((3, 4)), mask, method)
    uphill_y = integrate_slopes(x, y, np.zeros((3, 4)), np.full((3, 4), 0.5), mask, method)
    np.testing.assert_allclose(uphill_x, 0.5 * (x - 1.5), rtol=0, atol=1e-14)  # a few ulp of 1
    np.testing.assert_allclose(uphill_y, 0.5 * (y - 1.0), rtol=0, atol=1e-14)  # a few ulp of 1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", MASKS)
@pytest.mark.parametrize("degree", [1, 2])
def test_exact_on_quadratics_over_any_nodes(method, name, degree):
    mask = MASKS[name]
    x, y = np.array(sheared_grid(*mask.shape)) + 0.2 * np.random.default_rng(0).normal(size=(2, *mask.shape))
    z, p, q = polynomial(degree, x, y)
    got = integrate_slopes(x, y, p, q, mask, method, join=False)
    assert_heights(got, levelled(z, mask), 1e-12)  # heights of 1 mm: rounding summed over 40 nodes
    assert np.nanmax(np.abs(got)) > 0.05
    joined = integrate_slopes(x, y, p, q, mask, method)
    assert_heights(joined, np.where(mask, z - z[mask].mean(), np.nan), 1e-11)  # weights of condition 1e5


@pytest.mark.parametrize("method", ZONAL)
def test_exact_on_quartics_where_chains_are_straight_and_have_four_nodes(method):
    mask = disk(40, 31)
    mask[12:25, 9:13] = False
    assert min(chain.size for chain in NodeGraph.from_mask(mask).chains) >= 4
    x, y = straight_grid(*mask.shape)
    errors = []
    for degree in (4, 5):
        z, p, q = polynomial(degree, x, y)
        got = integrate_slopes(x, y, p, q, mask, method)
        errors.append(np.nanmax(np.abs(got - levelled(z, mask))))
    if method in FOURTH_ORDER:
        assert errors[0] < 1e-12  # heights of 1 mm: rounding summed over 40 nodes
    else:
        assert errors[0] > 1e-4
    assert errors[1] > 1e-7  # nothing is exact for what has one degree more


@pytest.mark.parametrize("method", FOURTH_ORDER)
@pytest.mark.parametrize(("nodes", "degree"), [(1, 1), (2, 2), (3, 3), (4, 4), (5, 4)])
def test_short_chains_take_the_highest_order_they_can(method, nodes, degree):
    for shape in ((1, nodes), (nodes, 1)):
        x, y = straight_grid(*shape)
        mask = np.ones(shape, bool)
        for k, exact in ((degree, True), (degree + 1, nodes == 1)):
            z, p, q = polynomial(k, x, y)
            error = np.abs(integrate_slopes(x, y, p, q, mask, method) - levelled(z, mask)).max()
            assert error < 1e-13 if exact else error > 1e-5  # rounding of 1 mm


@pytest.mark.parametrize("nodes", [50, 300, 1500])
def test_modal_is_exact_up_to_its_radial_order_on_any_nodes(nodes):
    size = round(np.sqrt(nodes * 4 / np.pi))
    mask = disk(size, size)
    x, y = sheared_grid(size, size)
    order = modal.radial_order(int(mask.sum()))
    for degree, exact in ((order, True), (order + 2, False)):
        z, p, q = polynomial(degree, x, y)
        error = np.nanmax(np.abs(integrate_slopes(x, y, p, q, mask, "modal") - levelled(z, mask)))
        # the slopes' rounding times the fit's condition, up to 1e4
        assert error < 1e-11 * np.abs(z[mask]).max() if exact else error > 1e-6


def test_modal_order_grows_with_the_nodes_to_a_limit():
    orders = [modal.radial_order(nodes) for nodes in range(1, 100_001, 7)]
    assert [modal.radial_order(nodes) for nodes in (1, 2, 3, 4, 9, 9785)] == [1, 1, 2, 2, 3, modal.MAX_ORDER]
    assert orders == sorted(orders) and orders[-1] == modal.MAX_ORDER
    for nodes in (3, 10, 30, 100, 1000):
        order = modal.radial_order(nodes)
        assert order * (order + 3) // 2 <= min(2 * nodes, nodes + 2)  # fewer terms than slopes


@pytest.mark.parametrize(
    ("mask", "order"),
    [(disk(15, 15), 9), (ring(21), 10), (lines("####", "#...", "#..."), 2), (np.ones((3, 40), bool), 3)],
)
def test_modal_is_the_least_squares_polynomial(mask, order):
    """Against a plain fit of products of Legendre polynomials, all rows in one matrix.

    Three rows cannot tell some polynomials of degree four from flat: the order is lower than the nodes alone allow.
    """
    x, y = sheared_grid(*mask.shape, 2.0)
    p, q = np.random.default_rng(4).normal(size=(2, *mask.shape))
    of = np.polynomial.legendre
    columns = []
    for i in range(order + 1):
        for j in range(order + 1 - i):
            c = np.zeros((order + 1, order + 1))
            c[i, j] = 1.0
            at = x[mask], y[mask]
            columns.append([of.legval2d(*at, part) for part in (c, of.legder(c, axis=0), of.legder(c, axis=1))])
    height, along_x, along_y = (np.array(part).T for part in zip(*columns, strict=True))
    fit = np.linalg.lstsq(np.concatenate([along_x, along_y]), np.concatenate([p[mask], q[mask]]), rcond=1e-10)[0]
    expected = np.full(mask.shape, np.nan)
    expected[mask] = height @ fit - (height @ fit).mean()
    got = integrate_slopes(x, y, p, q, mask, "modal")
    assert_heights(got, expected, 1e-9)  # heights of 1, conditions of up to 1e5


@pytest.mark.parametrize(("method", "order"), [("southwell", 2), ("cubic", 4), ("spline", 4)])
def test_order_of_convergence_over_sheared_nodes(method, order):
    errors = []
    for count in (33, 65, 129):
        x, y = sheared_grid(count, count, 2.0)
        mask = np.ones((count, count), bool)
        z, p, q = np.sin(2 * x + y), 2 * np.cos(2 * x + y), np.cos(2 * x + y)
        errors.append(rms(integrate_slopes(x, y, p, q, mask, method) - levelled(z, mask), mask))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    print(method, errors, orders)
    assert np.all(np.abs(orders - order) < 0.15)  # 0.08 was seen: the next order has some part in the coarsest
    assert errors[-1] > 1e-12  # not rounding


@pytest.mark.parametrize("method", FOURTH_ORDER)
@pytest.mark.parametrize("nodes", [2, 3, 4, 9])
def test_a_rise_is_the_integral_along_a_smooth_curve_through_the_nodes(method, nodes):
    """Nodes anywhere, slopes of anything: against SciPy's interpolators and adaptive quadrature."""
    x, y, p, q = np.random.default_rng(nodes).normal(size=(4, nodes))
    graph = NodeGraph.from_mask(np.ones((1, nodes), bool))
    got = getattr(rises, f"{method}_rises")(graph, x, y, p[None], q[None])[0]
    t = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(y))))
    for k in range(nodes - 1):
        first = min(max(k - 1, 0), max(nodes - 4, 0))
        near = slice(first, first + 4) if method == "cubic" else slice(None)
        curve = (KroghInterpolator if method == "cubic" else CubicSpline)(t[near], np.array([x, y, p, q])[:, near].T)
        step = curve.derivative if method == "cubic" else curve.derivative()
        expected = quad(lambda s, c=curve, d=step: c(s)[2:] @ d(s)[:2], t[k], t[k + 1], epsabs=1e-12)[0]
        assert abs(got[k] - expected) < 1e-9 * max(1.0, abs(expected))  # rounding: pitches differ tenfold


@pytest.mark.parametrize("method", METHODS)
def test_the_axes_may_be_turned_and_the_grid_read_in_any_direction(method):
    """The heights follow from the surface alone: not from where x points, nor which node comes first."""
    mask = disk(14, 17)
    mask[4:7, 9:12] = False
    x, y = sheared_grid(14, 17, 2.0)
    p, q = np.random.default_rng(8).normal(size=(2, 14, 17))
    plain = integrate_slopes(x, y, p, q, mask, method)
    limit = 1e-10  # heights of 1; the modal fit's condition of 1e4
    for angle in (0.3, np.pi / 2, 2.0):
        c, s = np.cos(angle), np.sin(angle)
        turned = integrate_slopes(c * x - s * y, s * x + c * y, c * p - s * q, s * p + c * q, mask, method)
        assert_heights(turned, plain, limit)
    for change in (lambda a: a.T, lambda a: a[::-1], lambda a: a[:, ::-1]):
        assert_heights(integrate_slopes(*map(change, (x, y, p, q, mask)), method), change(plain), limit)
    assert_heights(integrate_slopes(3 * x, 3 * y, p, q, mask, method), 3 * plain, limit)


@pytest.mark.parametrize("method", ZONAL)
def test_both_components_of_the_pair_vector_count(method):
    x, y = sheared_grid(20, 20)
    mask = np.ones((20, 20), bool)
    z, p, q = y * 3e-4, x * 0, x * 0 + 3e-4
    assert rms(integrate_slopes(x, y, p, q, mask, method), mask) == pytest.approx(np.std(z), rel=1e-12)  # rounding
    assert not integrate_slopes(x, y, p, q * 0, mask, method).any()  # p is zero, so nothing else can make a height


@pytest.mark.parametrize("method", METHODS)
def test_islands_have_their_own_piston_and_diagonals_do_not_join(method):
    x, y = sheared_grid(*ISLANDS.shape)
    p, q = np.random.default_rng(2).normal(size=(2, *ISLANDS.shape))
    open_pool = integrate_slopes(x, y, p, q, ISLANDS, method, join=False)
    assert open_pool[0, 3] == 0.0  # alone
    for rows, columns in ((slice(0, 2), slice(0, 2)), (slice(2, 4), slice(2, 4)), (slice(5, 6), slice(None))):
        alone = np.zeros_like(ISLANDS)
        alone[rows, columns] = True
        apart = integrate_slopes(x, y, p, q, alone, method)
        assert np.abs(apart[alone] - open_pool[alone]).max() < 1e-12  # heights of 100, rounding
        assert abs(open_pool[alone].mean()) < 1e-13 and np.ptp(open_pool[alone]) > 1


@pytest.mark.parametrize("method", METHODS)
def test_a_bridge_of_one_node_carries_the_height_across(method):
    x, y = sheared_grid(*BRIDGE.shape)
    z, p, q = polynomial(2, x, y)
    apart = BRIDGE.copy()
    apart[:, 10] = False
    expected = z - z[apart].mean()
    assert np.abs(integrate_slopes(x, y, p, q, apart, method, join=False) - expected)[apart].max() > 0.1
    joined = integrate_slopes(x, y, p, q, BRIDGE, method)
    assert_heights(joined, np.where(BRIDGE, z - z[BRIDGE].mean(), np.nan), 1e-12)  # rounding of 1 mm


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(1, 1), (4, 5)])
def test_a_single_node_has_height_zero(method, shape):
    mask = np.zeros(shape, bool)
    mask[-1, -1] = True
    got = integrate_slopes(*np.ones((4, *shape)), mask, method)
    assert got[-1, -1] == 0.0 and np.count_nonzero(~np.isnan(got)) == 1


@pytest.mark.parametrize("method", METHODS)
def test_many_maps_are_integrated_as_one_by_one(method):
    x, y = sheared_grid(12, 15)
    p, q = np.random.default_rng(5).normal(size=(2, 2, 3, 12, 15))
    for mask in (disk(12, 15), np.eye(12, 15, dtype=bool)):
        got = integrate_slopes(x, y, p, q, mask, method, join=False)
        assert got.shape == (2, 3, 12, 15)
        for index in np.ndindex(2, 3):
            # sums over several columns may add up in another order: ulps of heights of up to 50
            one = integrate_slopes(x, y, p[index], q[index], mask, method, join=False)
            assert_heights(got[index], one, 1e-12)
    assert integrate_slopes(x, y, p[:0], q[:0], mask, method).shape == (0, 3, 12, 15)


@pytest.mark.parametrize("rows", [1, 2, 3, 5])
def test_modal_leaves_out_what_strips_cannot_tell_from_flat(rows):
    """Straight rows do not see at all a polynomial that is level on each; the quadratic must not lose a part to it."""
    x, y = straight_grid(rows, 40)
    mask = np.ones((rows, 40), bool)
    z, p, q = polynomial(2, x, y)
    assert_heights(integrate_slopes(x, y, p, q, mask, "modal"), levelled(z, mask), 1e-12)  # heights of 1 mm, rounding


def test_modal_in_blocks_is_modal_in_one(monkeypatch):
    mask = disk(31, 31)
    x, y = sheared_grid(31, 31)
    p, q = np.random.default_rng(5).normal(size=(2, 3, 31, 31))
    whole = integrate_slopes(x, y, p, q, mask, "modal")
    monkeypatch.setattr(modal, "_BLOCK", 100)
    assert_heights(integrate_slopes(x, y, p, q, mask, "modal"), whole, 1e-11)  # heights of 50, condition 100


@pytest.mark.parametrize("method", METHODS)
def test_values_outside_the_mask_are_never_read(method):
    x, y = sheared_grid(12, 15)
    mask = disk(12, 15)
    p, q = np.random.default_rng(5).normal(size=(2, 12, 15))
    clean = integrate_slopes(x, y, p, q, mask, method)
    dirty = [np.where(mask, a, np.nan) for a in (x, y, p, q)]
    assert np.array_equal(integrate_slopes(*dirty, mask, method), clean, equal_nan=True)


@pytest.mark.parametrize(
    ("method", "min_nm", "most_nm"),
    # seen: 0.304, 0.0016, 0.0003 and 0; without the pixels at the edge 0.28, 0.0016, 0.0003
    [("southwell", 0.25, 0.35), ("cubic", 0, 0.002), ("spline", 0, 0.0005), ("modal", 0, 1e-8)],
)
def test_error_on_the_deviation_of_six_zernike_terms(method, min_nm, most_nm):
    """At the points that 125 x 125 pixels see; the rim's pixels see only part of their footprint on the mirror."""
    scene = load_scene("sphere-deviated")
    footprint = setup_of(scene.nominal()).chief_rays.footprint
    mask = footprint.coverage >= 0.5
    assert (footprint.coverage[mask] < 1).sum() > 200
    x, y = (np.where(mask, v, 0.0) for v in (footprint.x_mm, footprint.y_mm))
    z, p, q = Surface.of(scene.mirror).deviation_at(x, y)
    error = remove_terms(x, y, integrate_slopes(x, y, p, q, mask, method) - z, mask, "piston_tilt")
    assert min_nm * NM <= rms(error, mask) <= most_nm * NM
    assert np.nanmax(np.abs(error)) < 12 * most_nm * NM  # no node at the edge stands out: 4, 7 and 12 times the rms


@pytest.mark.slow
def test_a_million_pixels_need_no_factorisation(monkeypatch):
    monkeypatch.setattr(NodeGraph, "_solved", None)
    mask = disk(1000, 1000)
    x, y = sheared_grid(1000, 1000)
    z, p, q = polynomial(2, x, y)
    got = integrate_slopes(x, y, p, q, mask)
    assert np.nanmax(np.abs(got - (z - z[mask].mean()))) < 1e-11  # heights of 1 mm: rounding summed over 1000 nodes


def arguments() -> dict:
    x, y = sheared_grid(5, 4)
    mask = np.ones((5, 4), bool)
    mask[0, 0] = False
    return {"x_mm": x, "y_mm": y, "slope_x": x * 0, "slope_y": y * 0, "mask": mask}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["x_mm", "y_mm", "slope_x", "slope_y"])
def test_refuses_a_wrong_shape_by_name(name, method):
    for wrong in (np.zeros((4, 5)), np.zeros(4), np.zeros((2, 5, 5))):
        with pytest.raises(ValueError, match=rf"^{name} has shape .*, expected \((2, )?5, 4\) for this mask"):
            integrate_slopes(**(arguments() | {name: wrong}), method=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["x_mm", "y_mm", "slope_x", "slope_y"])
def test_refuses_non_finite_values_with_their_number(name, method):
    wrong = arguments()
    wrong[name] = wrong[name].copy()
    wrong[name][[0, 1, 2], [0, 1, 2]] = np.nan, np.inf, np.nan  # the first lies outside the mask
    with pytest.raises(ValueError, match=f"^{name} is not finite at 2 of 19 points inside the mask$"):
        integrate_slopes(**wrong, method=method)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"method": "fried"}, "^unknown integration method 'fried'; allowed: southwell, cubic, spline, modal$"),
        ({"mask": np.zeros((5, 4), bool)}, "^mask is empty"),
        ({"mask": np.ones((5, 4))}, r"^mask must be boolean .* got float64 of shape \(5, 4\)$"),
        ({"mask": np.ones(4, bool)}, r"^mask must be boolean .* shape \(4,\)$"),
        ({"slope_x": np.zeros((2, 5, 4))}, r"^slope_y has shape \(5, 4\), expected \(2, 5, 4\)"),
    ],
)
def test_refuses_other_bad_input(change, words):
    with pytest.raises(ValueError, match=words):
        integrate_slopes(**(arguments() | change))


@pytest.mark.parametrize("method", METHODS)
def test_neighbours_at_one_place(method):
    given = arguments()
    for name in ("x_mm", "y_mm"):
        given[name][2, 2] = given[name][2, 1]
    if method in FOURTH_ORDER:
        with pytest.raises(ValueError, match=r"^x_mm, y_mm: 1 of 29 pairs of neighbouring nodes lie at one place; "):
            integrate_slopes(**given, method=method)
    else:
        assert not integrate_slopes(**given, method=method)[given["mask"]].any()  # flat slopes, flat heights
        assert not integrate_slopes(*np.ones((4, 2, 2)), np.ones((2, 2), bool), method).any()  # no way to rise
