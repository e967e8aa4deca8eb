"""Error sources: noise of single pixels."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.noise import PhotonNoise, PlaceNoise
from irtscots_cl.budget.source import Draw
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene


@pytest.fixture(scope="module")
def sphere():
    return MeasuredDesign.of(Setup(load_scene("sphere")))


def test_photon_noise_is_the_width_of_the_light_over_the_root_of_the_electrons(sphere):
    """The paper's sphere: 0.2566 mm (its light's width in the middle of the mirror) over the root of N."""
    middle = np.argmin(np.hypot(sphere.seen.x_mm[sphere.seen.mask], sphere.seen.y_mm[sphere.seen.mask]))
    draws = np.stack([PhotonNoise().changes_mm(sphere, 0.01, Draw(2, k))[:, middle] for k in range(600)])
    # 1200 numbers: the standard deviation is known to 2 %, 4 sigma
    assert draws.std() == pytest.approx(0.2566 / 100, rel=0.08)


@pytest.mark.parametrize("source", [PlaceNoise(), PhotonNoise()])
def test_a_draw_is_a_function_of_seed_and_trial(sphere, source):
    first = source.changes_mm(sphere, 1.0, Draw(1, 7))
    assert np.array_equal(first, source.changes_mm(sphere, 1.0, Draw(1, 7)))
    assert np.array_equal(2 * first, source.changes_mm(sphere, 2.0, Draw(1, 7)))
    assert not np.array_equal(first, source.changes_mm(sphere, 1.0, Draw(1, 8)))
    assert not np.array_equal(first, source.changes_mm(sphere, 1.0, Draw(2, 7)))


def test_place_noise_has_its_standard_deviation(sphere):
    noise = PlaceNoise().changes_mm(sphere, 1e-3, Draw(4, 0))
    assert noise.std() == pytest.approx(1e-3, rel=4 / np.sqrt(2 * noise.size))
    assert abs(np.corrcoef(noise)[0, 1]) < 4 / np.sqrt(noise.shape[1])
