"""Tables of functions of an angle."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.periodic_table import PeriodicTable

COUNT = 4096
STEP = 2 * np.pi / COUNT


def table():
    return PeriodicTable.of(np.sin(3 * np.linspace(-np.pi, np.pi, COUNT + 1)))


def test_values_between_the_steps_and_beyond_a_turn():
    angles = np.random.default_rng(1).uniform(-50, 50, 20_000)
    np.testing.assert_allclose(table().at(angles), np.sin(3 * angles), atol=9 * STEP**2 / 8 * 1.01)  # linear, f'' <= 9


def test_the_ends_of_a_turn_and_the_steps_themselves():
    angles = np.array([-np.pi, np.pi, 3 * np.pi, 0.0, STEP, np.nextafter(np.pi, 4)])
    np.testing.assert_allclose(table().at(angles), np.sin(3 * angles), atol=1e-12)


def test_what_is_no_number_stays_none():
    np.testing.assert_array_equal(np.isnan(table().at(np.array([np.nan, 1.0, np.inf]))), [True, False, True])
