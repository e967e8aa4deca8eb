"""Outlines in pictures of simulated tests: the mirror lies where its design has it."""

from __future__ import annotations

import numpy as np
import pytest
from outlined import outline_of
from scenes import coarse, with_part

import irtscots_cl as irt
from irtscots_cl.imaging.fringes import FringeScan, FringeSet
from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.mirror_outline import NoOutlineError
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


def white_of(kind: str, hole_mm: float, folder) -> tuple[ChiefRays, np.ndarray]:
    """A mirror with an outline, and its picture under a white screen: each pixel's share on the mirror."""
    outline = outline_of(kind, 1064.0, folder)
    chief = ChiefRays(with_part(coarse("sphere", 64), "mirror", obscuration_mm=hole_mm, outline=outline))
    return chief, chief.footprint.coverage.copy()


@pytest.mark.parametrize(("kind", "hole_mm"), [("hexagon", 0.0), ("hexagon", 300.0), ("rectangle", 0.0), ("ell", 0.0)])
def test_mirrors_with_an_outline_lie_in_their_places(kind, hole_mm, tmp_path):
    """No circle is fitted: shares are told by 16 x 16 points of a pixel, which is what is left."""
    chief, white = white_of(kind, hole_mm, tmp_path)
    lit = white > 0.5
    found = find_outline(white, lit, chief)
    assert np.abs(found.rim.shift_px).max() < 0.05 and abs(found.rim.scale - 1) * found.rim.curve.radius_px < 0.05
    assert {check.level for check in outline_checks(found, white, lit)} == {"ok"}
    assert (found.hole is not None) == bool(hole_mm)


def test_a_hexagon_is_no_disk_and_a_moved_one_is_told_of(tmp_path):
    chief, white = white_of("hexagon", 0.0, tmp_path)
    moved = np.roll(white, (1, 2), (0, 1))
    found = find_outline(moved, moved > 0.5, chief)
    np.testing.assert_allclose(found.rim.shift_px, [1.0, 2.0], atol=0.05)


@pytest.mark.parametrize(
    ("kind", "why"),
    [("mask", "is a picture"), ("spiders", "spiders cut"), ("parts", "spiders cut")],
)
def test_outlines_of_other_kinds_are_not_measured(kind, why, tmp_path):
    chief, white = white_of(kind, 0.0, tmp_path)
    with pytest.raises(NoOutlineError, match=why):
        find_outline(white, white > 0.5, chief)
