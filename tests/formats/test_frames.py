"""What all readers share: the picture's orientation, the order of names, errors as one line."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from picture_files import letter_f

from irtscots_cl.formats.frames import (
    MAX_FRAME_VALUES,
    check_orientation,
    check_size,
    exposure_time,
    native,
    natural_key,
    reading,
    upright,
    upright_shape,
)


def test_orientations_undo_what_they_say():
    """By turns and mirror images of NumPy's, apart from the formula: 6 is to be turned right, 8 left by a quarter."""
    picture = letter_f()
    stored = {
        1: picture, 2: np.fliplr(picture), 3: np.rot90(picture, 2), 4: np.flipud(picture), 5: picture.T,
        6: np.rot90(picture), 7: np.rot90(picture, 2).T, 8: np.rot90(picture, -1),
    }  # fmt: skip
    for orientation, image in stored.items():
        assert np.array_equal(upright(image, orientation), picture), orientation
        assert upright_shape(image.shape, orientation) == picture.shape


def test_orientations_that_do_not_exist_are_refused():
    assert check_orientation(Path("a"), None) == 1
    for bad in (0, 9, "x", 1.5):
        with pytest.raises(ValueError, match="^a: Orientation = .*: must be 1 to 8"):
            check_orientation(Path("a"), bad)


def test_numbers_in_names_count_by_value():
    names = ["frame_10", "frame_2", "Frame_1", "frame_02", "dark", "frame_2b", "9", "10", "frame_" + "9" * 5000]
    wanted = ["9", "10", "dark", "Frame_1", "frame_02", "frame_2", "frame_2b", "frame_10", "frame_" + "9" * 5000]
    assert sorted(names, key=natural_key) == wanted


@pytest.mark.parametrize("error", [
    ValueError("first\nsecond"), KeyError("first"), OSError("first"), ZeroDivisionError("first"), MemoryError("first"),
    RecursionError("first"),
])  # fmt: skip
def test_what_libraries_raise_is_one_line(error):
    with pytest.raises(ValueError, match="^a: not a readable X file: first$"), reading(Path("a"), "X"):
        raise error


def test_own_lines_and_interruptions_pass():
    with pytest.raises(ValueError, match="^a: own$"), reading(Path("a"), "X"):
        raise ValueError("a: own")
    for error in (InterruptedError, KeyboardInterrupt):
        with pytest.raises(error), reading(Path("a"), "X"):
            raise error
    with reading(Path("a"), "X"):
        warnings.warn("a library's", UserWarning, stacklevel=1)


def test_sizes_are_checked_against_the_file():
    check_size("a", 10, 10, 2, 1.5, 300, 1)
    for columns, rows, count, stored, said in (
        (10, 10, 2, 299, "claims 2 frames of 10 x 10 pixels = 300 bytes, of which the file holds 299"),
        (0, 10, 1, 300, "0 x 10 pixels: must be"),
        (MAX_FRAME_VALUES, 2, 1, 1e12, f"{MAX_FRAME_VALUES} x 2 pixels: must be"),
        (10, 10, 0, 300, "0 frames: must be"),
    ):
        with pytest.raises(ValueError, match=f"^a: {said}"):
            check_size("a", columns, rows, count, 1.5, stored, 1)


def test_native_keeps_values():
    image = np.array([[1, 258]], ">u2")
    assert native(image).dtype == np.dtype("=u2") and native(image).tolist() == [[1, 258]]


@pytest.mark.parametrize("value, seconds", [
    (0.5, 0.5), ("0.25", 0.25), ((1, 50), 0.02), (0, None), (-1, None), ((1, 0), None), ("long", None), (None, None),
    (float("inf"), None), ((1, 2, 3), None),
])  # fmt: skip
def test_exposure_times_are_numbers_or_ratios(value, seconds):
    assert exposure_time(value) == seconds
