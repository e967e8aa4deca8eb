"""Zemax's grid sag files made from the format's description, and its own writer."""

import numpy as np
import pytest
from map_files import letter_map_nm, zemax

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.zemax_grid import is_zemax_grid, read_zemax_grid, write_zemax_grid

VALUES = np.arange(30.0).reshape(5, 6) * 1e-3  # the -x, +y corner first


def read(folder, data, **options):
    path = folder / "a.DAT"
    path.write_bytes(data)
    assert is_zemax_grid(path)
    return read_zemax_grid(path, MapOptions(**options))


def refused(folder, data):
    path = folder / "a.DAT"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=".") as caught:
        read_zemax_grid(path, MapOptions())
    assert str(caught.value).startswith(f"{path}: ")
    return str(caught.value)


@pytest.mark.parametrize(("unit", "mm"), [(0, 1.0), (1, 10.0), (2, 25.4), (3, 1000.0)])
def test_units(tmp_path, unit, mm):
    found = read(tmp_path, zemax(VALUES, delx=0.1, dely=-0.2, unit=unit, centre="0.5 -1"))
    np.testing.assert_allclose(found.heights_mm, VALUES[::-1] * mm, rtol=1e-15)
    assert found.pitch_mm == pytest.approx((0.1 * mm, 0.2 * mm))
    assert found.centre_mm == pytest.approx((0.5 * mm, -mm))
    assert (found.kind, found.warnings) == ("surface", ())


def test_points_with_the_flag_are_invalid(tmp_path):
    flags = np.zeros_like(VALUES)
    flags[0, 1] = flags[4, 5] = 1
    found = read(tmp_path, b"! a comment\n\n" + zemax(VALUES, flags=flags, end="\n"))
    np.testing.assert_array_equal(found.valid[::-1], flags == 0)


def test_short_lines_and_no_decentre(tmp_path):
    text = "6 5 0.1 0.1 0\n" + "\n".join(f"{z!r}" for z in VALUES.ravel().tolist())
    np.testing.assert_allclose(read(tmp_path, text.encode()).heights_mm, VALUES[::-1], rtol=1e-15)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "has no line of nx, ny"),
        (b"6 5 0.1\n0 0\n", "3 values: must be nx, ny"),
        (zemax(VALUES).replace(b"6 5 ", b"6.5 5 ", 1), "'6.5': must be a whole number"),
        (zemax(VALUES, unit=4), "unit: 4: must be 0 to 3"),
        (zemax(VALUES)[:-40], "of its 30 points: cut off or broken"),
        (zemax(VALUES) + b"1 0 0 0\n", "more than its 30 points"),
        (zemax(VALUES) + b"", None),
        (zemax(VALUES).replace(b"0.001 ", b"0.00l "), "must be numbers"),
        (zemax(VALUES).replace(b"0.001 ", b"0.001 1 2 3 "), "7 values: must be z, 3 derivatives"),
        (zemax(VALUES).replace(b"6 5 ", b"60000 60000 ", 1), "at most"),
        (zemax(VALUES).replace(b"6 5 ", b"6000 5000 ", 1), "cut off or broken"),
        (zemax(VALUES, delx=float("nan")), "must be finite"),
        (zemax(VALUES * np.nan), "none of its 30 heights is valid"),
    ],
)
def test_broken_files(tmp_path, data, said):
    if said is None:
        read(tmp_path, data)
    else:
        assert said in refused(tmp_path, data)


def test_written_files_come_back_exactly(tmp_path):
    path = tmp_path / "a.dat"
    given = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.2), centre_mm=(3.0, -4.0))
    notes = write_zemax_grid(path, given)
    found = read_zemax_grid(path, MapOptions())
    np.testing.assert_array_equal(found.heights_mm, given.heights_mm)
    assert (found.pitch_mm, found.centre_mm) == (given.pitch_mm, given.centre_mm)
    assert "3 points without data have the flag" in notes[1]


def test_points_without_data_have_a_height_that_fits(tmp_path):
    """A reader that drops the flag must not find a step: the nearest valid height is there, not a zero."""
    path = tmp_path / "a.dat"
    write_zemax_grid(path, HeightMap(letter_map_nm() * 1e-6 + 5.0, (0.1, 0.1)))
    values = np.array([float(line.split()[0]) for line in path.read_text().splitlines()[1:]])
    assert values.min() > 5.0


def test_a_wavefront_is_written_as_its_surface(tmp_path):
    path = tmp_path / "a.dat"
    given = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.1), kind="wavefront")
    assert "half its height" in " ".join(write_zemax_grid(path, given))
    np.testing.assert_array_equal(read_zemax_grid(path, MapOptions()).heights_mm, given.heights_mm / 2)


def test_maps_that_are_refused(tmp_path):
    with pytest.raises(ValueError, match="needs a lateral scale"):
        write_zemax_grid(tmp_path / "a.dat", HeightMap(np.zeros((5, 5))))
    with pytest.raises(ValueError, match="at least 5 x 5"):
        write_zemax_grid(tmp_path / "a.dat", HeightMap(np.zeros((4, 5)), (0.1, 0.1)))
