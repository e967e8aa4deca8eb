"""Maps as text: tables and lines of x, y, height, written by hand and by the package."""

import numpy as np
import pytest
from map_files import letter_map_nm

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.map_table import read_map_table, write_map_csv, write_map_xyz

GRID = "# unit = nm\n# pitch_mm = 1, 1\n# centre_mm = 0, 0\n"
TOP_FIRST = "# unit = nm\n# kind = surface\n# first_row = top\n"


def read(folder, text, **options):
    path = folder / "a.csv"
    path.write_bytes(text.encode())
    return read_map_table(path, MapOptions(**options))


def refused(folder, text, **options):
    with pytest.raises(ValueError, match=".") as caught:
        read(folder, text, **options)
    assert str(caught.value).startswith(f"{folder / 'a.csv'}: ") and str(caught.value).isprintable()
    return str(caught.value)


@pytest.mark.parametrize("mark", [",", ";", "\t", " ", ", "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_tables(tmp_path, mark, end):
    lines = [*TOP_FIRST.splitlines(), "", mark.join(["1", "2.5", "-3e1", "4"]), mark.join(["nan", "5", "6", "7"])]
    found = read(tmp_path, end.join(lines))
    np.testing.assert_allclose(found.heights_mm, np.array([[np.nan, 5, 6, 7], [1, 2.5, -30, 4]]) * 1e-6, rtol=1e-15)
    assert found.kind == "surface" and found.origin.startswith("CSV: ")


def test_missing_values(tmp_path):
    found = read(tmp_path, TOP_FIRST + "1,,Bad,4\n5,6,NaN,\n")
    assert found.valid[::-1].tolist() == [[True, False, False, True], [True, True, False, False]]
    assert read(tmp_path, TOP_FIRST + "1,2,\n3,4,\n").heights_mm.shape == (2, 2)  # separators at the lines' ends


def test_what_the_comments_say(tmp_path):
    said = "# unit = wave\n# wavelength_nm = 500\n# kind = wavefront\n# pitch_mm = 0.1, 0.2\n# centre_mm = 3, -4\n"
    found = read(tmp_path, said + "# first_row = bottom\n1,2\n3,4\n")
    np.testing.assert_allclose(found.heights_mm, np.array([[1, 2], [3, 4]]) * 500e-6)
    assert (found.pitch_mm, found.centre_mm, found.kind, found.warnings) == ((0.1, 0.2), (3, -4), "wavefront", ())


def test_row_order_is_a_warning_where_it_is_not_told(tmp_path):
    found = read(tmp_path, "1,2\n3,4\n", unit="um")
    np.testing.assert_allclose(found.heights_mm, np.array([[3, 4], [1, 2]]) * 1e-3)
    assert any("first row is taken as the top" in text for text in found.warnings)


def test_points(tmp_path):
    lines = ["# unit = um", "# kind = surface", "0.2 1 5", "0.1 1 4", "0.1 2 7", "0.2 2 8", "0.3 1 6"]
    found = read(tmp_path, "\n".join(lines))
    np.testing.assert_allclose(found.heights_mm, np.array([[4, 5, 6], [7, 8, np.nan]]) * 1e-3)
    assert found.pitch_mm == pytest.approx((0.1, 1.0)) and found.centre_mm == pytest.approx((0.2, 1.5))
    assert found.origin.startswith("XYZ: ")


def test_points_with_noise_on_their_places(tmp_path):
    rng = np.random.default_rng(1)
    y, x = (grid.ravel() * 0.5 for grid in np.mgrid[:20, :30])
    lines = [f"{a + rng.normal(0, 1e-6):.9f},{b:.9f},{a + 100 * b}" for a, b in zip(x, y, strict=True)]
    found = read(tmp_path, "# unit = nm\n" + "\n".join(lines))
    assert found.heights_mm.shape == (20, 30) and found.pitch_mm == pytest.approx((0.5, 0.5), rel=1e-5)
    np.testing.assert_allclose(found.heights_mm.ravel(), (x + 100 * y) * 1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# unit = nm\n", "holds no numbers"),
        ("1,2\n3,4\n", "tells no unit of its heights: give --unit"),
        ("# unit = furlong\n1,2\n", "unit = furlong: must be a length"),
        (TOP_FIRST + "1,2\n3\n", "line 5: 1 values; the first row has 2"),
        (TOP_FIRST + "1,2\n3,x\n", "line 5: 'x': must be a number"),
        (TOP_FIRST + "nan,nan\n", "none of its 2 heights is valid"),
        ("# unit = nm\n# first_row = left\n1,2\n", "first_row = left: must be top or bottom"),
        ("# unit = nm\n# kind = opd\n1,2\n", "kind = opd: must be surface or wavefront"),
        ("# unit = nm\n# pitch_mm = 1\n1,2\n", "pitch_mm = 1: must be 2 numbers"),
        ("# unit = nm\n0 0 1\n1 0 2\n0 1 3\n0 1 4\n", "the same place is there twice"),
        ("# unit = nm\n0 0 1\n1 0 2\n2.5 1 3\n3.7 2 4\n", "not on a grid of even steps"),
        ("# unit = nm\n0 0 1\n1 0 2\n2 0 3\n3 0 4\n", "all points have the same y"),
        ("# unit = nm\n0 nan 1\n1 0 2\n2 0 3\n3 0 4\n", "a place that is no finite number"),
        ("# unit = nm\n0 0 1\n1e9 1e9 2\n1 1 3\n2 2 4\n", "the same place is there twice"),
        (GRID + "# shape = 9e3, 9e3\n0 0 1\n1 0 2\n0 1 1\n1 1 1\n", "cut off"),
        (GRID + "# shape = 9e9, 9e9\n0 0 1\n1 0 2\n0 1 1\n1 1 1\n", "pitch_mm and shape must be above 0"),
    ],
)  # fmt: skip
def test_broken_files(tmp_path, text, said):
    assert said in refused(tmp_path, text)


@pytest.mark.parametrize("unit", ["nm", "mm"])
@pytest.mark.parametrize("writer", [write_map_csv, write_map_xyz])
def test_written_files_come_back(tmp_path, writer, unit):
    heights = letter_map_nm() * 1e-6
    heights[:, 0] = heights[0] = np.nan  # a whole column and row that an XYZ file leaves out
    given = HeightMap(heights, (0.1, 0.2), 632.8, "wavefront", (3.0, -4.0))
    path = tmp_path / "a.csv"
    assert writer(path, given, unit) == ()
    found = read_map_table(path, MapOptions())
    np.testing.assert_allclose(found.heights_mm, heights, rtol=3e-16)
    assert (found.pitch_mm, found.centre_mm) == (given.pitch_mm, given.centre_mm)
    assert (found.wavelength_nm, found.kind, found.warnings) == (632.8, "wavefront", ())


def test_a_table_of_three_columns_is_not_taken_for_points(tmp_path):
    path = tmp_path / "a.csv"
    given = HeightMap(np.arange(15.0).reshape(5, 3) * 1e-6)
    write_map_csv(path, given)
    np.testing.assert_allclose(read_map_table(path, MapOptions()).heights_mm, given.heights_mm)
    with pytest.raises(ValueError, match="needs a lateral scale"):
        write_map_xyz(path, given)


def test_numpy_reads_what_is_written(tmp_path):
    path = tmp_path / "a.csv"
    write_map_csv(path, HeightMap(letter_map_nm() * 1e-6))
    np.testing.assert_allclose(np.loadtxt(path, delimiter=",")[::-1], letter_map_nm())


def test_a_tables_numbering_is_no_height(tmp_path):
    """As pandas writes it: the first row and the first column count."""
    text = "# unit = nm\n,0,1,2\n0,1.5,2.5,3.5\n1,4.5,5.5,6.5\n"
    assert "its first row and column number the others" in refused(tmp_path, text)
    assert read(tmp_path, "# unit = nm\nnan,1,3\n1,4.5,5.5\n").heights_mm.shape == (2, 3)


def test_keys_in_other_spellings(tmp_path):
    found = read(tmp_path, "# Unit: um\n#KIND = Surface\n# First_Row: bottom\n1,2\n3,4\n")
    np.testing.assert_allclose(found.heights_mm, np.array([[1, 2], [3, 4]]) * 1e-3)
    found = read(tmp_path, "# unit = nm\n# pitch = 0.1, 0.1\n# a note: of no key\n1,2\n3,4\n")
    assert any("is not used: is pitch_mm meant?" in text for text in found.warnings)
    assert found.comment == ("pitch = 0.1, 0.1", "a note: of no key")


def test_comments_that_look_like_keys_stay_comments(tmp_path):
    given = HeightMap(np.zeros((4, 4)), (1.0, 1.0), comment=("kind = wavefront", "\u00b5m\nunit = mm"))
    assert given.comment == ("kind = wavefront", "?m?unit = mm")
    write_map_csv(tmp_path / "a.csv", given)
    found = read_map_table(tmp_path / "a.csv", MapOptions())
    assert (found.comment, found.kind) == (given.comment, "surface")


def test_the_comment_stays_the_same_however_often_points_are_written(tmp_path):
    found = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.1), comment=("of a letter",))
    for _ in range(2):
        write_map_xyz(tmp_path / "a.xyz", found)
        found = read_map_table(tmp_path / "a.xyz", MapOptions())
    assert found.comment == ("of a letter",)


def test_a_pitch_that_is_replaced_leaves_the_centre_and_says_so(tmp_path):
    text = "# unit = nm\n# kind = surface\n# wavelength_nm = 500\n# first_row = top\n# pitch_mm = 1, 1\n{}1,2\n3,4\n"
    for centre, said in (("# centre_mm = 5, -3\n", ", and its centre stays at 5, -3 mm"), ("", "")):
        found = read(tmp_path, text.format(centre), pitch_mm=(2.0, 2.0))
        assert found.warnings == (f"pitch of 2 x 2 mm as told; the file has 1 x 1{said}",)
