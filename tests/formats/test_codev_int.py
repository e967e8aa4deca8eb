"""CODE V's .int: grids and Zernike coefficients made from the format's description, and its own writers."""

import numpy as np
import pytest
from map_files import codev, letter_map_nm

from irtscots_cl.formats.codev_int import read_codev_int, write_codev_grid, write_codev_zernike
from irtscots_cl.formats.codev_zernike import DEFAULT_SAMPLES, Disk, term_nm, terms
from irtscots_cl.formats.height_map import HeightMap, MapOptions

VALUES = np.array([[1000, 2000, 3000], [-32768, -500, 0]])  # top row first
WANTED = np.array([[np.nan, -0.5, 0.0], [1.0, 2.0, 3.0]])  # waves


def read(folder, data, **options):
    path = folder / "a.int"
    path.write_bytes(data)
    return read_codev_int(path, MapOptions(**options))


def refused(folder, data, **options):
    with pytest.raises(ValueError, match=".") as caught:
        read(folder, data, **options)
    assert str(caught.value).startswith(f"{folder / 'a.int'}: ") and str(caught.value).isprintable()
    return str(caught.value)


@pytest.mark.parametrize("end", ["\r\n", "\n"])
@pytest.mark.parametrize("per_line", [1, 4, 10])
def test_grids(tmp_path, end, per_line):
    found = read(tmp_path, codev(VALUES, end=end, per_line=per_line, before=f"! a comment{end}! more{end}"))
    # times the wavelength: 632.8 nm a wave, not 1000 / 0.6328
    np.testing.assert_allclose(found.heights_mm, WANTED * 632.8e-6, rtol=1e-14)
    assert (found.kind, found.wavelength_nm) == ("surface", pytest.approx(632.8))
    assert found.pitch_mm is None and found.warnings == ("the file tells no lateral scale: give --pitch-mm",)


def test_wavefront_and_keywords_in_another_order(tmp_path):
    found = read(tmp_path, codev(VALUES, "wvl 0.5 ssz 500 wfr nda -32768 nnb"), pitch_mm=(0.1, 0.1))
    np.testing.assert_allclose(found.heights_mm, 2 * WANTED * 500e-6, rtol=1e-14)
    assert (found.kind, found.pitch_mm, found.warnings) == ("wavefront", (0.1, 0.1), ())


def test_missing_points_without_nda(tmp_path):
    found = read(tmp_path, codev(np.array([[32767, -32768, 5]]), "SUR WVL 0.6328 SSZ 1000"), pitch_mm=(1.0, 1.0))
    assert found.valid.tolist() == [[False, False, True]]
    assert found.warnings == ("the file has no NDA: 2 values of -32768 or 32767 are taken as missing",)
    given = read(tmp_path, codev(np.array([[32767, -32768, 5]]), "SUR WVL 0.6328 SSZ 1000 NDA 32767"))
    assert given.valid.tolist() == [[False, True, True]]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (codev(VALUES, "SUR SSZ 1"), "tells no wavelength"),
        (codev(VALUES, "FIL WVL 1 SSZ 1"), "FIL: no heights; must be SUR (surface) or WFR"),
        (codev(VALUES, "SUR WVL 1 SSZ 0"), "SSZ = 0"),
        (codev(VALUES, "SUR WVL nan SSZ 1"), "wavelength of nan nm"),
        (codev(VALUES, "SUR WVL x SSZ 1"), "WVL: 'X': must be a number"),
        (codev(VALUES, "SUR WVL 1 SSZ"), "SSZ: must be followed by 1 number"),
        (codev(VALUES, "SUR WVL 1 SSZ 1 ABC"), "ABC: a keyword that is not known"),
        (codev(VALUES)[:-12], "of its 6 values: cut off or broken"),
        (codev(VALUES) + b"1", "more than its 6 values"),
        (codev(VALUES).replace(b"2000", b"2e3x"), "'2e3x': must be a number"),
        (codev(VALUES).replace(b"GRD 3 2", b"GRD 60000 60000"), "must be at least 1 x 1, at most"),
        (codev(VALUES).replace(b"GRD 3 2", b"GRD 3000 2000"), "cut off or broken"),
        (codev(VALUES).replace(b"GRD 3 2", b"GRD 3 -2"), "GRD: -2: must be 1 to 65536"),
        (codev(VALUES).replace(b"GRD 3 2", b"GRD 3 " + b"9" * 5000), "must be 1 to 65536"),
        (b"title\nGRD 1 1 ZFR 2 SUR WVL 1 SSZ 1\n1", "must begin with GRD, ZFR or ZRN"),
        (b"title\nSUR WVL 1\n", "must begin with GRD, ZFR or ZRN"),
        (b"title\nZFR 999 SUR WVL 1 SSZ 1\n1", "more coefficients than the file can hold"),
        (b"title\nZFR 1 SUR WVL 1 SSZ 1\nnan", "not finite"),
    ],
)  # fmt: skip
def test_broken_files(tmp_path, data, said):
    assert said in refused(tmp_path, data)


def test_standard_terms_are_in_code_vs_order():
    order = [(0, 0), (1, 1), (1, -1), (2, 2), (2, 0), (2, -2), (3, 3), (3, 1), (3, -1), (3, -3), (4, 4), (4, 2)]
    assert [term_nm("ZRN", k) for k in range(1, 13)] == order
    fringe = [(0, 0), (1, 1), (1, -1), (2, 0), (2, 2), (2, -2), (3, 1), (3, -1), (4, 0)]
    assert [term_nm("ZFR", k) for k in range(1, 10)] == fringe


