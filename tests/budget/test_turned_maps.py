"""Height maps turned on the mirror."""

from __future__ import annotations

import numpy as np
import pytest
from small_budget import small_scene

from irtscots_cl.budget.averaging import left_by_turns
from irtscots_cl.budget.turned_maps import TurnedMaps
from irtscots_cl.calibration.seen_pixels import seen_pixels
from irtscots_cl.maths.zernike.indices import noll_to_nm
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.optics.setup import Setup

RADIAL = 12
NOLLS = range(1, (RADIAL + 1) * (RADIAL + 2) // 2 + 1)


@pytest.fixture(scope="module")
def setup():
    return Setup(small_scene(41))


@pytest.mark.parametrize("turns", range(2, 7))
def test_maps_follow_the_rule_of_angular_orders(setup, turns):
    """Every term to radial order 12, and so to m = 12: whole where m is a multiple of the turns, else gone."""
    seen, radius = seen_pixels(setup), setup.chief_rays.surface.aperture_radius_mm
    x, y = seen.x_mm[seen.mask] / radius, seen.y_mm[seen.mask] / radius
    terms = np.stack([zernike(noll, x, y) for noll in NOLLS])
    left = TurnedMaps(seen, radius, turns).mean(terms[None])
    assert {abs(noll_to_nm(noll)[1]) for noll in NOLLS} == set(range(13))
    assert np.abs(left - left_by_turns(NOLLS, turns)[:, None] * terms).max() < 1e-8


def test_noise_of_several_measurements_keeps_its_size(setup):
    """Mean of four independent maps: half the rms. 1000 pixels: to 2.2 %, 4 sigma; the polynomial evens out nothing."""
    seen, radius = seen_pixels(setup), setup.chief_rays.surface.aperture_radius_mm
    noise = np.random.default_rng(1).standard_normal((4, 8, int(seen.mask.sum())))
    assert TurnedMaps(seen, radius, 4).mean(noise).std() == pytest.approx(0.5, rel=0.04)
