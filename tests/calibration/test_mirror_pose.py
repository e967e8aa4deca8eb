"""A mirror's pose from its corners in a picture: given back where it is known."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.calibration.mirror_pose import MirrorPose, direction_of, expected_pose, pose_of_corners, projected
from irtscots_cl.calibration.poses import rotation
from irtscots_cl.optics.camera_model import CameraModel

MODEL = CameraModel((0.01, 0.0101), (80.0, 96.5), 6.9, distortion=(-0.14, 1.1, -3e-4, -1e-3, 0.0, 0.0, 0.0, 0.0))
SQUARE = np.array([[600.0, -600, 0], [-600, -600, 0], [-600, 600, 0], [600, 600, 0]])
SCREEN = np.array([4400.0, -60.0, -370.0])  # beside the camera and a little in front of it


def some_pose(tilt=(0.12, -0.2, 0.05), origin=(150.0, -300.0, -9700.0)):
    return MirrorPose(rotation(tilt), np.array(origin))


def test_points_are_projected_through_the_lens():
    """A point straight ahead is at the principal point; x goes to the right and y up, to higher rows upright."""
    places = projected(MODEL, np.array([[0.0, 0, -5000], [100, 0, -5000], [0, 100, -5000]]))
    np.testing.assert_allclose(places[0], (80.0, 96.5), atol=1e-12)
    assert places[1, 1] == pytest.approx(96.5 + 690 * 0.02, abs=0.1) and places[2, 0] > 90  # distortion: below 0.1
    way = direction_of(MODEL, *places[1])
    np.testing.assert_allclose(way / -way[2], [0.02, 0, -1], atol=1e-10)


def test_the_pose_of_known_corners_is_found():
    pose = some_pose()
    seen = projected(MODEL, pose.to_camera(SQUARE))
    start = expected_pose(direction_of(MODEL, *seen.mean(0)), SCREEN, 10_200.0)
    found, misfit = pose_of_corners(MODEL, SQUARE, seen, start)
    assert misfit < 1e-9
    np.testing.assert_allclose(found.axes, pose.axes, atol=1e-9)
    np.testing.assert_allclose(found.origin_mm, pose.origin_mm, rtol=0, atol=1e-5)  # mm at 10 m


def test_the_misfit_is_that_of_the_corners():
    pose = some_pose()
    seen = projected(MODEL, pose.to_camera(SQUARE))
    pull = 0.3 * np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]])  # no motion of a plane does this
    _, misfit = pose_of_corners(MODEL, SQUARE, seen + pull, pose)
    assert 0.1 < misfit < 0.3 * np.sqrt(2)


def test_the_expected_mirror_shows_the_screen_in_the_middle():
    way = direction_of(MODEL, 80.0, 96.5)
    pose = expected_pose(way, SCREEN, 10_200.0)
    assert np.linalg.norm(pose.origin_mm - SCREEN) == pytest.approx(10_200.0)
    normal = pose.axes[:, 2]
    reflected = way - 2 * (way @ normal) * normal
    np.testing.assert_allclose(np.cross(reflected, SCREEN - pose.origin_mm), 0, atol=1e-8)
    assert pose.axes[0, 0] > 0.9 and np.linalg.det(pose.axes) == pytest.approx(1)
    with pytest.raises(ValueError, match="the distance of 100 mm .* nothing that the camera sees .* 4415.9 mm"):
        expected_pose(way, SCREEN, 100.0)


def test_a_mirror_is_moved_to_its_distance():
    pose, point = some_pose(), np.array([100.0, 50.0, 3.0])
    before = np.linalg.norm(pose.to_camera(point) - SCREEN)
    moved = pose.at_distance(point, SCREEN, before + 40.0)
    assert np.linalg.norm(moved.to_camera(point) - SCREEN) == pytest.approx(before + 40.0)
    np.testing.assert_allclose(np.cross(moved.origin_mm, pose.origin_mm), 0, atol=1e-6)
    np.testing.assert_array_equal(moved.axes, pose.axes)
    with pytest.raises(ValueError, match="no place on the camera's line to the mirror has it"):
        pose.at_distance(point, SCREEN, 10.0)


def test_a_frame_is_turned_to_a_normal():
    pose, normal = some_pose(), np.array([0.003, -0.002, 1.0])
    turned = pose.turned_to(normal)
    np.testing.assert_allclose(turned.axes[:, 2], pose.axes @ normal / np.linalg.norm(normal), atol=1e-15)
    np.testing.assert_allclose(turned.axes @ turned.axes.T, np.eye(3), atol=1e-15)
    assert abs(turned.axes[:, 0] @ pose.axes[:, 1]) < 1e-5  # no turn about the normal itself, to second order
    np.testing.assert_allclose(turned.to_camera(turned.camera_mm), 0, atol=1e-11)  # rounding of 10 m
    assert pose.turned_to(np.array([0.0, 0.0, 2.0])) is pose
