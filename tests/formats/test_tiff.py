"""TIFF files: what cameras' programs write, and what half of the readers get wrong."""

import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from picture_files import COLUMNS, ROWS, frames, letter_f, outcome, packed, ramp, refusal, tiff

from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.formats.tiff import open_tiff


def opened(folder, data):
    path = folder / "a.tif"
    path.write_bytes(data)
    return open_tiff(path, ReadOptions())


def refused(folder, data):
    return refusal(open_tiff, folder / "a.tif", data)


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("kind, letter, bits, stated", [
    (1, "u", 8, 8), (1, "u", 16, 16), (1, "u", 32, 32), (2, "i", 16, 15), (3, "f", 32, 0), (3, "f", 64, 0),
])  # fmt: skip
def test_whole_numbers_and_floats_in_both_byte_orders(tmp_path, big, kind, letter, bits, stated):
    dtype = np.dtype(f"{letter}{bits // 8}")
    image = letter_f(dtype=dtype) if letter == "u" else letter_f(-100, 77, dtype)
    file = opened(
        tmp_path, tiff([image.astype(dtype.newbyteorder(">" if big else "<")).tobytes()], bits, big=big, kind=kind)
    )
    assert file.read(0).dtype == file.dtype == dtype and file.dtype.isnative
    assert np.array_equal(file.read(0), image)
    assert file.bits == stated and file.saturation == (2**stated - 1 if stated else np.inf)


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("bits", [10, 12, 14])
def test_packed_samples_are_not_scaled(tmp_path, bits, big):
    """Another reader multiplies them by 64, 16 and 4."""
    pytest.importorskip("imagecodecs", reason="pip install irtscots-cl[images]")
    image = ramp(top=2**bits - 1)[0]
    image[0, 0] = 2**bits - 1
    file = opened(tmp_path, tiff([packed(image, bits)], bits, big=big))
    assert np.array_equal(file.read(0), image)
    assert file.dtype == np.uint16 and file.saturation == 2**bits - 1


def test_a_missing_codec_is_named_with_its_remedy(tmp_path, monkeypatch):
    def without(*args, **keywords):
        raise ValueError("<COMPRESSION.LZW: 5> requires the 'imagecodecs' package")

    monkeypatch.setattr(tifffile.TiffPage, "asarray", without)
    said = refused(tmp_path, tiff([packed(ramp()[0], 12)], 12))
    assert said.endswith("pip install irtscots-cl[images]") and "12 bits" in said


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7])
def test_pages_are_frames_and_never_colour(tmp_path, count):
    images = ramp(count)
    file = opened(tmp_path, tiff([image.tobytes() for image in images], 16))
    assert (file.count, file.shape) == (count, (ROWS, COLUMNS))
    assert np.array_equal(frames(file), images)


@pytest.mark.parametrize("count", [3, 4])
def test_stacks_of_another_writer_are_frames(tmp_path, count):
    tifffile.imwrite(tmp_path / "a.tif", ramp(count), photometric="minisblack", compression="zlib", bigtiff=True)
    file = open_tiff(tmp_path / "a.tif", ReadOptions())
    assert np.array_equal(frames(file), ramp(count))


# Where the first stored row and column are on the picture, by TIFF 6.0's table of Orientation.
TURNS = {
    1: ("top", "left"), 2: ("top", "right"), 3: ("bottom", "right"), 4: ("bottom", "left"),
    5: ("left", "top"), 6: ("right", "top"), 7: ("right", "bottom"), 8: ("left", "bottom"),
}  # fmt: skip


def stored_as(picture, orientation):
    """The picture as a file of that orientation stores it, sample by sample."""
    row_side, column_side = TURNS[orientation]
    rows, columns = picture.shape
    place = {
        "top": lambda k: ("row", k), "bottom": lambda k: ("row", rows - 1 - k),
        "left": lambda k: ("column", k), "right": lambda k: ("column", columns - 1 - k),
    }  # fmt: skip
    shape = (rows, columns) if row_side in ("top", "bottom") else (columns, rows)
    stored = np.empty(shape, picture.dtype)
    for i in range(shape[0]):
        for j in range(shape[1]):
            at = dict((place[row_side](i), place[column_side](j)))
            stored[i, j] = picture[at["row"], at["column"]]
    return stored


@pytest.mark.parametrize("orientation", TURNS)
def test_orientation_is_applied_and_recorded(tmp_path, orientation):
    stored = stored_as(letter_f(), orientation)
    file = opened(tmp_path, tiff([stored.tobytes()], 8, orientation=orientation, shapes=[stored.shape]))
    assert np.array_equal(file.read(0), letter_f())
    assert file.shape == (ROWS, COLUMNS)
    assert file.notes == (() if orientation == 1 else (f"Orientation {orientation} of the file applied",))


def test_an_orientation_that_does_not_exist_is_refused(tmp_path):
    assert "Orientation = 9: must be 1 to 8" in refused(tmp_path, tiff([letter_f().tobytes()], 8, orientation=9))


