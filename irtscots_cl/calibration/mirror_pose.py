"""Where a mirror with known corners is in the camera's frame: from its picture and its distance from the screen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.camera_model import CameraModel


@dataclass(frozen=True)
class MirrorPose:
    """A point p of the mirror's frame is at axes p + origin_mm in the camera's: x right, y up, z backwards.

    axes: [3, 3]; its rows are the camera's axes in the mirror's frame. origin_mm: [3].
    """

    axes: FloatArray
    origin_mm: FloatArray

    def to_camera(self, points_mm: FloatArray) -> FloatArray:
        """Points [..., 3] of the mirror's frame in the camera's."""
        found: FloatArray = points_mm @ self.axes.T + self.origin_mm
        return found

    @property
    def camera_mm(self) -> FloatArray:
        """The camera in the mirror's frame [3]."""
        place: FloatArray = -self.origin_mm @ self.axes
        return place

    def at_distance(self, point_mm: FloatArray, screen_mm: FloatArray, distance_mm: float) -> MirrorPose:
        """The mirror moved along the line from the camera, until its point [3] has that distance from a point [3] of
        the camera's frame. Raises ValueError if no such move exists."""
        away = point_mm @ self.axes.T - screen_mm  # + k origin
        along = self.origin_mm
        a, b, c = along @ along, away @ along, away @ away - distance_mm**2
        root = b * b - a * c
        if root < 0:
            raise ValueError(
                f"the distance of {distance_mm:g} mm between mirror and screen: no place on the camera's line to the "
                "mirror has it"
            )
        steps = (-b + np.array([1.0, -1.0]) * np.sqrt(root)) / a
        return MirrorPose(self.axes, along * steps[np.argmin(np.abs(steps - 1))])

    def turned_to(self, normal: FloatArray) -> MirrorPose:
        """The same place with a new frame about the mirror's origin; its z is a direction [3] of the present frame."""
        z = normal / np.linalg.norm(normal)
        axis = np.cross(z, [0.0, 0.0, 1.0])
        sine = np.linalg.norm(axis)
        if sine == 0.0:
            return self
        turn = Rotation.from_rotvec(axis / sine * np.arctan2(sine, z[2])).as_matrix()
        return MirrorPose(self.axes @ turn.T, self.origin_mm)


def direction_of(model: CameraModel, row: float, column: float) -> FloatArray:
    """Unit vector [3] of the camera's frame from which a place in the picture gets its light."""
    x, y = model.image_point(np.array([row]), np.array([column]))
    way = np.array([float(x[0]), float(y[0]), -model.image_distance_mm])
    unit: FloatArray = way / np.linalg.norm(way)
    return unit


def projected(model: CameraModel, points_mm: FloatArray) -> FloatArray:
    """Places [n, 2] (row, column) of points [n, 3] of the camera's frame in the picture."""
    scale = model.image_distance_mm / -points_mm[:, 2]
    return np.stack(model.pixel(points_mm[:, 0] * scale, points_mm[:, 1] * scale), -1)


def expected_pose(direction: FloatArray, screen_mm: FloatArray, distance_mm: float) -> MirrorPose:
    """The pose of a mirror in a direction [3] from the camera, that shows it the screen's origin [3] from a distance.

    Its x is as near to the camera's as the normal allows. Raises ValueError if nothing in that direction has the
    distance from the screen.
    """
    near = direction @ screen_mm
    root = near**2 - screen_mm @ screen_mm + distance_mm**2
    if root < 0 or near + np.sqrt(root) <= 0:
        raise ValueError(
            f"the distance of {distance_mm:g} mm between mirror and screen: nothing that the camera sees in the "
            f"mirror's direction has it from the screen, {np.linalg.norm(screen_mm):.5g} mm from the camera"
        )
    origin = direction * (near + np.sqrt(root))
    to_screen = (screen_mm - origin) / np.linalg.norm(screen_mm - origin)
    z = to_screen - direction
    z /= np.linalg.norm(z)
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x /= np.linalg.norm(x)
    return MirrorPose(np.stack([x, np.cross(z, x), z], -1), origin)


def pose_of_corners(
    model: CameraModel, corners_mm: FloatArray, corners_px: FloatArray, start: MirrorPose
) -> tuple[MirrorPose, float]:
    """The pose that puts the corners [n, 3] of the mirror's frame at places [n, 2] (row, column) of the picture best.

    Least squares from a start. Returns the pose and the rms distance in pixels that is left.
    """
    size = np.linalg.norm(start.origin_mm)

    def pose(unknowns: FloatArray) -> MirrorPose:
        turn = Rotation.from_rotvec(unknowns[:3]).as_matrix()
        return MirrorPose(turn @ start.axes, start.origin_mm + unknowns[3:] * size)

    def misfit(unknowns: FloatArray) -> FloatArray:
        found: FloatArray = (projected(model, pose(unknowns).to_camera(corners_mm)) - corners_px).ravel()
        return found

    found = least_squares(misfit, np.zeros(6), method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return pose(found.x), float(np.sqrt(2 * found.cost / len(corners_px)))
