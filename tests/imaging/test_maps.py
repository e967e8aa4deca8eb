"""Maps from NPY files: what is read, and the one line that refuses the rest."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.maps import read_map
from irtscots_cl.scene.validation import SceneError

KEY = "screen.response.brightness_map"
GOOD = np.arange(12.0).reshape(3, 4)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.uint8, np.int32])
@pytest.mark.parametrize("order", ["C", "F"])
def test_numbers_of_any_type_and_order_become_float64(tmp_path, kind, order):
    path = tmp_path / "map.npy"
    np.save(path, np.asarray(GOOD, kind, order=order))
    found = read_map(str(path), KEY, (3, 4))
    np.testing.assert_array_equal(found, GOOD)
    assert found.dtype == np.float64 and type(found) is np.ndarray


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (GOOD.T, "has shape (4, 3); must be [rows, columns] = [3, 4]"),
        (GOOD[None], "has shape (1, 3, 4); must be [rows, columns] = [3, 4]"),
        (np.where(GOOD == 6, np.nan, GOOD), "nan at row 1, column 2; must be finite and at least 0"),
        (np.where(GOOD == 11, np.inf, GOOD), "inf at row 2, column 3; must be finite and at least 0"),
        (GOOD - 1.0, "-1.0 at row 0, column 0; must be finite and at least 0"),
        (GOOD.astype(complex), "holds values of type complex128; must be numbers"),
        (GOOD.astype(str), "holds values of type <U32; must be numbers"),
        (GOOD > 3, "holds values of type bool; must be numbers"),
    ],
)
def test_a_map_that_does_not_fit_is_refused(tmp_path, values, reason):
    path = tmp_path / "map.npy"
    np.save(path, values)
    with pytest.raises(ValueError, match="map.npy") as caught:
        read_map(str(path), KEY, (3, 4))
    assert str(caught.value) == f"{path}: {KEY}: {reason}"


@pytest.mark.parametrize("content", [b"", b"\x93NUMPY", b"no numbers at all, but a long text", None])
def test_what_is_no_npy_file_is_refused(tmp_path, content):
    path = tmp_path / "map.npy"
    if content is not None:
        path.write_bytes(content)
    reason = "No such file or directory" if content is None else "it is not an NPY file with one array of numbers"
    with pytest.raises(ValueError, match="map.npy") as caught:
        read_map(str(path), KEY, (3, 4))
    assert str(caught.value) == f"{path}: {KEY}: cannot be read: {reason}"


def test_objects_which_could_run_code_are_not_loaded(tmp_path):
    path = tmp_path / "map.npy"
    np.save(path, np.array([[{}]], object), allow_pickle=True)
    with pytest.raises(ValueError, match="cannot be read: it is not an NPY file with one array of numbers"):
        read_map(str(path), KEY, (1, 1))


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(ValueError, match="cannot be read: Is a directory"):
        read_map(str(tmp_path), KEY, (1, 1))


@pytest.mark.parametrize("name", ["a\nb.npy", "\x1b[0m.npy", "a\0b.npy", "n" * 5000])
def test_any_name_is_shown_in_one_printable_line(name):
    with pytest.raises(SceneError, match="brightness_map: cannot be read") as caught:
        read_map(name, KEY, (1, 1))
    assert str(caught.value).isprintable()
