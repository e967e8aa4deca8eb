"""Chief rays of a real set-up, everything of it on, against the oracle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracle.rig import Rig
from real_setup import DISTORTION, real_setup
from scenes import with_part

from irtscots_cl.optics.chief_rays import ChiefRays


@pytest.mark.parametrize("terms", [5, 8])
def test_chief_rays_are_the_oracle_s(terms):
    scene = real_setup(glass=False)
    scene = with_part(scene, "camera", intrinsics=replace(scene.camera.intrinsics, distortion=DISTORTION[:terms]))
    chief, rig = ChiefRays(scene), Rig.of(scene.to_toml())
    row, column = (k[::3, ::3] for k in rig.pixel_grid())
    path = rig.back(row, column, 0.3, -0.8)
    on = rig.mirror.contains(path.mirror)
    points, u, v = chief.reverse(row, column, 0.3, -0.8)
    assert on.sum() > 300
    # mm: between a ray's points of the conic and of the surface the conic counts as level: (0.014 x 0.2)^2 / (2 x 1500)
    assert np.abs(points - path.mirror)[on].max() < 2e-9
    assert max(np.abs(u - path.u)[on].max(), np.abs(v - path.v)[on].max()) < 1e-9  # mm
    back_row, back_column = chief.camera_model.pixel(*chief.camera_model.image_point(row, column))
    assert max(np.abs(back_row - row).max(), np.abs(back_column - column).max()) < 1e-10  # pixels
