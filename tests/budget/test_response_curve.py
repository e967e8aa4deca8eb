"""Error sources: screens and detectors that are not linear."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.response_curve import ResponsePower
from irtscots_cl.budget.source import Draw
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup

NO_DRAW = Draw(0, 0)


@pytest.mark.parametrize("steps", [3, 4])
@pytest.mark.parametrize("of", ["screen", "detector"])
def test_fringes_of_a_power(steps, of):
    """Phases by least squares of frames that are made one by one, as a power of a sinusoid."""
    periods, value = (3.0, 20.0), 0.4
    design = MeasuredDesign.of(Setup(small_scene()), (periods, steps))
    screen, found = design.setup.scene.screen, ResponsePower(of).changes_mm(design, value, NO_DRAW)
    angle = 2 * np.pi * np.arange(steps) / steps
    columns = np.stack([np.ones(steps), np.cos(angle), np.sin(angle)], -1)
    for axis in range(2):
        width, told = screen.pixels[axis] * screen.pitch_xy_mm[axis], 0.0
        for p in periods:
            phase = 2 * np.pi * p * (design.places_mm[axis] / width + 0.5)
            frames = (0.5 + 0.5 * np.cos(phase - angle[:, None])) ** (1 + value)
            _, cosine, sine = np.linalg.lstsq(columns, frames)[0]
            turn = np.angle((cosine + 1j * sine) * np.exp(-1j * phase))
            told = told + p**2 / np.square(periods).sum() * turn * width / (2 * np.pi * p)
        assert np.abs(found[axis] - told).max() < 6e-3 * np.abs(told).max()  # harmonics beyond the 9th


def test_full_lines_stay_full():
    design = MeasuredDesign.of(Setup(small_scene()))
    assert not ResponsePower("screen").changes_mm(design, 1.2, NO_DRAW).any()
    assert np.abs(ResponsePower("detector").changes_mm(design, 0.0, NO_DRAW)).max() < 1e-12


@pytest.mark.parametrize(("of", "fringes"), [("detector", None), ("detector", ((3.0,), 4)), ("screen", ((3.0,), 4))])
def test_a_power_of_nearly_nothing_tells_no_place(of, fringes):
    design = MeasuredDesign.of(Setup(small_scene(21)), fringes)
    assert np.isfinite(ResponsePower(of).changes_mm(design, -0.9, NO_DRAW)).all()
    assert np.isnan(ResponsePower(of).changes_mm(design, -0.96, NO_DRAW)).all()


def test_light_curves_of_a_power_of_the_light():
    """Centroids of a power of the light curves in closed form."""
    design, value = MeasuredDesign.of(Setup(small_scene())), 0.3
    row, column = design.seen.pixels
    inside = np.hypot(design.seen.x_mm[design.seen.mask], design.seen.y_mm[design.seen.mask]) < 400
    chosen = np.flatnonzero(inside)[::7]
    numbers = (row[chosen] * design.setup.scene.camera.detector.pixels[0] + column[chosen]).astype(int)
    light, screen = PixelLight.of(design.setup.chief_rays, numbers), design.setup.scene.screen
    found = ResponsePower("detector").changes_mm(design, value, NO_DRAW)[:, chosen]
    for axis, output in enumerate("uv"):
        edges = (np.arange(screen.pixels[axis] + 1) - screen.pixels[axis] / 2) * screen.pitch_xy_mm[axis]
        curve = np.maximum(light.light(output, np.broadcast_to(edges, (len(chosen), len(edges)))), 0.0)
        place = (edges[1:] + edges[:-1]) / 2
        one, power = (np.sum(place * c, -1) / c.sum(-1) for c in (curve, curve ** (1 + value)))
        told = power - one
        assert np.abs(found[axis] - told).max() < 1e-3 * np.abs(told).max()
