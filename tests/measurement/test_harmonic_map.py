"""The second harmonic of every pixel: that of the screen's gamma, without bias from noise."""

from __future__ import annotations

import numpy as np
import pytest
from fringe_stacks import disk, fringe_stack

from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.measurement.harmonic_map import second_harmonic_maps
from irtscots_cl.measurement.screen_coordinates import screen_coordinates


@pytest.mark.parametrize(("steps", "gamma"), [(4, 1.0), (4, 2.2), (8, 1.6), (5, 0.8)])
def test_the_map_has_the_harmonic_of_gamma(steps, gamma):
    sets = tuple(FringeSet.equal(axis, (0.9, 3.2), steps) for axis in "xy")
    stack = fringe_stack(sets, gamma=gamma, seed=3)
    maps = second_harmonic_maps(stack, screen_coordinates(stack, mask=disk()))
    for values in maps.values():
        known = values[np.isfinite(values)]
        error = known.std() / np.sqrt(len(known))
        assert known.mean() == pytest.approx((gamma - 1) / (gamma + 2), abs=5 * error + 0.003)  # + fourth harmonic
        assert len(known) > 0.5 * disk().sum() and np.isnan(values[~disk()]).all()


def test_three_steps_show_none():
    sets = tuple(FringeSet.equal(axis, (0.9, 3.2), 3) for axis in "xy")
    stack = fringe_stack(sets)
    maps = second_harmonic_maps(stack, screen_coordinates(stack, mask=disk()))
    assert all(np.isnan(values).all() for values in maps.values())
