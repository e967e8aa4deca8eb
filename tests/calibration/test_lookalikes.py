"""Pairs of unknowns that look alike."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.calibration.height_response import HeightResponse
from irtscots_cl.calibration.jacobian import centroid_jacobian
from irtscots_cl.calibration.lookalikes import lookalikes
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.presets import load_scene


def test_camera_x_and_screen_x_look_alike_and_leave_their_height():
    setup = Setup(load_scene("sphere"))
    response = HeightResponse.of(setup)
    names = ["camera.x_mm", "screen.z_mm", "screen.x_mm", "mirror.clocking_rad"]
    jacobian = centroid_jacobian(setup, names, response.seen.pixels)
    heights = response.heights_mm(np.moveaxis(jacobian, -1, 0))
    (pair,) = lookalikes(names, jacobian.reshape(-1, 4), heights, response)
    assert (pair.first, pair.second) == ("camera.x_mm", "screen.x_mm")
    assert pair.differ == pytest.approx(0.0134, abs=1e-4) and pair.ratio == pytest.approx(1.0028, abs=1e-4)
    # 0.1 mm apart, half each: of a separate calculation, see test_height_response
    np.testing.assert_allclose(pair.rms_nm[:2] * 0.1, [10.746, 8.790], rtol=3e-3)  # the ratio is not quite 1


def test_the_ratio_carries_sign_and_unit():
    setup = Setup(load_scene("sphere"))
    response = HeightResponse.of(setup)
    column = np.random.default_rng(0).standard_normal(2 * 9793)
    jacobian = np.stack([column, -4.0 * column], -1)
    heights = np.stack([response.seen.x_mm[response.seen.mask] ** 2, np.zeros(9793)])
    (pair,) = lookalikes(["a", "b"], jacobian, heights, response)
    assert pair.ratio == pytest.approx(-0.25) and pair.differ < 1e-7
    np.testing.assert_allclose(pair.rms_nm, response.left(heights[:1])[0] / 2 * 1e6)
