"""Maps in NumPy's files, written by NumPy and by the package."""

import io

import numpy as np
import pytest
from map_files import letter_map_nm, npz, zipped

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.map_npz import read_map_npy, read_map_npz, write_map_npy, write_map_npz

HEIGHTS = letter_map_nm() * 1e-6


def read(folder, data, reader=read_map_npz, **options):
    path = folder / "a.npz"
    path.write_bytes(data)
    return reader(path, MapOptions(**options))


def test_files_of_numpy(tmp_path):
    arrays = {"heights_mm": HEIGHTS, "pitch_mm": [0.1, 0.2], "wavelength_nm": 632.8, "centre_mm": [3, -4]}
    found = read(tmp_path, npz(**arrays, wavefront=True, other=np.zeros(5)))
    np.testing.assert_array_equal(found.heights_mm, HEIGHTS)
    assert (found.pitch_mm, found.centre_mm, found.wavelength_nm) == ((0.1, 0.2), (3.0, -4.0), 632.8)
    assert (found.kind, found.warnings) == ("wavefront", ())
    bare = read(tmp_path, npz(heights_mm=HEIGHTS))
    assert bare.pitch_mm is None and len(bare.warnings) == 3


def test_broken_files(tmp_path):
    for data, said in (
        (npz(other=HEIGHTS), "has no array heights_mm: give --array, one of: other"),
        (npz(heights_mm=np.zeros((2, 3, 4))), "2 maps in heights_mm: a map is one; give --number"),
        (npz(heights_mm=np.array([["a"]])), "must be real numbers"),
        (npz(heights_mm=HEIGHTS)[:-30], "not a readable NPZ file"),
        (npz(heights_mm=HEIGHTS, wavelength_nm=-1e9), None),
        (npz(heights_mm=HEIGHTS, pitch_mm=[1e9, 1.0]), "pitch of 1e+09 mm"),
        (zipped({"heights_mm.npy": b"\x93NUMPY\1\0"}), "not a readable NPZ file"),
    ):
        if said is None:
            assert read(tmp_path, data).wavelength_nm is None
            continue
        with pytest.raises(ValueError, match=".") as caught:
            read(tmp_path, data)
        assert said in str(caught.value) and str(caught.value).startswith(str(tmp_path / "a.npz"))


def test_npy_files_need_a_unit_and_warn_of_the_row_order(tmp_path):
    stream = io.BytesIO()
    np.save(stream, letter_map_nm())
    with pytest.raises(ValueError, match="tells no unit"):
        read(tmp_path, stream.getvalue(), read_map_npy)
    found = read(tmp_path, stream.getvalue(), read_map_npy, unit="nm")
    np.testing.assert_allclose(found.heights_mm, HEIGHTS, rtol=1e-15)
    assert "an NPY file does not tell its row order: row 0 is taken as the lowest" in found.warnings


def test_written_files_come_back_exactly(tmp_path):
    given = HeightMap(HEIGHTS, (0.1, 0.2), 632.8, "wavefront", (3.0, -4.0))
    path = tmp_path / "a.npz"
    assert write_map_npz(path, given) == ()
    found = read_map_npz(path, MapOptions())
    np.testing.assert_array_equal(found.heights_mm, HEIGHTS)
    assert (found.pitch_mm, found.centre_mm, found.wavelength_nm) == (given.pitch_mm, given.centre_mm, 632.8)
    assert (found.kind, found.warnings) == ("wavefront", ())
    with np.load(path) as arrays:
        np.testing.assert_array_equal(arrays["heights_mm"], HEIGHTS)
        assert arrays["pitch_mm"].tolist() == [0.1, 0.2]
    write_map_npy(tmp_path / "a.npy", given, "nm")
    np.testing.assert_allclose(np.load(tmp_path / "a.npy"), letter_map_nm(), rtol=1e-15)
    np.testing.assert_allclose(read_map_npy(tmp_path / "a.npy", MapOptions(unit="nm")).heights_mm, HEIGHTS, rtol=3e-16)


def test_one_number_is_the_pitch_of_both_axes(tmp_path):
    (tmp_path / "a.npz").write_bytes(npz(heights_mm=letter_map_nm() * 1e-6, pitch_mm=np.float64(0.1)))
    assert read_map_npz(tmp_path / "a.npz", MapOptions()).pitch_mm == (0.1, 0.1)


@pytest.mark.parametrize("number", [0, -1, 4])
def test_maps_are_numbered_from_1(tmp_path, number):
    (tmp_path / "a.npz").write_bytes(npz(heights_mm=np.zeros((3, 4, 5))))
    with pytest.raises(ValueError, match=f"--number = {number}: must be 1 to 3"):
        read_map_npz(tmp_path / "a.npz", MapOptions(number=number))