def test_terms_are_rim_polynomials():
    """Written out by hand, x = r cos t, y = r sin t."""
    x, y = np.array([0.3, -0.6, 0.1]), np.array([0.5, 0.2, -0.9])
    r2 = x * x + y * y
    fringe = [1 + 0 * x, x, y, 2 * r2 - 1, x * x - y * y, 2 * x * y, (3 * r2 - 2) * x, (3 * r2 - 2) * y]
    np.testing.assert_allclose(terms("ZFR", 8, x, y), fringe, atol=1e-14)
    np.testing.assert_allclose(terms("ZRN", 6, x, y)[3:], [fringe[4], fringe[3], fringe[5]], atol=1e-14)


def test_zernike_files_become_maps(tmp_path):
    lines = ["! made by hand", "title", "ZFR 4 WFR WVL 0.5 SSZ 2.0", "! comment", "0.5", "0.25 0", "-1.0"]
    found = read(tmp_path, "\n".join(lines).encode())
    n = DEFAULT_SAMPLES
    place = (np.arange(n) - (n - 1) / 2) / (n / 2)  # the rim on the outer edges of the outer pixels
    x, y = np.meshgrid(place, place)
    wanted = np.where(x * x + y * y <= 1, 0.5 + 0.25 * x - (2 * (x * x + y * y) - 1), np.nan) / 2 * 500e-6
    np.testing.assert_allclose(found.heights_mm, wanted, atol=1e-17)
    assert found.kind == "wavefront" and "4 Zernike coefficients (fringe)" in found.warnings[0]


@pytest.mark.parametrize("kind", ["surface", "wavefront"])
def test_written_grids_come_back_to_half_a_step(tmp_path, kind):
    heights = np.random.default_rng(1).normal(0, 1e-4, (7, 5))
    heights[2, 3] = np.nan
    path = tmp_path / "a.int"
    notes = write_codev_grid(path, HeightMap(heights, (0.1, 0.1), 632.8, kind))
    found = read_codev_int(path, MapOptions(pitch_mm=(0.1, 0.1)))
    step = np.nanmax(np.abs(heights)) / 32766
    assert 0.3 * step < np.nanmax(np.abs(found.heights_mm - heights)) <= 0.501 * step
    np.testing.assert_array_equal(found.valid, np.isfinite(heights))
    assert (found.kind, found.warnings) == (kind, ())
    assert f"{step * 1e6:.3g} nm" in notes[0]
    assert all(len(line) <= 80 for line in path.read_text().splitlines()) and b"\r\n" in path.read_bytes()
    # on the grid of steps it comes back exactly
    write_codev_grid(path, found)
    np.testing.assert_allclose(read_codev_int(path, MapOptions()).heights_mm, found.heights_mm, rtol=1e-12)


def test_written_flat_map_and_pixels_that_are_not_square(tmp_path):
    path = tmp_path / "a.int"
    write_codev_grid(path, HeightMap(np.zeros((2, 2)), None, 632.8))
    np.testing.assert_array_equal(read_codev_int(path, MapOptions()).heights_mm, 0.0)
    with pytest.raises(ValueError, match="not square"):
        write_codev_grid(path, HeightMap(np.zeros((2, 2)), (0.1, 0.2), 632.8))


@pytest.mark.parametrize("name", ["ZFR", "ZRN"])
def test_written_coefficients_are_those_of_the_map(tmp_path, name):
    """A map made of known terms on a disk that is neither in the middle nor the default one."""
    disk = Disk(20.0, 24.0, 22.0)
    rows, columns = np.mgrid[:48, :50]
    x, y = (columns - disk.column) / disk.radius, (rows - disk.row) / disk.radius
    coefficients = np.array([1.0, -0.5, 0.25, 0.1, 0.2, -0.3, 0.05])  # waves
    heights = np.tensordot(coefficients, terms(name, 7, x, y), 1) * 632.8e-6
    heights[x * x + y * y > 1] = np.nan
    path = tmp_path / "a.int"
    notes = write_codev_zernike(path, HeightMap(heights, None, 632.8), 7, name, disk)
    lines = path.read_text().splitlines()
    assert lines[2] == f"{name} 7 SUR WVL 0.6328 SSZ 1.0"
    np.testing.assert_allclose([float(line) for line in lines[3:]], coefficients, atol=1e-10)
    assert "radius 20 pixels about row 24, column 22" in notes[0]
    # the default disk holds the valid pixels whole: half a pixel more than their centres
    assert (
        "radius 20.5 pixels about row 24, column 22"
        in write_codev_zernike(path, HeightMap(heights, None, 632.8), 7, name)[0]
    )
    again = read_codev_int(path, MapOptions())
    assert np.nanmax(again.heights_mm) == pytest.approx(np.nanmax(heights), rel=0.1)


def test_zernike_fits_that_are_refused(tmp_path):
    heights = np.full((9, 9), np.nan)
    heights[4, 2:7] = 1e-6
    with pytest.raises(ValueError, match="5 pixels on the disk cannot separate 4 Zernike terms"):
        write_codev_zernike(tmp_path / "a.int", HeightMap(heights), 4)
    with pytest.raises(ValueError, match="0 Zernike terms: must be 1 to 120"):
        write_codev_zernike(tmp_path / "a.int", HeightMap(letter_map_nm() * 1e-6), 0)
    assert not list(tmp_path.iterdir())


def test_a_wavelength_in_other_units_is_warned_of(tmp_path):
    found = read(tmp_path, codev(np.arange(12).reshape(3, 4), "SUR WVL 632.8 SSZ 1000 NDA -32768"))
    assert "a wavelength of 632800 nm is unusual, and heights in waves go with it" in found.warnings
    usual = read(tmp_path, codev(np.arange(12).reshape(3, 4), "SUR WVL 10.6 SSZ 1000 NDA -32768"))
    assert not any("unusual" in text for text in usual.warnings)
