"""Error sources: air of uneven temperature."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.air_gradient import INDEX_PER_K, TemperatureGradient
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw
from irtscots_cl.optics.setup import Setup

NO_DRAW = Draw(0, 0)


def piecewise(start, direction, gradient, length, pieces=200):
    """Ends and directions of rays that turn by the gradient's part across them, piece by piece, over lengths [n]."""
    step = length[:, None] / pieces
    for k in range(pieces + 1):
        part = 0.5 if k in (0, pieces) else 1.0  # bends between the pieces; half ones at both ends
        direction = direction + part * step * (gradient - direction * (direction @ gradient)[:, None])
        direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        if k < pieces:
            start = start + step * direction
    return start, direction


@pytest.mark.parametrize("preset", ["sphere", "off-axis"])
@pytest.mark.parametrize("axis", "xyz")
def test_places_are_those_of_rays_that_are_bent_all_along(preset, axis):
    design = MeasuredDesign.of(Setup(small_scene(preset=preset)))
    chief, bends, value = design.setup.chief_rays, design.bends, 1.0
    gradient = INDEX_PER_K * 1e-3 * value * np.eye(3)["xyz".index(axis)]
    camera, screen = bends.lengths_mm
    direction = (bends.points_mm - bends.camera_mm) / camera[:, None]
    near, along = piecewise(np.broadcast_to(bends.camera_mm, direction.shape), direction, gradient, camera)
    points, outgoing = chief.surface.meet(near - 1.0 * along, along)  # the last millimetre is straight
    outgoing = outgoing / np.linalg.norm(outgoing, axis=-1, keepdims=True)
    end, last = piecewise(points, outgoing, gradient, screen)
    moved = np.stack(chief.screen_model.arrive(end - 1.0 * last, last)) - design.places_mm
    found = TemperatureGradient(axis).changes_mm(design, value, NO_DRAW)
    assert np.abs(moved - found).max() < 2e-3 * np.abs(found).max()


def test_in_the_middle_of_a_sphere_the_shift_is_the_curvature_times_the_mean_square_of_the_ways():
    """Towards the cold: half of the curvature times the square, on each way."""
    design = MeasuredDesign.of(Setup(small_scene()))
    found = TemperatureGradient("y").changes_mm(design, 0.5, NO_DRAW)[1]
    middle = np.argmin(np.hypot(*design.bends.points_mm[:, :2].T))
    squares = sum(length[middle] ** 2 for length in design.bends.lengths_mm)
    assert found[middle] == pytest.approx(-0.5e-3 * 9.28e-7 * squares / 2, rel=5e-3)
