"""SOFAST's measurement files: small ones made here, whole and broken."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from irtscots_cl.formats.sofast import is_sofast_measurement, read_sofast_measurement, read_sofast_response
from irtscots_cl.imaging.sofast_fringes import sofast_fringes
from irtscots_cl.measurement.screen_coordinates import screen_coordinates

GROUP = "MeasurementSofastFringe"
ROWS, COLUMNS = 40, 50
PERIODS_X, PERIODS_Y = (0.9, 3.9, 15.9), (0.9, 7.9)
SCREEN = (1920, 1080)  # pixels


def places():
    """What SOFAST calls the screen fractions x, y of the pixels, and where the mirror is."""
    row, column = np.mgrid[:ROWS, :COLUMNS]
    return 0.2 + 0.01 * column, 0.15 + 0.015 * row, np.hypot(row - 20, column - 25) < 18


def projected(periods, step, axis):
    """A picture's own values along x (columns) or y (rows), as SOFAST projects it: cos of a phase that falls from the
    first to the last pixel."""
    pixels = SCREEN["xy".index(axis)]
    return 0.5 + 0.5 * np.cos(2 * np.pi * periods * np.linspace(1, 0, pixels) - step * np.pi / 2)


def images():
    """Frames [rows, columns, frames] as a camera sees the projected pictures in the mirror."""
    x, y, mirror = places()
    at_column, at_row = (1 - x) * (SCREEN[0] - 1), y * (SCREEN[1] - 1)  # of the projected picture
    frames = []
    for axis, many, at in (("y", PERIODS_Y, at_row), ("x", PERIODS_X, at_column)):
        for periods in many:
            for step in range(4):
                picture = projected(periods, step, axis)
                frames.append(np.interp(at, np.arange(len(picture)), picture))
    noise = np.random.default_rng(1).normal(size=(ROWS, COLUMNS, len(frames)))
    return np.clip(np.rint(4 + 200 * np.where(mirror[..., None], np.stack(frames, -1), 0) + noise), 0, 255).astype("u1")


def write(path, older=False, **changes):
    _, _, mirror = places()
    white = np.stack([np.full((ROWS, COLUMNS), 4), np.where(mirror, 204, 4)], -1).astype(np.uint8)
    parts = {
        "fringe_images": images(),
        "mask_images": white,
        "fringe_periods_x": np.array(PERIODS_X),
        "fringe_periods_y": np.array(PERIODS_Y),
        "optic_screen_dist" if older else "dist_optic_screen": 10.25,
        "measure_point" if older else "v_measure_point_facet": np.array([0.1, 0.0, -0.2]),
        "name": "a facet",
        "date": "2023-01-13T11:30:05",
    } | changes
    with h5py.File(path, "w") as file:
        for name, value in parts.items():
            if value is not None:
                file[f"{GROUP}/{name}"] = value
    return path


@pytest.mark.parametrize("older", [False, True], ids=["newer names", "older names"])
def test_a_file_is_read_with_its_units(tmp_path, older):
    path = write(tmp_path / "a.h5", older)
    assert is_sofast_measurement(path)
    found = read_sofast_measurement(path)
    np.testing.assert_array_equal(found.frames, np.moveaxis(images(), -1, 0))
    assert found.frames.dtype == np.uint8 and found.dark.max() == 4 and found.white.max() == 204
    assert (found.periods_x, found.periods_y) == (PERIODS_X, PERIODS_Y)
    assert found.screen_distance_mm == pytest.approx(10_250)
    np.testing.assert_allclose(found.point_mm, [100, 0, -200])
    assert (found.name, found.date) == ("a facet", "2023-01-13T11:30:05")


def test_screen_fractions_are_those_of_sofast(tmp_path):
    """x grows to the left and y down on the projected picture, from centre to centre of its outermost pixels."""
    x, y, mirror = places()
    found = screen_coordinates(sofast_fringes(read_sofast_measurement(write(tmp_path / "a.h5"))))
    np.testing.assert_array_equal(found.mask, mirror)
    assert found.notes == ()
    for axis, place, limit in ((found.x, x, 1e-3), (found.y, y, 2e-3)):
        error = (axis.fraction - place)[mirror]
        assert np.abs(error).max() < limit
        pulls = error / axis.standard_error[mirror]
        assert 0.7 < pulls.var() < 1.3 and abs(pulls.mean()) < 0.2  # 1000 pixels: chance of failure below 1e-6


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fringe_images": None}, "fringe_images: missing; a SOFAST file has it"),
        ({"fringe_images": images()[..., :19]}, "fringe_images: 19 frames; must be 4 for each of the 5 numbers of per"),
        ({"fringe_images": images()[..., 0]}, r"fringe_images: of shape \[40, 50\] and type uint8; must be images"),
        ({"fringe_images": images() * 1j}, "fringe_images: of shape .* and type complex128; must be images"),
        ({"mask_images": np.zeros((ROWS, COLUMNS, 3), np.uint8)}, r"shape \[40, 50, 3\]; must be \[40, 50, 2\]"),
        ({"fringe_periods_x": np.array([0.9, 0.0, 4.0])}, r"fringe_periods_x: \[0.9, 0.0, 4.0\]; must be above 0"),
        ({"fringe_periods_y": np.array([0.9, np.nan])}, "fringe_periods_y: holds a value that is no finite number"),
        ({"fringe_periods_y": np.ones(65)}, "fringe_periods_y: of shape .* must be 1 to 64 numbers"),
        ({"dist_optic_screen": None}, "dist_optic_screen: missing"),
        ({"dist_optic_screen": "far"}, "dist_optic_screen: of shape .* must be 1 to 1 numbers"),
        ({"v_measure_point_facet": np.zeros(2)}, "v_measure_point_facet: 2 numbers; must be 3"),
    ],
)
def test_files_of_another_form_are_refused(tmp_path, changes, message):
    path = write(tmp_path / "a.h5", **changes)
    with pytest.raises(ValueError, match=message) as caught:
        read_sofast_measurement(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_claimed_images_that_the_file_does_not_hold_are_refused(tmp_path):
    path = write(tmp_path / "a.h5", fringe_images=None)
    with h5py.File(path, "a") as file:  # 80 GB that were never written
        file.create_dataset(f"{GROUP}/fringe_images", (100_000, 40_000, 20), "u1", chunks=(100, 100, 20))
    with pytest.raises(ValueError, match="= 80000000000 bytes of images, of which the file holds 0"):
        read_sofast_measurement(path)


def test_values_in_other_files_are_refused(tmp_path):
    other = write(tmp_path / "b.h5")
    path = write(tmp_path / "a.h5", fringe_images=None)
    with h5py.File(path, "a") as file:
        file[f"{GROUP}/fringe_images"] = h5py.ExternalLink(other.name, f"{GROUP}/fringe_images")
    with pytest.raises(ValueError, match="fringe_images: its values are in another file; must be in this one"):
        read_sofast_measurement(path)


def test_what_is_no_hdf5_file_is_refused(tmp_path):
    (tmp_path / "a.h5").write_text("no")
    for path, message in (
        (tmp_path / "a.h5", "not a readable HDF5 file"),
        (tmp_path / "none.h5", "there is no file of that name"),
        (tmp_path, "it is a folder"),
    ):
        assert not is_sofast_measurement(path)
        with pytest.raises(ValueError, match=message):
            read_sofast_measurement(path)
    whole = write(tmp_path / "c.h5").read_bytes()
    cut = tmp_path / "d.h5"
    cut.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="d.h5: ") as caught:
        read_sofast_measurement(cut)
    assert "\n" not in str(caught.value)


def test_a_response_table_is_read(tmp_path):
    path = tmp_path / "r.h5"
    with h5py.File(path, "w") as file:
        file["ImageCalibration/display_values"] = np.arange(0, 256, 51)
        file["ImageCalibration/camera_values"] = np.arange(6.0) ** 2
    found = read_sofast_response(path)
    np.testing.assert_array_equal(found.shown, np.arange(0, 256, 51))
    np.testing.assert_array_equal(found.camera, np.arange(6.0) ** 2)
    with h5py.File(path, "a") as file:
        del file["ImageCalibration/camera_values"]
        file["ImageCalibration/camera_values"] = np.arange(5.0)
    with pytest.raises(ValueError, match="display_values has 6 values, camera_values 5; must be equal"):
        read_sofast_response(path)
