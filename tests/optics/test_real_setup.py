"""Chief rays of a real set-up, everything of it on, against the oracle."""

from __future__ import annotations

import numpy as np
import pytest
from oracle.rig import Rig
from real_setups import real_setup

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.presets import load_scene


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("mirror", ["concave"])
def test_chief_rays_are_the_oracle_s(tmp_path, mirror, rational):
    text = real_setup(mirror, glass=False, rational=rational)
    file = tmp_path / "real.toml"
    file.write_text(text, encoding="utf-8")
    chief, rig = ChiefRays(load_scene(str(file))), Rig.of(text)
    row, column = (k[::3, ::3] for k in rig.pixel_grid())
    path = rig.back(row, column, 0.3, -0.8)
    on = rig.mirror.contains(path.mirror)
    points, u, v = chief.reverse(row, column, 0.3, -0.8)
    assert on.sum() > 300
    assert np.abs(points - path.mirror)[on].max() < 1e-9  # mm
    assert max(np.abs(u - path.u)[on].max(), np.abs(v - path.v)[on].max()) < 1e-9  # mm
    back_row, back_column = chief.camera_model.pixel(*chief.camera_model.image_point(row, column))
    assert max(np.abs(back_row - row).max(), np.abs(back_column - column).max()) < 1e-10  # pixels
