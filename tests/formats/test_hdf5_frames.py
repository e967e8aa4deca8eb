"""HDF5 files with frames: which dataset they are, what is refused."""

import h5py
import numpy as np
import pytest
from picture_files import COLUMNS, ROWS, frames, ramp

from irtscots_cl.formats.frames import ReadOptions
from irtscots_cl.formats.hdf5_frames import open_hdf5
from irtscots_cl.formats.images import open_frames


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.h5"


def written(path, **data):
    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file[name.replace("__", "/")] = values
    return path


def refused(path, **options):
    with pytest.raises(ValueError, match=".") as caught:
        open_hdf5(path, ReadOptions(**options))
    said = str(caught.value)
    assert said.startswith(f"{path}: ") and said.isprintable()
    return said


@pytest.mark.parametrize("dtype, saturation", [("<u2", 65535), (">u2", 65535), ("u1", 255), ("<f4", np.inf)])
def test_the_only_stack_is_the_frames(path, dtype, saturation):
    written(path, camera__images=ramp(5, top=200).astype(dtype), times=np.arange(5.0), one=ramp()[0])
    file = open_hdf5(path, ReadOptions())
    assert (file.shape, file.count, file.saturation) == ((ROWS, COLUMNS), 5, saturation)
    assert np.array_equal(frames(file), ramp(5, top=200)) and file.read(0).dtype == file.dtype
    assert file.notes == ("frames of dataset /camera/images",)
    assert np.array_equal(open_frames(path)[4], ramp(5, top=200)[4])


def test_packed_frames_are_read(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=ramp(6), compression="gzip", chunks=(2, ROWS, COLUMNS))
    assert np.array_equal(frames(open_hdf5(path, ReadOptions())), ramp(6))


def test_one_of_several_must_be_named(path):
    written(path, a=ramp(2), b=ramp(3))
    assert "2 datasets [frames, rows, columns] (/a, /b): name one" in refused(path)
    assert open_hdf5(path, ReadOptions(npz_array="b")).count == 3
    assert "'c': no dataset of real numbers" in refused(path, npz_array="c")


def test_other_contents_are_refused(path, tmp_path):
    assert "no datasets [frames, rows, columns]" in refused(written(path, a=ramp()[0]))
    assert "shape [5, 11, 3]: colour" in refused(written(path, a=np.zeros((5, 11, 3), np.uint8)))
    path.write_bytes(b"\x89HDF\r\n\x1a\n")
    assert "not a readable HDF5 file" in refused(path)


def test_values_of_other_files_are_not_read(path, tmp_path):
    written(tmp_path / "other.h5", a=ramp(2))
    with h5py.File(path, "w") as file:
        file["a"] = h5py.ExternalLink("other.h5", "a")
    assert "no datasets" in refused(path)
    layout = h5py.VirtualLayout((2, ROWS, COLUMNS), "u2")
    layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "a", (2, ROWS, COLUMNS))
    with h5py.File(path, "w") as file:
        file.create_virtual_dataset("a", layout)
    assert "no datasets" in refused(path)


def test_a_claim_that_the_file_does_not_hold_is_refused(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("a", (100, 4000, 4000), "u2")  # nothing is written
    assert "cut off or broken" in refused(path)
