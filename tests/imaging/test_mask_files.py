"""Masks from files: every kind that is read, in every orientation, and what is refused in one line."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from PIL import Image

from irtscots_cl.imaging.mask_files import read_mask
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.scene.instrument import ORIENTATIONS

MASK = np.zeros((5, 8), bool)
MASK[1:4, 2:7] = MASK[0, 0] = True


def write(path, values) -> None:
    if path.suffix == ".npy":
        np.save(path, values)
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file["mask"] = values
    else:
        Image.fromarray(values).save(path)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("m.png", MASK.astype(np.uint8) * 255),
        ("m.png", MASK),
        ("m.PNG", MASK.astype(np.uint8)),
        ("m.png", MASK.astype(np.uint16) * 65535),
        ("m.png", np.dstack([MASK * 0, MASK * 255, MASK * 0]).astype(np.uint8)),
        ("m.png", np.dstack([MASK * 255, MASK * 0, MASK * 0, MASK * 0 + 255]).astype(np.uint8)),
        ("m.png", np.dstack([MASK * 255, MASK * 0 + 128]).astype(np.uint8)),
        ("m.tif", MASK.astype(np.uint8) * 7),
        ("m.tiff", MASK.astype(np.float32)),
        ("m.bmp", MASK.astype(np.uint8) * 255),
        ("m.npy", MASK),
        ("m.npy", MASK.astype(float)),
        ("m.npy", MASK.astype(np.int64) * -3),
        ("m.h5", MASK),
        ("m.h5", MASK.astype(np.uint8)),
    ],
)
def test_pixels_that_are_not_0_are_used(tmp_path, name, values):
    if values.dtype.kind == "i":
        values = np.abs(values)
    write(tmp_path / name, values)
    np.testing.assert_array_equal(read_mask(tmp_path / name, MASK.shape), MASK)


def test_a_picture_of_numbered_colours_counts_its_colours(tmp_path):
    picture = Image.fromarray((~MASK).astype(np.uint8), "P")
    picture.putpalette([255, 255, 255, 0, 0, 0])  # number 0 is white
    picture.save(tmp_path / "m.png")
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png", MASK.shape), MASK)


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_the_mask_lies_as_the_images_do(tmp_path, orientation):
    write(tmp_path / "m.npy", stored(MASK, orientation))
    np.testing.assert_array_equal(read_mask(tmp_path / "m.npy", MASK.shape, orientation), MASK)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("m.npy", MASK.T, "has 5 x 8 pixels; must have the images' 8 x 5"),
        ("m.npy", MASK[None], "has 8 x 5 x 1 pixels; must have"),
        ("m.npy", np.float64(1), "has one value pixels; must have"),
        ("m.npy", MASK * 0, "is 0 everywhere: no pixel would be used"),
        ("m.npy", np.where(MASK, np.nan, 0.0), "has values that are no numbers"),
        ("m.npy", np.arange(40.0).reshape(5, 8), r"has 40 different values \(0, 1, 2 ...\); must be 0 where"),
        ("m.npy", np.where(MASK, 1, 2), r"has 2 different values \(1, 2\)"),
        ("m.npy", MASK.astype(complex), "has values of type complex128; must be a picture"),
        ("m.npy", MASK.astype("U1"), "has values of type <U1"),
        ("m.h5", MASK.astype("S1"), r"has values of type \|S1"),
    ],
)
def test_what_is_no_mask_is_refused(tmp_path, name, values, message):
    write(tmp_path / name, values)
    with pytest.raises(ValueError, match=message) as caught:
        read_mask(tmp_path / name, MASK.shape)
    text = str(caught.value)
    assert text.startswith("--mask = ") and text.isprintable() and name in text


def test_objects_other_files_and_folders_are_refused(tmp_path):
    np.save(tmp_path / "objects.npy", np.array([{}, 1], object), allow_pickle=True)
    (tmp_path / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"\0" * 30)
    (tmp_path / "broken.h5").write_bytes(b"no file")
    (tmp_path / "text.txt").write_text("1")
    (tmp_path / "folder.png").mkdir()
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["use"] = MASK
    with h5py.File(tmp_path / "linked.h5", "w") as file:
        file["mask"] = h5py.ExternalLink("other.h5", "use")
    for name in (
        "objects.npy",
        "broken.png",
        "broken.h5",
        "text.txt",
        "folder.png",
        "other.h5",
        "linked.h5",
        "none.png",
    ):
        with pytest.raises(ValueError, match="^--mask = .*: not a readable mask: ") as caught:
            read_mask(tmp_path / name, MASK.shape)
        assert str(caught.value).isprintable()


def test_the_message_of_a_transposed_mask_speaks_of_the_file(tmp_path):
    write(tmp_path / "m.npy", MASK)
    with pytest.raises(ValueError, match="must have the images' 5 x 8 .*orientation = 'transposed' says"):
        read_mask(tmp_path / "m.npy", MASK.shape, "transposed")
