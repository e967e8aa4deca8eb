"""Pictures of outlines: read, and refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from irtscots_cl.scene.outline import Outline
from irtscots_cl.scene.outline_mask import MAX_PER_AXIS, outline_mask


def mask_of(path):
    return outline_mask(Outline(shape="mask", file=str(path), pitch_mm=1.0))


def test_pictures_and_arrays_lie_alike(tmp_path):
    """The first row of both has the lowest y."""
    picture = np.zeros((3, 4), np.uint8)
    picture[0, 1:] = 255
    np.save(tmp_path / "mask.npy", picture)
    Image.fromarray(picture).save(tmp_path / "mask.png")
    for name in ("mask.npy", "mask.png"):
        np.testing.assert_array_equal(mask_of(tmp_path / name), picture > 0)


def test_a_changed_file_is_read_again(tmp_path):
    import os

    path = tmp_path / "mask.npy"
    for value in (0, 1):
        np.save(path, np.array([[1, value], [1, 1]]))
        os.utime(path, (value, value))
        assert mask_of(path).sum() == 3 + value


@pytest.mark.parametrize(
    ("values", "why"),
    [
        (np.zeros((4, 4)), "is 0 everywhere"),
        (np.arange(16.0).reshape(4, 4), "has 16 different values"),
        (np.full((4, 4), np.nan), "has values that are no numbers"),
        (np.ones(4), "has 4 pixels; must be a picture"),
        (np.ones((1, MAX_PER_AXIS + 1), np.uint8), "must be a picture of at most"),
    ],
)
def test_other_arrays_are_refused(tmp_path, values, why):
    np.save(tmp_path / "mask.npy", values)
    with pytest.raises(ValueError, match="mirror.outline.file = ") as caught:
        mask_of(tmp_path / "mask.npy")
    assert why in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match="mirror.outline.file = .*not a readable mask: there is no file"):
        mask_of(tmp_path / "none.png")
