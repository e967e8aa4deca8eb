"""Cubic splines on grids against SciPy's, which is other code, and against what defines them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from irtscots_cl.maths.bicubic import BicubicSpline

ROWS, COLUMNS = 48, 61
INSIDE = 18  # nodes from the edge: SciPy's spline has other ends, whose effect falls by 0.27 from node to node


@pytest.fixture(scope="module")
def heights():
    return np.random.default_rng(1).normal(size=(ROWS, COLUMNS))


def places(count=400, edge=0.0, seed=2):
    generator = np.random.default_rng(seed)
    return generator.uniform(edge, COLUMNS - 1 - edge, count), generator.uniform(edge, ROWS - 1 - edge, count)


def test_heights_slopes_and_bends_are_those_of_another_spline(heights):
    spline = BicubicSpline.through(heights)
    other = RectBivariateSpline(np.arange(ROWS), np.arange(COLUMNS), heights, kx=3, ky=3, s=0)
    column, row = places(edge=INSIDE)
    found = [*spline.at(column, row), *spline.bend(column, row)]
    orders = [(0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0)]
    expected = [other.ev(row, column, *order) for order in orders]
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=1e-8
    )  # 0.27^18 = 6e-11 of heights of 3, and twenty times that for bends


def test_it_goes_through_its_nodes_and_knows_their_slopes(heights):
    spline = BicubicSpline.through(heights)
    row, column = np.mgrid[:ROWS, :COLUMNS]
    at_nodes = spline.nodes()
    np.testing.assert_allclose(at_nodes[0], heights, rtol=0, atol=1e-13)  # rounding
    np.testing.assert_allclose(spline.at(column, row), at_nodes, rtol=0, atol=1e-13)
    assert spline.shape == (ROWS, COLUMNS)


def test_nothing_jumps_between_cells(heights):
    spline, step = BicubicSpline.through(heights), 1e-9
    row = np.random.default_rng(3).uniform(0, ROWS - 1, COLUMNS - 2)
    node = np.arange(1.0, COLUMNS - 1)
    for of in (spline.at, spline.bend):
        jump = np.subtract(of(node + step, row), of(node - step, row))
        assert np.abs(jump).max() < 1e-7  # 2e-9 times third derivatives of a few tens
    turned = BicubicSpline.through(heights.T)
    jump = np.subtract(turned.bend(row, node + step), turned.bend(row, node - step))
    assert np.abs(jump).max() < 1e-7


def test_beyond_its_edge_it_goes_on_level_and_without_a_kink(heights):
    spline = BicubicSpline.through(heights)
    row = np.linspace(0.0, ROWS - 1, 50)
    edge, inside, beyond = (spline.at(np.full(50, c), row) for c in (COLUMNS - 1.0, COLUMNS - 1 - 1e-7, COLUMNS + 4.0))
    np.testing.assert_allclose(edge[1], 0.0, atol=1e-13)
    np.testing.assert_allclose(inside[1], 0.0, atol=1e-5)  # 1e-7 times the bend there
    np.testing.assert_array_equal(beyond[0], edge[0])
    np.testing.assert_array_equal(beyond[1], 0.0)
    np.testing.assert_array_equal(beyond[2], edge[2])


def test_smooth_surfaces_are_followed_to_the_fourth_order():
    """Twice as many nodes, a sixteenth of the error: of an analytic surface, not of another spline."""
    errors = []
    for count in (41, 81):
        x = np.linspace(0, 1, count)
        spline = BicubicSpline.through(np.cos(2 * np.pi * x) * np.cos(np.pi * x)[:, None])  # level across its edges
        u, v = np.random.default_rng(4).uniform(0, 1, (2, 500))
        exact = np.cos(2 * np.pi * u) * np.cos(np.pi * v)
        errors.append(np.abs(spline.at(u * (count - 1), v * (count - 1))[0] - exact).max())
    assert 14 < errors[0] / errors[1] < 18


def test_no_place_gives_no_height(heights):
    column, row = np.array([1.0, np.nan, np.inf, -np.inf]), np.array([np.nan, 2.0, 3.0, 4.0])
    height = BicubicSpline.through(heights).at(column, row)[0]
    assert np.isnan(height[:2]).all() and np.isfinite(height[2:]).all()
