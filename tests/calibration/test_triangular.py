"""Least squares of rows in parts, against NumPy on all rows."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.calibration import triangular
from irtscots_cl.calibration.triangular import Triangle

RANDOM = np.random.default_rng(3)
ROWS = RANDOM.normal(size=(300, 6))  # five columns and the right side


def triangle(rows=ROWS) -> Triangle:
    return Triangle.empty(rows.shape[1] - 1).with_rows(rows)


@pytest.mark.parametrize("at_once", [1, 7, 1000])
def test_rows_in_parts_give_the_fit_of_all(monkeypatch, at_once):
    monkeypatch.setattr(triangular, "AT_ONCE", at_once)
    found = Triangle.empty(5).with_rows(ROWS[:100]).with_rows(ROWS[100:101]).with_rows(ROWS[101:])
    solution, left, *_ = np.linalg.lstsq(ROWS[:, :5], ROWS[:, 5])
    np.testing.assert_allclose(found.solution(), solution, rtol=1e-12)  # rounding
    assert found.square_left == pytest.approx(left[0], rel=1e-12)
    np.testing.assert_allclose(found.covariance(), np.linalg.inv(ROWS[:, :5].T @ ROWS[:, :5]), rtol=1e-11)


def test_fewer_rows_than_columns_have_the_shortest_solution():
    found = triangle(ROWS[:3])
    np.testing.assert_allclose(found.solution(), np.linalg.lstsq(ROWS[:3, :5], ROWS[:3, 5])[0], rtol=1e-11)
    values, vectors = found.directions()
    assert values[0] == pytest.approx(0, abs=1e-12) and values[-1] > 1  # rounding
    np.testing.assert_allclose(ROWS[:3, :5] @ vectors[0], 0, atol=1e-12)


def test_digits_that_normal_equations_lose():
    rows = np.column_stack([np.ones(50), 1 + 1e-9 * np.arange(50), np.full(50, 2.0)])
    rows[:, 2] += 3e-9 * np.arange(50)
    np.testing.assert_allclose(triangle(rows).solution(), [-1, 3], atol=1e-5)  # the condition 1e9 times rounding


def test_what_a_further_column_explains_is_what_a_fit_with_it_explains():
    found = triangle().left_beside(3)
    for k, gain in enumerate(found):
        columns = ROWS[:, [0, 1, 2, 3 + k]]
        squares = [np.linalg.lstsq(c, ROWS[:, 5])[1][0] for c in (columns[:, :3], columns)]
        assert gain == pytest.approx(squares[0] - squares[1], rel=1e-9)


def test_a_further_column_that_others_imitate_explains_nothing():
    rows = ROWS.copy()
    rows[:, 4], rows[:, 3] = rows[:, 0] - 2 * rows[:, 1], 0.0
    np.testing.assert_array_equal(triangle(rows).left_beside(3), [0, 0])