@pytest.mark.parametrize("changes, said", [
    ({"photometric": 0}, "MinIsWhite"),
    ({"photometric": 2, "samples": 3}, "RGB: must be one grey channel; record mono"),
    ({"photometric": 3}, "palette colour"),
    ({"photometric": 32803}, "colour filter array"),
    ({"samples": 2}, "2 samples per pixel"),
    ({"tags": [(259, 3, 7)]}, "JPEG, which changes the counts"),
    ({"kind": 5}, "samples of 8 bits, format 5"),
])  # fmt: skip
def test_what_is_no_grey_measurement_is_refused(tmp_path, changes, said):
    data = letter_f().tobytes() * changes.get("samples", 1)
    assert said in refused(tmp_path, tiff([data], 8, **changes))


def test_pages_of_unequal_size_are_refused(tmp_path):
    """Another reader drops them without a word."""
    image = letter_f()
    said = refused(tmp_path, tiff([image.tobytes(), image[:-1].tobytes()], 8, shapes=[image.shape, image[:-1].shape]))
    assert f"page 2 has {COLUMNS} x {ROWS - 1} pixels" in said and "must be equal" in said


def test_a_strip_without_bytes_is_refused(tmp_path):
    """tifffile gives zeros for it."""
    assert "0 of its 1 strips" in refused(tmp_path, tiff([letter_f().tobytes()], 8, tags=[(279, 4, 0)]))


def test_a_lost_page_is_refused(tmp_path):
    """ImageJ writes one page for all images of a file above 4 GiB."""
    tifffile.imwrite(tmp_path / "a.tif", ramp(5), imagej=True)
    whole = open_tiff(tmp_path / "a.tif", ReadOptions())
    assert whole.count == 5 and np.array_equal(frames(whole), ramp(5))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        second, order = file.pages[1].offset, {"<": "little", ">": "big"}[file.byteorder]
    link = second.to_bytes(4, order)
    data = (tmp_path / "a.tif").read_bytes()
    said = refused(tmp_path, data.replace(link, bytes(4), 1))
    assert "1 pages, though its description says 5 images" in said


def second_page(data):
    """Where the second page's directory is, in a little-endian file of `tiff`."""
    link = 8 + 2 + 12 * int.from_bytes(data[8:10], "little")
    return int.from_bytes(data[link : link + 4], "little")


def test_pages_in_a_circle_are_refused(tmp_path):
    data = bytearray(tiff([letter_f().tobytes()] * 2, 8))
    second = second_page(data)
    end = second + 2 + 12 * int.from_bytes(data[second : second + 2], "little")
    data[end : end + 4] = (8).to_bytes(4, "little")
    assert "page 3 is at byte 8 of" in refused(tmp_path, data)


def test_a_page_that_tifffile_leaves_out_is_missed(tmp_path):
    """It takes no page of more than 4096 tags, and says so only by logging."""
    data = bytearray(tiff([letter_f().tobytes()] * 2, 8))
    second = second_page(data)
    data[second : second + 2] = (4500).to_bytes(2, "little")
    data += bytes(12 * 4500 + 100)
    assert "1 of its 2 pages can be read" in refused(tmp_path, data)


@pytest.mark.parametrize("tag, value", [(256, 100_000), (257, 1_000_000), (256, 2**32 - 1), (279, 2**31)])
def test_a_header_that_claims_too_much_is_refused_before_memory_is_taken(tmp_path, tag, value):
    said = refused(tmp_path, tiff([letter_f().tobytes()], 8, tags=[(tag, 4, value)]))
    assert "cut off or broken" in said or "pixels: must be" in said


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    data = tiff([letter_f().tobytes()] * 2, 8)
    for length in range(9, len(data) - 1, 7):  # the last byte is padding
        assert refused(tmp_path, data[:length])


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=4))
def test_broken_bytes_are_read_or_refused_in_one_line(tmp_path, changes):
    data = bytearray(tiff([letter_f().tobytes()] * 2, 8))
    for place, value in changes:
        data[place % len(data)] = value
    outcome(open_tiff, tmp_path / "a.tif", bytes(data))


@pytest.mark.parametrize("where", ["own", "exif", "none", "differ"])
def test_the_exposure_is_read_where_all_pages_say_one(tmp_path, where):
    path = tmp_path / "a.tif"
    if where == "exif":
        from PIL import Image
        from PIL.TiffImagePlugin import IFDRational

        exif = Image.Exif()
        exif.get_ifd(34665)[33434] = exif_time = IFDRational(1, 50)
        exif[34665] = {33434: exif_time}  # pillow writes the directory only where both are set
        Image.fromarray(ramp()[0]).save(path, exif=exif)
    else:
        with tifffile.TiffWriter(path) as file:
            for k, image in enumerate(ramp(2)):
                time = (1, 50) if where == "own" or k == 0 else (1, 25)
                file.write(image, extratags=[] if where == "none" else [(33434, 5, 1, time, True)], metadata=None)
    expected = 0.02 if where in ("own", "exif") else None
    assert open_tiff(path, ReadOptions()).exposure_s == expected
