"""Maps in TIFF files: made byte by byte, and by its own writer."""

import numpy as np
import pytest
from map_files import letter_map_nm
from picture_files import COLUMNS, ROWS, tiff

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.map_tiff import read_map_tiff, write_map_tiff

FLOAT = 3  # SampleFormat


def read(folder, data, **options):
    path = folder / "a.tif"
    path.write_bytes(data)
    return read_map_tiff(path, MapOptions(**options))


@pytest.mark.parametrize(("kind", "bits"), [("f4", 32), ("f8", 64)])
def test_files_of_others_need_a_unit(tmp_path, kind, bits):
    data = tiff([letter_map_nm()[::-1].astype(f"<{kind}").tobytes()], bits, kind=FLOAT)
    with pytest.raises(ValueError, match="tells no unit of its heights: give --unit"):
        read(tmp_path, data)
    found = read(tmp_path, data, unit="nm", pitch_mm=(0.1, 0.1), kind="wavefront", wavelength_nm=500.0)
    np.testing.assert_allclose(found.heights_mm, letter_map_nm() * 1e-6, rtol=1e-7)
    assert (found.kind, found.warnings) == ("wavefront", ())
    waves = read(tmp_path, data, unit="wave", wavelength_nm=500.0)
    np.testing.assert_allclose(waves.heights_mm, letter_map_nm() * 500e-6, rtol=1e-7)


def test_the_orientation_tag_is_applied(tmp_path):
    data = tiff([letter_map_nm().astype("<f4").tobytes()], 32, kind=FLOAT, orientation=4)  # the bottom row first
    np.testing.assert_allclose(read(tmp_path, data, unit="nm").heights_mm, letter_map_nm() * 1e-6, rtol=1e-7)


def test_several_pages_are_no_map(tmp_path):
    page = np.zeros((ROWS, COLUMNS), "<f4").tobytes()
    with pytest.raises(ValueError, match="2 pages: a map is one"):
        read(tmp_path, tiff([page, page], 32, kind=FLOAT), unit="nm")


@pytest.mark.parametrize("unit", ["nm", "um"])
def test_written_files_come_back_to_32_bits(tmp_path, unit):
    heights = np.random.default_rng(1).normal(0, 1e-3, (7, 5))
    heights[2, 3] = np.nan
    given = HeightMap(heights, (0.1, 0.2), 632.8, "wavefront", (3.0, -4.0))
    path = tmp_path / "a.tif"
    write_map_tiff(path, given, unit)
    found = read_map_tiff(path, MapOptions())
    np.testing.assert_allclose(found.heights_mm, heights, rtol=6.1e-8)
    assert (found.pitch_mm, found.centre_mm, found.wavelength_nm) == (given.pitch_mm, given.centre_mm, 632.8)
    assert (found.kind, found.warnings) == ("wavefront", ())
    with pytest.raises(ValueError, match=f"heights in {unit}, told mm"):
        read_map_tiff(path, MapOptions(unit="mm"))


def test_pillow_sees_the_top_row_first(tmp_path):
    from PIL import Image

    path = tmp_path / "a.tif"
    write_map_tiff(path, HeightMap(letter_map_nm() * 1e-6))
    with Image.open(path) as image:
        np.testing.assert_allclose(np.asarray(image), letter_map_nm()[::-1], rtol=1e-6)


@pytest.mark.parametrize("text", ['{"irtscots_cl_map": 1, ', '["irtscots_cl_map"]', "[" * 5000 + "irtscots_cl_map"])
def test_a_broken_description_says_nothing(tmp_path, text):
    import tifffile

    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.ones((2, 2), "f4"), description=text, metadata=None)
    with pytest.raises(ValueError, match="tells no unit"):
        read_map_tiff(path, MapOptions())
