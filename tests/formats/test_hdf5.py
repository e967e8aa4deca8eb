"""Datasets of HDF5 files of others: shapes, values, texts, and files that are broken."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from irtscots_cl.formats.hdf5 import GroupReader, groups_of, is_hdf5, opened, write_dataset


@pytest.fixture
def path(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("A")
        group["one"], group["boxed"], group["row"] = 2.5, np.array([[3.5]]), np.arange(4)
        group["column"], group["matrix"] = np.arange(3)[:, None], np.arange(6).reshape(2, 3)
        group["name"], group["nothing"] = "a name", h5py.Empty("f8")
        file["plain"] = 1.0
        file["B"] = h5py.ExternalLink("other.h5", "B")
    return tmp_path / "a.h5"


def test_axes_of_one_do_not_count(path):
    with opened(path) as file:
        read = GroupReader(file, path, "A")
        assert read.numbers("one") == 2.5 and read.numbers("boxed") == 3.5
        np.testing.assert_array_equal(read.numbers("column", 3), [0, 1, 2])
        np.testing.assert_array_equal(read.numbers("row", None), [0, 1, 2, 3])
        np.testing.assert_array_equal(read.numbers("one", None), [2.5])
        np.testing.assert_array_equal(read.numbers("matrix", 2, None), [[0, 1, 2], [3, 4, 5]])
        assert (read.text("name"), read.text("one"), read.text("missing")) == ("a name", "", "")


@pytest.mark.parametrize(
    ("name", "shape", "message"),
    [
        ("matrix", (3, 2), r"A/matrix: of shape \[2, 3\]; must be 3x2 numbers"),
        ("row", (3,), r"A/row: of shape \[4\]; must be 3 numbers"),
        ("matrix", (None,), r"of shape \[2, 3\]; must be n numbers, at most 65536"),
        ("one", (2, None), r"of shape \[\]; must be 2xn numbers"),
        ("name", (), "of shape .* and type object; must be one numbers"),
        ("nothing", (), "A/nothing: empty; must be one numbers"),
        ("missing", (), "A/missing: missing; must be a dataset"),
    ],
)
def test_other_shapes_are_refused(path, name, shape, message):
    with pytest.raises(ValueError, match=message) as caught, opened(path) as file:
        GroupReader(file, path, "A").numbers(name, *shape)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_groups_are_told_and_links_elsewhere_are_none(path, tmp_path):
    assert groups_of(path) == ("A",)
    text = tmp_path / "a.txt"
    text.write_text("no HDF5")
    assert is_hdf5(path) and not is_hdf5(text) and not is_hdf5(tmp_path) and groups_of(text) == ()


def test_broken_files_are_one_line(path, tmp_path):
    whole = path.read_bytes()
    broken = tmp_path / "broken.h5"
    for cut in (20, 100, len(whole) // 2, len(whole) - 40):
        broken.write_bytes(whole[:cut])
        with pytest.raises(ValueError, match="not a readable HDF5 file|missing") as caught, opened(broken) as file:
            GroupReader(file, broken, "A").numbers("matrix", 2, 3)
        assert "\n" not in str(caught.value)
    for other, message in ((tmp_path, "it is a folder"), (tmp_path / "no.h5", "there is no file of that name")):
        with pytest.raises(ValueError, match=message), opened(other):
            pass


def test_a_dataset_is_written_with_its_unit(tmp_path):
    values = np.random.default_rng(1).random((30, 20))
    values[3, 4] = np.nan
    with h5py.File(tmp_path / "b.h5", "w") as file:
        assert write_dataset(file, "map/height", values, "nm").name == "/map/height"
        write_dataset(file, "mask", values > 0.5, "1")
    with h5py.File(tmp_path / "b.h5") as file:
        found = file["map/height"]
        np.testing.assert_array_equal(found[:], values)
        assert found.attrs["unit"] == "nm" and found.compression == "gzip"
        assert file["mask"].dtype == bool
