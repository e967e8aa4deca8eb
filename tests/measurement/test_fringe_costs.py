"""What added light costs: the change of places that it really makes, and the height of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fringe_stacks import DARK, SHAPE, disk, fringe_stack

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.measurement.fringe_costs import fraction_error, height_cost_nm
from irtscots_cl.measurement.screen_coordinates import screen_coordinates


@pytest.mark.parametrize("reverse", [False, True])
def test_places_move_as_predicted_by_light_in_some_frames(reverse):
    """Proportional to the light itself, so that it is one and the same part of it in all pixels."""
    sets = tuple(FringeSet.equal(axis, (0.9, 3.2), 4, reverse=reverse) for axis in "xy")
    stack = fringe_stack(sets, read=0.3, electrons=0)
    added = np.zeros(8)
    added[5:7] = 0.02
    frames = np.array(stack.frames)
    mean = (np.asarray(stack.white) - DARK) / 2
    frames[:8] += added[:, None, None] * mean
    before = screen_coordinates(stack, mask=disk()).x
    after = screen_coordinates(replace(stack, frames=frames), mask=disk()).x
    moved = (after.fraction - before.fraction)[disk()]
    expected = fraction_error(after, added)[disk()]
    assert np.std(moved) > 3e-4 and np.std(moved - expected) < 0.15 * np.std(moved)


def test_the_cost_is_the_height_without_piston_and_tilt():
    row, column = np.indices(SHAPE) * 1.0

    def surface(errors):
        bent = 1e-6 * errors["x"] * (column**2 - row**2) + 3e-4 * column + 1.0
        mask = np.ones(SHAPE, bool)
        return SimpleNamespace(deviation_mm=bent, height_mask=mask, x_mm=column, y_mm=row)

    one = height_cost_nm(surface({"x": 0.0}), surface({"x": 1.0}))
    assert one > 1 and height_cost_nm(surface({"x": 0.0}), surface({"x": 2.0})) == pytest.approx(2 * one)
    assert height_cost_nm(surface({"x": 1.0}), surface({"x": 1.0})) == pytest.approx(0, abs=1e-6)
