"""Error source: light that is the same in all frames."""

from __future__ import annotations

import numpy as np
from small_budget import small_scene

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw
from irtscots_cl.budget.stray_light import UniformLight
from irtscots_cl.optics.setup import Setup

NO_DRAW = Draw(0, 0)


def test_light_curves_with_a_floor():
    """Centroids over the lines that the light reaches and one more on either side, each with the same light added."""
    design, value = MeasuredDesign.of(Setup(small_scene())), 0.05
    found = UniformLight().changes_mm(design, value, NO_DRAW)
    for axis in range(2):
        pitch, signal = design.setup.scene.screen.pitch_xy_mm[axis], design.frames.signal[axis]
        lines = design.light.shares[axis].lines
        for pixel in range(0, design.count, 53):
            lit = np.flatnonzero(signal[pixel])
            window = np.arange(lit[0] - 1, lit[-1] + 2)
            window = window[(lines[pixel, window] >= 0) & (lines[pixel, window] < design.frames.counts[axis])]
            own, place = signal[pixel, window], lines[pixel, window] * pitch
            told = np.sum(place * (own + value)) / np.sum(own + value) - np.sum(place * own) / own.sum()
            assert abs(found[axis, pixel] - told) < 1e-12
    assert np.abs(found).max() > 1e-4


def test_phases_do_not_see_it():
    design = MeasuredDesign.of(Setup(small_scene()), ((1.0, 8.0), 4))
    assert not UniformLight().changes_mm(design, 0.05, NO_DRAW).any()
    added = [weights.sum(-1) for weights in design.frames.of_addition]
    assert np.abs(added).max() < 1e-12
