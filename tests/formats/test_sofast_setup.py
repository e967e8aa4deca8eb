"""SOFAST's files of a laboratory: small ones made here, whole and broken."""

from __future__ import annotations

import json
import shutil

import h5py
import numpy as np
import pytest
from sofast_lab import Lab

from irtscots_cl.formats.sofast_setup import (
    read_sofast_display,
    read_sofast_facet,
    read_sofast_folder,
    read_sofast_orientation,
)

MODELS = ("rectangular2D", "distorted2D", "distorted3D")


@pytest.fixture
def folder(tmp_path):
    Lab(sag=0.02).write_setup(tmp_path, MODELS)
    return tmp_path


def replaced(path, name, value):
    with h5py.File(path, "a") as file:
        if name in file:
            del file[name]
        if value is not None:
            file[name] = value
    return path


def test_a_folder_is_read_in_mm(folder):
    found = read_sofast_folder(folder)
    assert found.camera.image_size_px == (96, 80) and found.camera.name == "a camera"
    np.testing.assert_allclose(found.facet.corners_mm[:, :2], [[500, -500], [-500, -500], [-500, 500], [500, 500]])
    lab = Lab()
    seen = (lab.screen_at - lab.camera_at) @ lab.camera_axes.T
    np.testing.assert_allclose(found.orientation.screen_mm, 1e3 * seen, rtol=1e-12)
    assert found.response is None
    assert [path.name for path in found.displays] == [f"display_{model}.h5" for model in sorted(MODELS)]


def test_displays_are_points_or_a_rectangle(folder):
    flat, plane, space = (read_sofast_display(folder / f"display_{model}.h5") for model in MODELS)
    assert flat.size_mm == (5200.0, 3100.0) and len(flat.points_mm) == 0
    assert plane.size_mm == pytest.approx((5200, 3100)) and plane.points_mm.shape == (81, 3)
    assert not plane.points_mm[:, 2].any() and space.points_mm[:, 2].max() == pytest.approx(20 * 0.99**2)
    np.testing.assert_allclose(space.fractions.min(0), [0.005, 0.01])


def test_the_most_complete_display_is_taken_unless_another_is_named(folder):
    assert read_sofast_folder(folder).display.model == "distorted3D"
    named = folder / "display_rectangular2D.h5"
    found = read_sofast_folder(folder, named)
    assert (found.display.model, found.display_file) == ("rectangular2D", named)
    (folder / "display_distorted3D.h5").unlink()
    assert read_sofast_folder(folder).display.model == "distorted2D"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("screen_model", "cylinder", "screen_model: 'cylinder'; must be one of rectangular2D"),
        ("screen_x", -1.0, "screen_x: -1 x 3.1 m; must be above 0"),
        ("screen_x", np.zeros(2), r"screen_x: of shape \[2\]; must be one numbers"),
        ("screen_y", None, "screen_y: missing"),
    ],
)
def test_other_rectangles_are_refused(folder, name, value, message):
    path = replaced(folder / "display_rectangular2D.h5", f"DisplayShape/{name}", value)
    with pytest.raises(ValueError, match=message) as caught:
        read_sofast_display(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("xyz_screen_coords", np.zeros((2, 81)), r"xyz_screen_coords: of shape \[2, 81\]; must be 3xn numbers"),
        ("xyz_screen_coords", np.zeros((3, 80)), "xyz_screen_coords: 80 points for 81 fractions; must be as many"),
        ("xy_screen_fraction", np.zeros((2, 81)), "xy_screen_fraction: all on one line; must span an area"),
        ("xy_screen_fraction", np.full((2, 81), np.inf), "xy_screen_fraction: holds a value that is no finite number"),
        ("xyz_screen_coords", np.zeros((3, 5000)), r"xyz_screen_coords: of shape \[3, 5000\] .* must be 3xn numbers"),
    ],
)
def test_other_points_are_refused(folder, name, value, message):
    path = replaced(folder / "display_distorted3D.h5", f"DisplayShape/{name}", value)
    with pytest.raises(ValueError, match=message):
        read_sofast_display(path)


def test_other_orientations_are_refused(folder):
    path = replaced(folder / "orientation.h5", "SpatialOrientation/r_cam_screen", np.array([9.0, 0, 0]))
    with pytest.raises(ValueError, match="must be a rotation vector in rad"):
        read_sofast_orientation(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"v_facet_corners": {"x": [1, 2], "y": [1, 2], "z": [0, 0]}}, "v_facet_corners: 2 corners; must be 3 to 64"),
        ({"v_facet_corners": {"x": [1, 2, 3], "y": [1, 2], "z": [0, 0]}}, "must be a table of x, y, z: three arrays"),
        ({"v_facet_corners": {"x": [1, 2, "a"], "y": [1, 2, 3], "z": [0, 0, 0]}}, "must hold finite numbers"),
        ({"v_facet_corners": {"x": [1, 2, True], "y": [1, 2, 3], "z": [0, 0, 0]}}, "must hold finite numbers"),
        ({"v_centroid_facet": {"x": [0, 1], "y": [0, 1], "z": [0, 1]}}, "v_centroid_facet: 2 points; must be one"),
        ({"v_centroid_facet": [0, 0, 0]}, "v_centroid_facet: must be a table of x, y, z"),
    ],
)
def test_other_facets_are_refused(folder, change, message):
    path = folder / "facet.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ValueError, match=message) as caught:
        read_sofast_facet(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_a_facet_that_is_no_json_is_refused(folder):
    path = folder / "facet.json"
    for text in ('{"v_facet_corners": NaN', "[" * 100_000, "[1]"):
        path.write_text(text)
        with pytest.raises(ValueError, match="is not JSON of at most"):
            read_sofast_facet(path)


def test_a_folder_must_have_one_file_of_each_kind(folder, tmp_path_factory):
    shutil.copy(folder / "camera.h5", folder / "camera2.h5")
    with pytest.raises(ValueError, match=r"2 files of a camera: camera.h5, camera2.h5; must be one"):
        read_sofast_folder(folder)
    (folder / "camera2.h5").unlink()
    (folder / "facet.json").unlink()
    with pytest.raises(ValueError, match=r"no files of a facet \(JSON\); must be one"):
        read_sofast_folder(folder)
    with pytest.raises(ValueError, match="no files; must be a folder with the files of a SOFAST laboratory"):
        read_sofast_folder(tmp_path_factory.mktemp("empty"))


def test_values_of_other_files_are_not_read(folder):
    path = folder / "camera.h5"
    with h5py.File(path, "a") as file:
        del file["Camera/distortion_coef"]
        file["Camera/distortion_coef"] = h5py.ExternalLink("display_distorted3D.h5", "DisplayShape/xy_screen_fraction")
    with pytest.raises(ValueError, match="Camera/distortion_coef: its values are in another file; must be in this one"):
        read_sofast_folder(folder)
