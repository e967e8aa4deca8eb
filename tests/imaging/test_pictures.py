"""Pictures of the user's for a scene's screen."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

import irtscots_cl as irt
from irtscots_cl.imaging.pictures import Pictures, read_pictures
from irtscots_cl.imaging.screen_pictures import as_picture


def test_files_are_read_upright(tmp_path):
    scene = irt.load_scene("sphere")
    values = np.random.default_rng(1).random((21, 21))
    Image.fromarray(as_picture(values, 16)).save(tmp_path / "a.png")
    np.save(tmp_path / "b.npy", values[::-1, ::-1])
    np.testing.assert_allclose(read_pictures([tmp_path / "a.png"], scene)[0], values, atol=1e-5)  # half of 1/65535
    np.testing.assert_array_equal(read_pictures([tmp_path / "b.npy"], scene)[0], values)
    np.save(tmp_path / "c.npy", values * 3)
    with pytest.raises(ValueError, match=r"c\.npy: values from .* must be from 0 to 1, or whole numbers"):
        read_pictures([tmp_path / "c.npy"], scene)
    np.save(tmp_path / "d.npy", values[:5])
    with pytest.raises(ValueError, match="a picture of 21 x 5 pixels; the screen of scene sphere has 21 x 21"):
        read_pictures([tmp_path / "d.npy"], scene)


def test_what_is_not_allowed():
    scene = irt.load_scene("sphere")
    with pytest.raises(ValueError, match=r"must be \[pictures, 21, 21\]"):
        Pictures(scene, np.ones((21, 21)))
    with pytest.raises(ValueError, match="-1: must not be negative"):
        Pictures(scene, -np.ones((1, 21, 21)))
    with pytest.raises(ValueError, match="gamma = 0: must be above 0"):
        Pictures(scene, np.ones((1, 21, 21)), gamma=0)
