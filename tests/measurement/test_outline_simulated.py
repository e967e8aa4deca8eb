"""Outlines in pictures of simulated tests: the mirror lies where its design has it."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import coarse, with_part

import irtscots_cl as irt
from irtscots_cl.imaging.fringes import FringeScan, FringeSet
from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.outline_checks import find_outline, outline_checks
from irtscots_cl.optics.chief_rays import ChiefRays

pytestmark = pytest.mark.needs_device


@pytest.mark.parametrize(("name", "hole_mm"), [("sphere", 0.0), ("off-axis", 0.0), ("sphere", 400.0)])
def test_simulated_mirrors_lie_in_their_places(name, hole_mm):
    """Without noise: what is left is the pixels' straight edge on a round rim, 0.006 pixel of the radius."""
    scene = with_part(coarse(name, 32), "mirror", obscuration_mm=hole_mm)
    sets = tuple(FringeSet.equal(axis, (0.9,), 4) for axis in "xy")
    white = np.asarray(irt.trace(scene, estimator="analytic").images(FringeScan(scene, sets)).white)
    chief, lit = ChiefRays(scene), mirror_mask(white, largest=False)
    found = find_outline(white, lit, chief)
    assert np.abs(found.rim.shift_px).max() < 0.001 and abs(found.rim.scale - 1) * found.rim.curve.radius_px < 0.01
    assert np.abs(found.coverage - chief.footprint.coverage).max() < 0.05
    assert {check.level for check in outline_checks(found, white, lit)} == {"ok"}
    if hole_mm:
        assert found.hole is not None and np.abs(found.hole.shift_px).max() < 0.005
