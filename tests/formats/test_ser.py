"""SER files: the byte order that no flag tells, times, and files that are not whole."""

import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from picture_files import COLUMNS, ROWS, frames, letter_f, outcome, ramp, refusal, ser

from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.formats.ser import open_ser


def opened(folder, data, **options):
    path = folder / "a.ser"
    path.write_bytes(data)
    return open_ser(path, ReadOptions(**options))


def refused(folder, data, **options):
    return refusal(open_ser, folder / "a.ser", data, ReadOptions(**options))


def noisy(count=2, bits=16, dtype=np.uint16):
    """Pictures of a camera with so many bits of counts, with noise of some counts."""
    rng = np.random.default_rng(5)
    images = ramp(count, int, top=2**bits - 1, rows=30, columns=40) + rng.normal(
        0, 2 ** (bits / 2 - 2), (count, 30, 40)
    )
    return np.clip(np.rint(images), 0, 2**bits - 1).astype(dtype)


def test_bytes_are_counts_with_the_first_row_at_the_top(tmp_path):
    images = np.stack([letter_f(), letter_f(20, 190)])
    file = opened(tmp_path, ser(images))
    assert np.array_equal(frames(file), images) and file.dtype == np.uint8
    assert (file.shape, file.count, file.saturation) == ((ROWS, COLUMNS), 2, 255)
    assert file.notes == ("no times",) and file.times is None


@pytest.mark.parametrize("flag", [0, 1])
@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_the_byte_order_is_found_from_the_data_whatever_the_flag_says(tmp_path, bits, order, flag):
    images = noisy(bits=bits)
    file = opened(tmp_path, ser(images, bits, order=order, flag=flag))
    assert np.array_equal(frames(file), images)
    assert file.notes[0].startswith(f"byte order {order}-endian") and file.saturation == 2**bits - 1


@pytest.mark.parametrize("order", ["little", "big"])
def test_counts_moved_to_the_upper_bits_keep_their_order(tmp_path, order):
    images = noisy(bits=12) << 4
    assert np.array_equal(frames(opened(tmp_path, ser(images, 16, order=order))), images)


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("images", [
    np.random.default_rng(1).integers(0, 2**16, (2, 9, 9)),  # either order is noise
    np.random.default_rng(2).integers(0, 2**8, (2, 9, 9)),  # one byte is always 0: 256 times the other order
], ids=["noise", "bytes"])  # fmt: skip
def test_an_order_that_the_data_do_not_tell_must_be_stated(tmp_path, images, order):
    data = ser(images, 16, order=order)
    assert 'state it (ser_byte_order, "little" or "big")' in refused(tmp_path, data)
    file = opened(tmp_path, data, ser_byte_order=order)
    assert np.array_equal(frames(file), images) and "as told" in file.notes[0]


@pytest.mark.parametrize("order", ["little", "big"])
def test_the_bits_tell_the_order_of_dark_frames(tmp_path, order):
    """Noise below 256 counts: only the 12 bits say that it is not 256 times as high."""
    images = np.random.default_rng(2).integers(0, 2**8, (2, 9, 9))
    assert np.array_equal(frames(opened(tmp_path, ser(images, 12, order=order))), images)


def test_an_order_that_does_not_matter_is_not_asked_for(tmp_path):
    images = np.full((2, 4, 5), 0x4141)
    assert np.array_equal(frames(opened(tmp_path, ser(images, 16))), images)


def test_counts_above_the_stated_bits_are_said(tmp_path):
    file = opened(tmp_path, ser(noisy(bits=16), 12), ser_byte_order="little")
    assert file.saturation == 2**16 - 1 and "though its header says 12 bits" in file.notes[1]


def test_the_option_takes_two_values(tmp_path):
    with pytest.raises(ValueError, match="ser_byte_order = 'middle': must be one of 'little', 'big'"):
        ReadOptions(ser_byte_order="middle")


def test_times_are_read_from_the_trailer(tmp_path):
    start = np.datetime64("2024-02-29T12:34:56.000001")
    ticks = (start - np.datetime64("0001-01-01")).astype("timedelta64[us]").astype(int) * 10
    trailer = struct.pack("<2q", ticks, ticks + 400_000)
    file = opened(tmp_path, ser(ramp(2, np.uint8, top=255), trailer=trailer))
    assert file.times.tolist() == [start.tolist(), (start + np.timedelta64(40, "ms")).tolist()] and file.notes == ()
    back = opened(tmp_path, ser(ramp(2, np.uint8, top=255), trailer=struct.pack("<2q", ticks, ticks - 1)))
    assert back.notes == ("times that go back from frame to frame",)
    for bad in (struct.pack("<2q", ticks, 0), struct.pack("<2q", ticks, 2**62), trailer[:-1]):
        file = opened(tmp_path, ser(ramp(2, np.uint8, top=255), trailer=bad))
        assert file.times is None and "left out" in file.notes[0]


@pytest.mark.parametrize("changes, said", [
    ({"colour": 8}, "colour (Bayer RGGB): must be mono"),
    ({"colour": 100}, "colour (RGB)"),
    ({"colour": 55}, "ColorID 55"),
    ({"bits": 0}, "0 bits: must be 1 to 16"),
    ({"count": 0}, "0 frames, and 198 bytes after the header: its recording was not finished"),
    ({"count": 3}, "claims 3 frames of 9 x 11 pixels = 297 bytes, of which the file holds 198"),
    ({"count": -1}, "-1 frames"),
    ({"count": 2**31 - 1}, "2147483647 frames: must be"),
    ({"size": (100_000, 100_000)}, "pixels: must be"),
    ({"size": (10_000, 10_000)}, "cut off or broken"),
    ({"size": (-9, -11)}, "-9 x -11 pixels: must be"),
])  # fmt: skip
def test_headers_that_cannot_be_are_refused(tmp_path, changes, said):
    assert said in refused(tmp_path, ser(np.stack([letter_f()] * 2), **changes))


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    data = ser(np.stack([letter_f()] * 2))
    for length in range(14, len(data), 9):
        assert refused(tmp_path, data[:length])


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(14, 10**6), st.integers(0, 255)), min_size=1, max_size=4))
def test_broken_bytes_are_read_or_refused_in_one_line(tmp_path, changes):
    data = bytearray(ser(ramp(2), 12, trailer=bytes(16)))
    for place, value in changes:
        data[place % len(data)] = value
    outcome(open_ser, tmp_path / "a.ser", bytes(data))
