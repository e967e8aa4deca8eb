"""A laboratory whose geometry is known, from its files: poses, screen shapes, mirrors."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from sofast_lab import COLUMNS, ROWS, Lab

from irtscots_cl.calibration.lab_scene import camera_of, lab_scene, mirror_start, places_of_fractions, screen_of
from irtscots_cl.calibration.outline import outline
from irtscots_cl.formats.sofast_setup import read_sofast_folder
from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.camera_model import CameraModel, camera_frame
from irtscots_cl.optics.screen_model import ScreenModel
from irtscots_cl.scene.presets import parse_scene

LAB = Lab(bend=0.004, sag=0.03)


@pytest.fixture(scope="module")
def seen():
    """The share of each pixel that sees the facet, and the fractions of the screen, upright [rows, columns]."""
    row, column = np.mgrid[:ROWS, :COLUMNS].astype(float)
    return LAB.coverage()[::-1], LAB.seen(column, row)[1][:, ::-1]


def read(folder: Path, lab=LAB, displays=("rectangular2D", "distorted3D")):
    lab.write_setup(folder, displays)
    return read_sofast_folder(folder)


def found_in(folder, seen, lab=LAB):
    share, fraction = seen
    given = lab.measured_distance() * 1e3, np.add(lab.measured, lab.centre) * 1e3
    start = mirror_start(folder, *given, share, share > 0.9)
    places = places_of_fractions(folder.display.size_mm, *fraction)
    return lab_scene(folder, start, *given, share > 0.9, *places, "a facet!")


def test_the_geometry_is_found(tmp_path, seen):
    lab = found_in(read(tmp_path), seen)
    scene = lab.scene
    assert scene.name == "a-facet"
    assert lab.start.misfit_px < 0.15
    # the file has the corners in a plane, the facet's are 3 mm higher than its middle
    assert abs(lab.start.distance_mm - LAB.measured_distance() * 1e3) < 6
    np.testing.assert_allclose(scene.camera.position_mm, LAB.camera_at * 1e3, rtol=0, atol=1.0)  # 1/20 pixel is 0.7 mm
    np.testing.assert_allclose(scene.screen.position_mm, LAB.screen_at * 1e3, rtol=0, atol=1.0)
    np.testing.assert_allclose(camera_frame(scene.camera).axes, LAB.camera_axes * [[1], [-1], [-1]], atol=1e-3)
    curvature = np.array([lab.curvature_xx, lab.curvature_yy, lab.curvature_xy]) * 1e3
    np.testing.assert_allclose(curvature, LAB.curvature, rtol=0, atol=1e-5)  # 1 um of height at the rim
    assert scene.mirror.radius_mm == pytest.approx(2e3 / (LAB.curvature[0] + LAB.curvature[1]), rel=1e-3)
    assert parse_scene(scene.to_toml()) == scene


def test_camera_and_screen_stand_as_in_the_orientation_file(tmp_path, seen):
    """What the mirror's pose cannot change: distance and angles between camera and screen."""
    scene = found_in(read(tmp_path), seen).scene
    apart = np.subtract(scene.screen.position_mm, scene.camera.position_mm)
    camera, screen = camera_frame(scene.camera).axes, ScreenModel.of(scene.screen).frame.axes
    flip = np.array([1, -1, -1])
    np.testing.assert_allclose(
        camera @ apart * flip / 1e3, LAB.camera_axes @ (LAB.screen_at - LAB.camera_at), atol=1e-12
    )
    expected = LAB.screen_axes @ LAB.camera_axes.T
    np.testing.assert_allclose(
        screen @ camera.T, expected * np.outer(flip, flip), atol=1e-9
    )  # 1e-7 degrees in the scene


def test_the_camera_sees_along_the_files_rays(tmp_path):
    folder = read(tmp_path)
    camera = camera_of(folder, Frame(np.zeros(3), np.eye(3)), 8000.0)
    row, column = np.mgrid[:ROWS:7, :COLUMNS:7].astype(float)
    x, y = CameraModel.of(camera).image_point(ROWS - 1 - row, column)
    way = LAB.directions(column, row) @ LAB.camera_axes.T
    np.testing.assert_allclose(x / camera.image_distance_mm, way[..., 0] / way[..., 2], atol=1e-12)
    np.testing.assert_allclose(y / camera.image_distance_mm, -way[..., 1] / way[..., 2], atol=1e-12)


@pytest.mark.parametrize("model", ["rectangular2D", "distorted2D", "distorted3D"])
def test_places_on_the_screen_are_those_of_the_display_file(tmp_path, model):
    lab = {"rectangular2D": Lab(), "distorted2D": Lab(bend=0.004), "distorted3D": LAB}[model]
    folder = read(tmp_path, lab, (model,))
    screen = screen_of(folder.display, Frame(np.array([0.0, 0.0, 900.0]), np.eye(3)), 900.0)
    nodes = np.meshgrid(np.linspace(0.005, 0.995, 9), np.linspace(0.01, 0.99, 9))
    model = ScreenModel.of(screen)
    points = model.to_world(*places_of_fractions(folder.display.size_mm, *nodes)) - [0, 0, 900]
    np.testing.assert_allclose(points * [1, -1, -1], lab.on_screen(*nodes) * 1e3, rtol=0, atol=1e-8)
    # between the points the file means straight lines: the middle of a cell's side is the mean of its ends
    at_x, at_y = (nodes[0][:, 1:] + nodes[0][:, :-1]) / 2, nodes[1][:, 1:]
    between = model.to_world(*places_of_fractions(folder.display.size_mm, at_x, at_y)) - [0, 0, 900]
    np.testing.assert_allclose(between, (points[:, 1:] + points[:, :-1]) / 2, rtol=0, atol=1e-8)


def test_a_facet_file_with_another_origin_is_the_same_mirror(tmp_path, seen):
    moved = dataclasses.replace(LAB, centre=(0.2, -0.1, 0.03))
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    one, other = found_in(read(tmp_path / "a"), seen), found_in(read(tmp_path / "b", moved), seen, moved)
    np.testing.assert_allclose(one.scene.camera.position_mm, other.scene.camera.position_mm, rtol=0, atol=1e-6)


def test_what_does_not_fit_is_refused(tmp_path, seen):
    folder = read(tmp_path)
    share, _ = seen
    given = 8400.0, np.zeros(3)
    with pytest.raises(ValueError, match="the camera's file is of pictures of 96 x 80, the measurement's have 80 x 96"):
        mirror_start(folder, *given, share.T, share.T > 0.9)
    with pytest.raises(
        ValueError, match="the distance of 10 mm between mirror and screen: nothing that the camera sees"
    ):
        mirror_start(folder, 10.0, np.zeros(3), share, share > 0.9)
    small = dataclasses.replace(folder.facet, corners_mm=folder.facet.corners_mm / 3)
    with pytest.raises(ValueError, match="the mirror's outline: side .* points of the edge near it"):
        mirror_start(dataclasses.replace(folder, facet=small), *given, share, share > 0.9)
    assert outline(share, share > 0.9).shape[1] == 2
