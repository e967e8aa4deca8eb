"""The deviation of a result.h5 as a map on an even grid."""

import random
import re

import h5py
import numpy as np
import pytest
from broken_maps import broken, outcome

from irtscots_cl.formats.height_map import MapOptions
from irtscots_cl.formats.maps import open_map
from irtscots_cl.formats.result_map import QUANTITIES, is_result, read_result_map

PITCH = 2.0


def deviation_nm(x, y):
    """Something smooth that no turn leaves as it is: waves of 60 and 90 mm."""
    return 20 * np.sin(2 * np.pi * x / 60) + 10 * np.cos(2 * np.pi * (y + 0.3 * x) / 90) + 0.1 * x


def pixels(n=51):
    """Mirror points of a camera that looks from the side: sheared, and 3 % of pincushion."""
    column, row = np.meshgrid(np.arange(n) - (n - 1) / 2, np.arange(n) - (n - 1) / 2)
    bent = 1 + 0.03 * (row**2 + column**2) / (n / 2) ** 2
    x, y = PITCH * column * bent + 5.0, PITCH * (row + 0.05 * column) * bent - 3.0
    inside = np.hypot(x - 5, y + 3) < 48
    return np.where(inside, x, np.nan), np.where(inside, y, np.nan)


def written(path, x, y, heights, turn=lambda a: a):
    with h5py.File(path, "w") as file:
        file["mirror/x_mm"], file["mirror/y_mm"], file["deviation_nm"] = turn(x), turn(y), turn(heights)
    return path


@pytest.mark.parametrize("turn", [lambda a: a, lambda a: a[::-1], lambda a: a.T[:, ::-1]])
def test_heights_are_those_at_the_grids_places(tmp_path, turn):
    """However the images lie: places come from the mirror points."""
    x, y = pixels()
    path = written(tmp_path / "result.h5", x, y, deviation_nm(x, y), turn)
    found = open_map(path)
    assert found.pitch_mm[0] == found.pitch_mm[1] == pytest.approx(PITCH, rel=0.05)
    wanted = deviation_nm(*found.positions_mm())
    error_nm = found.heights_mm * 1e6 - wanted
    assert np.sqrt(np.nanmean(error_nm**2)) < 0.01  # nm, of 15.5 nm rms; it is 0.006
    assert found.valid.sum() == pytest.approx(np.pi * 48**2 / found.pitch_mm[0] ** 2, rel=0.03)
    assert found.kind == "surface" and "interpolated from" in found.warnings[0]


def test_holes_stay_holes(tmp_path):
    x, y = pixels()
    heights = deviation_nm(x, y)
    heights[np.hypot(x - 5, y + 3) < 10] = np.nan
    found = read_result_map(written(tmp_path / "a.h5", x, y, heights), MapOptions())
    grid_x, grid_y = found.positions_mm()
    radius = np.hypot(grid_x - 5, grid_y + 3)
    assert not found.valid[radius < 8].any() and found.valid[(radius > 12) & (radius < 44)].all()


def test_what_is_no_result(tmp_path):
    path = tmp_path / "a.h5"
    x, y = pixels(9)
    for change, said in (
        (lambda f: f.__delitem__("mirror/x_mm"), "mirror/x_mm: missing"),
        (lambda f: f.__setitem__("mirror/z", 1), None),
        (
            lambda f: (f.__delitem__("mirror/y_mm"), f.__setitem__("mirror/y_mm", np.zeros((2, 2)))),
            "must be of one size",
        ),
        (lambda f: f["deviation_nm"].__setitem__(..., np.nan), "0 valid pixels: too few for a map"),
        (lambda f: f["mirror/x_mm"].__setitem__((0, 0), 1e12), "must be at least 1 x 1, at most"),
    ):
        written(path, np.nan_to_num(x), np.nan_to_num(y), deviation_nm(x, y) * 0)
        with h5py.File(path, "r+") as file:
            change(file)
            if said and "at most" in said:
                file["deviation_nm"][...] = 0.0
        if said is None:
            continue
        with pytest.raises(ValueError, match=".") as caught:
            read_result_map(path, MapOptions())
        assert said in str(caught.value) and str(caught.value).startswith(f"{path}: ")
    assert is_result(path)
    with h5py.File(path, "w") as file:
        file["deviation_nm"] = h5py.ExternalLink("/etc/passwd", "x")
    assert not is_result(path) and not is_result(tmp_path / "none.h5")


