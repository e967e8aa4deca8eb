"""DATX: files made with h5py from the format's description, and its own writer."""

import io

import h5py
import numpy as np
import pytest
from map_files import INVALID, letter_map_nm, zygo_datx

from irtscots_cl.formats.height_map import CameraPlace, HeightMap, MapOptions
from irtscots_cl.formats.zygo_datx import read_zygo_datx, write_zygo_datx

VALUES = np.array([[1.0, 2.0, 3.0], [INVALID, -5.0, 6.0]])  # top row first
WANTED = np.array([[np.nan, -5.0, 6.0], [1.0, 2.0, 3.0]])


def read(folder, data, **options):
    path = folder / "a.datx"
    path.write_bytes(data)
    return read_zygo_datx(path, MapOptions(**options))


def refused(folder, data, **options):
    with pytest.raises(ValueError, match=".") as caught:
        read(folder, data, **options)
    assert str(caught.value).startswith(f"{folder / 'a.datx'}")
    return str(caught.value)


@pytest.mark.parametrize("place", ["Data/Surface/{1}", "Measurement/Surface"])
def test_units_and_places(tmp_path, place):
    found = read(tmp_path, zygo_datx(VALUES, place=place))
    np.testing.assert_allclose(found.heights_mm, WANTED * 1e-6, rtol=1e-15)
    assert found.pitch_mm == pytest.approx((0.1, 0.1)) and found.wavelength_nm == pytest.approx(632.8)
    assert (found.kind, found.warnings) == ("surface", ())
    fringes = read(tmp_path, zygo_datx(VALUES, place=place, unit=b"Fringes", **{"Obliquity Factor": 1.5}))
    np.testing.assert_allclose(fringes.heights_mm, WANTED * 0.5 * 1.5 * 632.8e-6, rtol=1e-14)


def test_other_value_without_data(tmp_path):
    found = read(tmp_path, zygo_datx(np.array([[1.0, -9999.0, 3.0]]), no_data=-9999.0))
    assert found.valid.tolist() == [[True, False, True]]


def test_scale_factor_and_gaps(tmp_path):
    assert read(tmp_path, zygo_datx(VALUES, **{"Interferometric Scale Factor": 1.0})).kind == "wavefront"
    assert read(tmp_path, zygo_datx(VALUES, lateral_m=0.0)).pitch_mm is None
    assert "give --wavelength-nm" in refused(tmp_path, zygo_datx(VALUES, unit=b"Fringes", Wavelength=0.0))
    assert "Unit = 'Radians'" in refused(tmp_path, zygo_datx(VALUES, unit=b"Radians"))
    assert "Interferometric Scale Factor = nan" in refused(
        tmp_path, zygo_datx(VALUES, unit=b"Fringes", **{"Interferometric Scale Factor": np.nan})
    )


def test_broken_files(tmp_path):
    data = zygo_datx(VALUES)
    assert "not a readable HDF5 file" in refused(tmp_path, data[:200])
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file["other"] = [1, 2]
    assert "has no dataset" in refused(tmp_path, stream.getvalue())
    assert read(tmp_path, data).valid.tolist() == [[False, True, True], [True, True, True]]


def test_sizes_that_the_file_does_not_hold(tmp_path):
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:  # a gigabyte of fill values, none of them stored
        file.create_dataset("Data/Surface/{1}", (2**14, 2**13), "f8", chunks=(256, 256))
    assert "cut off or broken" in refused(tmp_path, stream.getvalue())
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file["Data/Surface/{1}"] = h5py.ExternalLink("/etc/passwd", "/x")
    assert "has no dataset" in refused(tmp_path, stream.getvalue())
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file["Data/Surface/{1}"] = np.zeros((2, 2, 2))
    assert "must be numbers [rows, columns]" in refused(tmp_path, stream.getvalue())


@pytest.mark.parametrize("kind", ["surface", "wavefront"])
def test_written_files_come_back(tmp_path, kind):
    frames = np.arange(2 * 99).reshape(2, 11, 9).astype(float)
    place = CameraPlace(9 + 4, 11 + 6, 4, 6)
    given = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.2), 632.8, kind, intensity=frames, camera=place)
    path = tmp_path / "a.datx"
    notes = write_zygo_datx(path, given)
    found = read_zygo_datx(path, MapOptions())
    np.testing.assert_allclose(found.heights_mm, given.heights_mm, rtol=1e-15)
    assert found.pitch_mm == pytest.approx((0.1, 0.2), rel=1e-15)
    assert (found.kind, found.camera, found.warnings) == (kind, place, ())
    np.testing.assert_array_equal(found.intensity, frames[:1])
    assert notes == ("of 2 intensity frames the first is written",)


def test_intensity_is_paired_by_its_place(tmp_path):
    whole = np.arange(8 * 10).reshape(8, 10)  # of the camera, top first
    stream = io.BytesIO(zygo_datx(whole[3:6, 2:6].astype(float)))
    kind = np.dtype([(name, "<i4") for name in ("ColumnStart", "RowStart", "Width", "Height")])
    with h5py.File(stream, "r+") as file:
        file["Data/Surface/{1}"].attrs["Coordinates"] = np.array([(2, 3, 4, 3)], kind)
        data = file.create_dataset("Data/Intensity/{2}", data=whole)
        data.attrs["Coordinates"] = np.array([(0, 0, 10, 8)], kind)
    found = read(tmp_path, stream.getvalue())
    np.testing.assert_array_equal(found.intensity[0, ::-1], whole[3:6, 2:6])
    np.testing.assert_allclose(found.heights_mm[::-1] * 1e6, whole[3:6, 2:6])
