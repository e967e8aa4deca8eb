"""Bends of chief rays on their way."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.ray_bends import LAYERS
from irtscots_cl.optics.setup import Setup


def test_levers_of_a_sphere_from_its_centre():
    """By ray matrices: a bend at a distance from the camera moves the place by that much; so does one of the screen."""
    design = MeasuredDesign.of(Setup(small_scene()))
    levers, lengths = design.bends.levers_mm, design.bends.lengths_mm
    middle = np.argmin(np.hypot(*design.bends.points_mm[:, :2].T))
    for layer, part in enumerate(LAYERS):
        for leg in range(2):
            told = (1 - part) * lengths[leg][middle]
            found = levers[layer, leg, ..., middle]
            # tilted by 3 degrees, the sphere's foci along x and y are 0.3 % of its radius apart
            assert np.abs(np.diag(found)) == pytest.approx(told, abs=3e-3 * lengths[leg][middle])
            assert np.abs(found[[0, 1], [1, 0]]).max() < 1e-6 * told


@pytest.mark.parametrize("preset", ["sphere", "off-axis"])
@pytest.mark.parametrize("layer, leg", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_levers_are_those_of_rays_bent_on_their_way(preset, layer, leg):
    """Rays in two straight pieces in the bent leg, traced to the screen; along both axes at once."""
    design = MeasuredDesign.of(Setup(small_scene(preset=preset)))
    bends, chief, angle = design.bends, design.setup.chief_rays, np.array([3e-6, -2e-6])
    bend = angle @ bends.axes
    if leg == 0:
        there = bends.points_mm - bends.camera_mm
        length = np.linalg.norm(there, axis=-1, keepdims=True)
        direction = there / length
        at = bends.points_mm - LAYERS[layer] * there
        turned = direction + bend - direction * (direction @ bend)[:, None]
        points, outgoing = chief.surface.meet(at, turned)
        places = chief.screen_model.arrive(points, outgoing)
    else:
        there = bends.screen_mm - bends.points_mm
        direction = there / np.linalg.norm(there, axis=-1, keepdims=True)
        at = bends.points_mm + LAYERS[layer] * there
        places = chief.screen_model.arrive(at, direction + bend - direction * (direction @ bend)[:, None])
    moved = np.stack(places) - design.places_mm
    told = np.einsum("e,eon->on", angle, bends.levers_mm[layer, leg])
    assert np.abs(moved - told).max() < 1e-3 * np.abs(told).max()


def test_legs_cross_layers_where_their_rays_are():
    design = MeasuredDesign.of(Setup(small_scene()))
    bends = design.bends
    at = bends.points_mm + LAYERS[1] * (bends.screen_mm - bends.points_mm)
    assert np.abs(bends.crossings_mm[1, 1] - (at @ bends.axes.T).T).max() < 1e-9
    assert np.abs(bends.axes @ bends.axes.T - np.eye(2)).max() < 1e-12
