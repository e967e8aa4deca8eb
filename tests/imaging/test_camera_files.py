"""What a manifest and the options say of a laboratory's camera: keys, values, which of both holds, bad-pixel maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from picture_files import COLUMNS, ROWS, fits, png, ramp, tiff

from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.imaging.camera_files import CameraFiles, camera_files, named


def test_a_table_is_read_with_its_names_in_the_manifest_s_folder(tmp_path):
    for name in ("d_2.tif", "d_10.tif", "._d_3.tif"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "flat").mkdir()
    table = {
        "dark": "d_*.tif", "flat": ["flat"], "bad_pixels": "bad.png", "exposures_s": [0.5, 2],
        "repeat_order": "in turn", "dark_exposure_s": 2, "saturation": 4095,
        "fits_rows": "top-down", "ser_byte_order": "big", "array": "a",
    }  # fmt: skip
    found = camera_files(table, tmp_path)
    assert found == CameraFiles(
        dark=(tmp_path / "d_2.tif", tmp_path / "d_10.tif"), flat=(tmp_path / "flat",),
        bad_pixels=tmp_path / "bad.png", exposures_s=(0.5, 2.0), repeat_order="in turn", dark_exposure_s=2.0,
        saturation=4095.0, read=ReadOptions("big", "top-down", "a"),
    )  # fmt: skip
    assert found.images_of_frame == 2 and found.changes_frames
    assert camera_files({}, tmp_path) == CameraFiles() and not CameraFiles(saturation=9.0).changes_frames


@pytest.mark.parametrize("table, said", [
    ({"darks": "d"}, "camera.darks: unknown key; "),
    ({"dark": "absent"}, "camera.dark = 'absent': there is no file or folder"),
    ({"dark": "*.tif"}, "camera.dark = '*.tif': no file in"),
    ({"dark": 3}, "camera.dark = 3: must be a name or a list of names"),
    ({"bad_pixels": ["a"]}, "camera.bad_pixels = ['a']: must be a name"),
    ({"repeats": 0}, "camera.repeats = 0: must be 1 to"),
    ({"repeats": 2.0}, "camera.repeats = 2.0: must be a whole number"),
    ({"repeats": 3, "exposures_s": [1, 2]}, "camera.repeats = 3: there are 2 exposures_s"),
    ({"exposures_s": [1, 0]}, "camera.exposures_s = [1.0, 0.0]: must be numbers above 0"),
    ({"exposures_s": "1"}, "camera.exposures_s = '1': must be a list of numbers"),
    ({"saturation": -1}, "camera.saturation = -1: must be a number above 0"),
    ({"saturation": True}, "camera.saturation = True: must be a number"),
    ({"repeat_order": "x"}, "camera.repeat_order = 'x': must be one of 'together', 'in turn'"),
    ({"fits_rows": "up"}, "camera.fits_rows = 'up': must be one of 'bottom-up', 'top-down'"),
    ({"flat_dark": "."}, "camera.flat_dark: must be left out where there are no flat frames"),
    ([1], "camera: must be a table"),
])  # fmt: skip
def test_what_is_wrong_is_named_by_key_and_value(tmp_path, table, said):
    with pytest.raises(ValueError, match=".") as caught:
        camera_files(table, tmp_path)
    assert said in str(caught.value) and str(caught.value).isprintable()


def test_options_replace_what_the_manifest_says():
    own = CameraFiles(dark=(Path("d"),), repeats=3, saturation=255.0, read=ReadOptions(fits_rows="top-down"))
    assert own.replaced_by(CameraFiles()) == own
    other = CameraFiles(exposures_s=(1.0, 4.0), flat=(Path("f"),), read=ReadOptions(ser_byte_order="big"))
    both = own.replaced_by(other)
    assert (both.dark, both.flat, both.repeats, both.exposures_s) == ((Path("d"),), (Path("f"),), 1, (1.0, 4.0))
    assert both.saturation == 255 and both.read == ReadOptions("big", "top-down")


def test_names_with_stars_leave_out_hidden_files(tmp_path):
    for name in ("a 1 (2).tif", "a 1 (10).tif", ".a.tif", "._a 1 (3).tif"):
        (tmp_path / name).write_bytes(b"x")
    assert [p.name for p in named(tmp_path, "*.tif", "x")] == ["a 1 (2).tif", "a 1 (10).tif"]


@pytest.mark.parametrize("name", ["bad.png", "bad.tif", "bad.npy", "bad.fits"])
def test_a_map_of_bad_pixels_is_read_from_every_kind(tmp_path, name):
    if name.endswith("fits"):
        pytest.importorskip("astropy", reason="pip install irtscots-cl[fits]")
    is_bad = np.zeros((ROWS, COLUMNS), bool)
    is_bad[2, 3] = is_bad[-1, 0] = True
    image = (255 * is_bad).astype(np.uint8)
    path = tmp_path / name
    if name.endswith("npy"):
        np.save(path, is_bad)
    else:
        path.write_bytes(
            {"png": png(image, 8, 0), "tif": tiff([image.tobytes()], 8), "fits": fits(image[::-1], 8)}[name[4:]]
        )
    found = CameraFiles(bad_pixels=path).bad((ROWS, COLUMNS))
    assert found is not None and np.array_equal(found, is_bad)


@pytest.mark.parametrize("image, said", [
    (np.ones((ROWS, COLUMNS), np.uint8), "marks 100% of the pixels as bad: must be 0 where they are good"),
    (np.zeros((ROWS, 4), np.uint8), "has 4 x 11 pixels; must have the images' 9 x 11"),
    (ramp(1, np.uint8, 255)[0], "different values; must be 0 and, for bad pixels, another one"),
])  # fmt: skip
def test_another_map_of_bad_pixels_is_refused(tmp_path, image, said):
    np.save(tmp_path / "bad.npy", image)
    with pytest.raises(ValueError, match=".") as caught:
        CameraFiles(bad_pixels=tmp_path / "bad.npy").bad((ROWS, COLUMNS))
    assert said in str(caught.value) and "bad-pixel map" in str(caught.value)


def test_files_that_cannot_be_read_are_named_with_what_they_are(tmp_path):
    (tmp_path / "d.tif").write_bytes(b"")
    with pytest.raises(ValueError, match=r"^dark frames: .*d.tif: not a readable image file: 0 bytes"):
        CameraFiles(dark=(tmp_path / "d.tif",)).open("dark")
    assert CameraFiles().open("dark") is None
