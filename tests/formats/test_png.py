"""PNG files: grey of 8 and 16 bits as stored; what pillow would change without a word is refused."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from picture_files import COLUMNS, ROWS, chunk, letter_f, outcome, png, ramp, refusal
from PIL import Image

from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.formats.png import open_png

GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6


def opened(folder, data):
    path = folder / "a.png"
    path.write_bytes(data)
    return open_png(path, ReadOptions())


def refused(folder, data):
    return refusal(open_png, folder / "a.png", data)


@pytest.mark.parametrize("bits", [8, 16])
def test_grey_is_read_as_stored(tmp_path, bits):
    image = ramp(top=2**bits - 1, dtype=f"u{bits // 8}")[0]
    image[0, 0], image[-1, -1] = 2**bits - 1, 1
    file = opened(tmp_path, png(image, bits, GREY))
    assert np.array_equal(file.read(0), image) and file.read(0).dtype == file.dtype == image.dtype
    assert (file.shape, file.count, file.saturation, file.notes) == ((ROWS, COLUMNS), 1, 2**bits - 1, ())


def test_the_letter_keeps_its_orientation(tmp_path):
    assert np.array_equal(opened(tmp_path, png(letter_f(), 8, GREY)).read(0), letter_f())


def test_exif_orientation_is_applied_and_recorded(tmp_path):
    """6: the first stored row is the picture's right side, the first column its top."""
    exif = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    stored = np.rot90(letter_f())  # turned back by a quarter against the clock
    file = opened(tmp_path, png(stored, 8, GREY, extra=chunk(b"eXIf", exif)))
    assert file.shape == (ROWS, COLUMNS) and np.array_equal(file.read(0), letter_f())
    assert file.notes == ("Orientation 6 of the file applied",)


@pytest.mark.parametrize("colour, channels", [(RGB, 3), (GREY_ALPHA, 2), (RGBA, 4)])
def test_equal_channels_are_read_as_grey_and_said(tmp_path, colour, channels):
    image = letter_f()
    stored = np.stack([image] * channels, -1)
    if colour in (GREY_ALPHA, RGBA):
        stored[..., -1] = 255
    file = opened(tmp_path, png(stored, 8, colour))
    assert np.array_equal(file.read(0), image)
    assert len(file.notes) == 1 and "grey" in file.notes[0]
    if colour in (RGB, RGBA):
        stored[3, 4, 1] += 1
        assert "colour, with channels that differ: must be grey" in refused(tmp_path, png(stored, 8, colour))
    if colour in (GREY_ALPHA, RGBA):
        stored[3, 4] = [7] * (channels - 1) + [254]
        assert "transparent" in refused(tmp_path, png(stored, 8, colour))


def test_a_palette_gives_its_greys_and_not_its_numbers(tmp_path):
    numbers = (letter_f() == 200).astype(np.uint8)
    greys = chunk(b"PLTE", bytes([30, 30, 30, 90, 90, 90]))
    file = opened(tmp_path, png(numbers, 8, PALETTE, extra=greys))
    assert np.array_equal(file.read(0), np.where(numbers, 90, 30)) and "palette" in file.notes[0]
    colours = chunk(b"PLTE", bytes([30, 30, 30, 90, 91, 90]))
    assert "channels that differ" in refused(tmp_path, png(numbers, 8, PALETTE, extra=colours))
    clear = chunk(b"tRNS", bytes([255, 10]))
    assert "transparent" in refused(tmp_path, png(numbers, 8, PALETTE, extra=greys + clear))


@pytest.mark.parametrize("colour, channels", [(RGB, 3), (GREY_ALPHA, 2), (RGBA, 4)])
def test_what_pillow_cuts_to_8_bits_is_refused(tmp_path, colour, channels):
    stored = np.stack([ramp()[0]] * channels, -1)
    assert "store it as 16-bit grey" in refused(tmp_path, png(stored, 16, colour))


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_what_pillow_stretches_to_8_bits_is_refused(tmp_path, bits):
    assert f"grey of {bits} bits" in refused(tmp_path, png(letter_f(0, 1), bits, GREY))


def test_an_animation_is_refused(tmp_path):
    first, second = (Image.fromarray(letter_f(high=high)) for high in (200, 100))
    first.save(tmp_path / "b.png", save_all=True, append_images=[second])
    assert "an animation of 2 frames" in refused(tmp_path, (tmp_path / "b.png").read_bytes())


@pytest.mark.parametrize("size", [(60_000, 60_000), (10_000, 10_000), (0, 5), (2**31 - 1, 2**31 - 1)])
def test_a_header_that_claims_too_much_is_refused_before_memory_is_taken(tmp_path, size):
    said = refused(tmp_path, png(letter_f(), 8, GREY, size=size))
    assert "cut off or broken" in said or "pixels: must be" in said


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    data = png(np.arange(ROWS * COLUMNS, dtype=np.uint8).reshape(ROWS, COLUMNS), 8, GREY)
    for length in range(8, len(data) - 24, 5):  # the last 24 bytes hold no samples
        assert refused(tmp_path, data[:length])


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(8, 10**6), st.integers(0, 255)), min_size=1, max_size=4))
def test_broken_bytes_are_read_or_refused_in_one_line(tmp_path, changes):
    data = bytearray(png(letter_f(), 8, GREY))
    for place, value in changes:
        data[place % len(data)] = value
    outcome(open_png, tmp_path / "a.png", bytes(data))
