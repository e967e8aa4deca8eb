"""Too few and too many images: which are missing or do not belong, by the numbers in their names."""

from __future__ import annotations

import pytest
from picture_files import ramp, tiff

from irtscots_cl.formats.images import open_frames
from irtscots_cl.imaging.frame_count import check_count
from irtscots_cl.imaging.fringe_manifest import FringeManifest, frames_of
from irtscots_cl.imaging.fringes import FringeSet

MANIFEST = FringeManifest("s", (9, 9), frames_of([FringeSet.equal(axis, (0.9, 3.0), 4) for axis in "xy"]))
PICTURES = [frame.picture.removesuffix(".png") for frame in MANIFEST.frames]
DATA = tiff([ramp()[0].tobytes()], 16)


def said(folder, names, each=1):
    """Why images of these names, 18 frames being wanted, are refused; "" where they are not."""
    for name in names:
        (folder / f"{name}.tif").write_bytes(DATA)
    try:
        check_count(open_frames(folder), MANIFEST, each, "camera")
    except ValueError as error:
        assert str(error).isprintable() and str(error).startswith(f"camera: {len(names)} images; manifest.toml has 18")
        return str(error)
    return ""


def numbered(*left_out, last=18, form="IMG_{}"):
    return [form.format(k) for k in range(1, last + 1) if k not in left_out]


def test_as_many_as_frames_pass(tmp_path):
    assert said(tmp_path, numbered()) == ""


@pytest.mark.parametrize("names, parts", [
    (numbered(7), ["IMG_7.tif (x fringes of 3 periods at 0 degrees) is missing"]),
    (numbered(1 + 2, 12, form="scan 3 img_{:03d}"), [
        "scan 3 img_003.tif (x fringes of 0.9 periods at 0 degrees)",
        "scan 3 img_012.tif (y fringes of 0.9 periods at 90 degrees) are missing"]),
    (numbered(5, 18), ["IMG_5.tif is missing, and 1 more that no number tells"]),
    (numbered(18), ["no number is missing from IMG_1.tif to IMG_17.tif", "(y fringes of 3 periods at 270 degrees)"]),
    ([f"cam {name}" for k, name in enumerate(PICTURES) if k != 9],
     ["no image for 09-x-3-270.png (x fringes of 3 periods at 270 degrees)"]),
    ([f"shot{'abcdefghijklmnopq'[k]}" for k in range(17)], ["images are missing, or lines of frames that were not"]),
])  # fmt: skip
def test_missing_images_are_named_with_what_they_show(tmp_path, names, parts):
    text = said(tmp_path, names)
    assert text
    for part in parts:
        assert part in text


def test_images_that_do_not_belong_are_named(tmp_path):
    text = said(tmp_path, [*numbered(), "reference", "IMG_4 (copy)"])
    assert "too many; IMG_4 (copy).tif, reference.tif have names of another form" in text


def test_repeats_are_suggested_and_counted(tmp_path):
    assert "are there 2 images of each frame? Then say repeats = 2" in said(tmp_path, numbered(last=36))
    (tmp_path / "IMG_7.tif").unlink()
    with pytest.raises(ValueError, match=r"35 images; .* frames of 2 images each, 36 in all: .* IMG_7.tif is missing"):
        check_count(open_frames(tmp_path), MANIFEST, 2, "camera")
