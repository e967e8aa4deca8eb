"""Maps in FITS files: made byte by byte, by astropy, and by its own writer."""

import numpy as np
import pytest
from map_files import letter_map_nm
from picture_files import fits

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.map_fits import read_map_fits, write_map_fits

VALUES = np.array([[1.0, 2.0, 3.0], [np.nan, -5.0, 6.0]])  # the file's first row first: the bottom, by the standard


def read(folder, data, **options):
    path = folder / "a.fits"
    path.write_bytes(data)
    return read_map_fits(path, MapOptions(**options))


def card(key, value):
    return f"{key:8}= {value}"


NM = card("BUNIT", "'nm      '")
SURFACE = card("MAPKIND", "'SURFACE '")


def test_the_bottom_row_comes_first_unless_the_file_says_otherwise(tmp_path):
    found = read(tmp_path, fits(VALUES, -64, NM, SURFACE))
    np.testing.assert_allclose(found.heights_mm, VALUES * 1e-6, rtol=1e-15)
    top_down = read(tmp_path, fits(VALUES, -64, NM, SURFACE, card("ROWORDER", "'TOP-DOWN'")))
    np.testing.assert_allclose(top_down.heights_mm, VALUES[::-1] * 1e-6, rtol=1e-15)


def test_scaled_whole_numbers_and_blank(tmp_path):
    cards = (card("BZERO", "100.0"), card("BSCALE", "0.5"), card("BLANK", "-1"), NM, SURFACE)
    found = read(tmp_path, fits(np.array([[2, -1], [4, 6]]), 16, *cards))
    np.testing.assert_allclose(found.heights_mm, np.array([[101.0, np.nan], [102.0, 103.0]]) * 1e-6)


@pytest.mark.parametrize(("unit", "mm"), [("nm", 1e-6), ("um", 1e-3), ("mm", 1.0), ("m", 1e3), ("wave", 500e-6)])
def test_units_and_scale(tmp_path, unit, mm):
    cards = [card("BUNIT", f"'{unit:8}'"), card("WAVELEN", "500.0"), card("MAPKIND", "'WAVEFRONT'")]
    cards += [
        card("CUNIT1", "'um      '"),
        card("CUNIT2", "'mm      '"),
        card("CDELT1", "200.0"),
        card("CDELT2", "0.1"),
    ]
    found = read(tmp_path, fits(VALUES * 1e-3, -64, *cards))
    np.testing.assert_allclose(found.heights_mm, VALUES * 1e-3 * mm, rtol=1e-14)
    assert found.pitch_mm == pytest.approx((0.2, 0.1))
    assert (found.kind, found.wavelength_nm, found.centre_mm, found.warnings) == ("wavefront", 500.0, (0.0, 0.0), ())


def test_the_reference_pixel_gives_the_centre(tmp_path):
    cards = [NM, SURFACE, card("WAVELEN", "500.0")]
    for k, at, value in ((1, 1.0, 10.0), (2, 2.0, -3.0)):
        cards += [
            card(f"CUNIT{k}", "'mm      '"),
            card(f"CDELT{k}", "0.5"),
            card(f"CRPIX{k}", at),
            card(f"CRVAL{k}", value),
        ]
    x, y = read(tmp_path, fits(VALUES, -64, *cards)).positions_mm()
    assert (x[0, 0], y[1, 0]) == pytest.approx((10.0, -3.0))


def test_a_scale_on_the_sky_is_none(tmp_path):
    cards = (
        NM,
        card("CUNIT1", "'deg     '"),
        card("CUNIT2", "'deg     '"),
        card("CDELT1", "0.1"),
        card("CDELT2", "0.1"),
    )
    found = read(tmp_path, fits(VALUES, -64, *cards))
    assert found.pitch_mm is None
    assert found.warnings == (
        "the file tells no wavelength",
        "the file tells no lateral scale: give --pitch-mm",
        "the file does not tell surface from wavefront: taken as a surface",
    )


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (fits(VALUES, -64), "tells no unit of its heights: give --unit"),
        (fits(VALUES, -64, card("BUNIT", "'adu     '")), "BUNIT = 'adu': must be a length"),
        (fits(VALUES, -64, card("BUNIT", "'wave    '")), "heights in waves, and tells no wavelength"),
        (fits(VALUES, -64, NM, card("MAPKIND", "'OPD     '")), "MAPKIND = 'opd'"),
        (fits(np.stack([VALUES] * 2), -64, NM), "2 images: a map is one"),
        (fits(VALUES, -64, NM)[:2881], "cut off or broken"),
        (fits(np.full((2, 2), np.inf), -64, NM), "none of its 4 heights is valid"),
    ],
)
def test_broken_files(tmp_path, data, said):
    with pytest.raises(ValueError, match=".") as caught:
        read(tmp_path, data)
    assert str(caught.value).startswith(str(tmp_path / "a.fits")) and said in str(caught.value)


def test_infinite_heights_are_invalid(tmp_path):
    found = read(tmp_path, fits(np.array([[np.inf, 1.0]]), -64, NM, SURFACE))
    assert found.valid.tolist() == [[False, True]] and "1 infinite heights: taken as invalid" in found.warnings


@pytest.mark.parametrize("unit", ["mm", "nm"])
def test_written_files_come_back(tmp_path, unit):
    given = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.2), 632.8, "wavefront", (3.0, -4.0))
    path = tmp_path / "a.fits"
    assert write_map_fits(path, given, unit) == ()
    found = read_map_fits(path, MapOptions())
    np.testing.assert_allclose(found.heights_mm, given.heights_mm, rtol=3e-16)
    assert (found.pitch_mm, found.centre_mm, found.wavelength_nm) == (given.pitch_mm, given.centre_mm, 632.8)
    assert (found.kind, found.warnings) == ("wavefront", ())


def test_astropy_reads_what_is_written_and_is_read(tmp_path):
    from astropy.io import fits as astropy_fits

    path = tmp_path / "a.fits"
    write_map_fits(path, HeightMap(letter_map_nm() * 1e-6, (0.1, 0.2)), "nm")
    np.testing.assert_allclose(astropy_fits.getdata(path), letter_map_nm(), rtol=1e-15)
    image = astropy_fits.PrimaryHDU(VALUES.astype("f4"))
    image.header["BUNIT"] = "um"
    image.writeto(tmp_path / "b.fits")
    found = read_map_fits(tmp_path / "b.fits", MapOptions(kind="surface"))
    np.testing.assert_allclose(found.heights_mm, VALUES * 1e-3, rtol=1e-7)


@pytest.mark.parametrize(("number", "mm", "pitch"), [(1, 1e-6, 0.1), (2, 1e-6, 0.1), (3, 1e-3, 0.2)])
def test_each_image_has_the_units_of_its_own_header(tmp_path, number, mm, pitch):
    astropy = pytest.importorskip("astropy.io.fits")
    units = astropy.HDUList([astropy.PrimaryHDU(np.stack([VALUES, 2 * VALUES])), astropy.ImageHDU(3 * VALUES)])
    for unit, name, step in ((units[0], "nm", 0.1), (units[1], "um", 0.2)):
        unit.header.update(BUNIT=name, MAPKIND="SURFACE", CUNIT1="mm", CUNIT2="mm", CDELT1=step, CDELT2=step)
    units.writeto(tmp_path / "several.fits")
    found = read_map_fits(tmp_path / "several.fits", MapOptions(number=number))
    np.testing.assert_allclose(found.heights_mm, number * VALUES * mm, rtol=1e-15)
    assert found.pitch_mm == pytest.approx((pitch, pitch))