def test_broken_files_give_one_line(tmp_path):
    x, y = pixels(15)
    path = written(tmp_path / "a.h5", x, y, deviation_nm(x, y))
    open_map(path)  # what the libraries take at import is no file's memory
    data = path.read_bytes()
    results = [outcome(path, broken(data, random.Random(number)), MapOptions()) for number in range(100)]
    assert 20 < sum(result != "read" for result in results) < 100


def test_the_error_does_not_depend_on_the_unit_of_the_heights(tmp_path):
    """Clough and Tocher's gradients have a tolerance that is absolute for small numbers, such as heights in mm."""
    x, y = pixels()
    errors = []
    for scale in (1.0, 1e-6, 1e6):
        found = open_map(written(tmp_path / "a.h5", x, y, deviation_nm(x, y) * scale))
        errors.append(np.nanstd(found.heights_mm * 1e6 / scale - deviation_nm(*found.positions_mm())))
    assert max(errors) < 0.006 and np.ptp(errors) < 1e-6  # nm


def test_a_sphere_is_interpolated_as_well_as_its_deviation(tmp_path):
    """A polynomial takes the low orders, which cubics alone get wrong by far more than the deviation."""
    x, y = pixels()
    path = written(tmp_path / "a.h5", x, y, deviation_nm(x, y))
    with h5py.File(path, "r+") as file:
        file["height_mm"] = deviation_nm(x, y) * 1e-6 + (x**2 + y**2) / 2000
        file["height_standard_error_nm"] = np.where(np.isfinite(x), 0.5 + x / 100, np.nan)
    found = open_map(path, MapOptions(quantity="height"))
    grid_x, grid_y = found.positions_mm()
    wanted = deviation_nm(grid_x, grid_y) * 1e-6 + (grid_x**2 + grid_y**2) / 2000
    assert np.nanstd(found.heights_mm - wanted) < 6e-9
    error = open_map(path, MapOptions(quantity="standard-error"))
    np.testing.assert_allclose(error.heights_mm[error.valid] * 1e6, (0.5 + grid_x / 100)[error.valid], atol=1e-9)
    assert "Surface" in found.comment[0] and "Standard error" in error.comment[0]


def test_the_stated_limit_holds_and_is_not_far_off(tmp_path):
    x, y = pixels()
    found = open_map(written(tmp_path / "a.h5", x, y, deviation_nm(x, y)))
    stated = float(re.search(r"come back to (\S+) nm rms", found.warnings[0]).group(1))
    error = np.nanstd(found.heights_mm * 1e6 - deviation_nm(*found.positions_mm()))
    assert error < stated < 20 * error


def test_only_the_largest_group_of_islands_is_in_the_map(tmp_path):
    x, y = pixels()
    heights = deviation_nm(x, y)
    path = written(tmp_path / "a.h5", x, y, heights)
    with h5py.File(path, "r+") as file:
        file["island_groups"] = np.where(np.isfinite(x), np.where(x > 30, 2, 1), 0)
    found = open_map(path)
    assert "pixels of other islands, of unknown piston, are left out" in found.warnings[0]
    assert not found.valid[found.positions_mm()[0] > 33].any()


def test_comments_fit_where_formats_are_short():
    assert all(len(text) <= 81 and text.isascii() for _, _, text in QUANTITIES.values())  # MetroPro has 82 bytes
