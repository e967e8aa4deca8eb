"""A scene from the calibration files of a SOFAST laboratory and one measurement: where screen, camera and mirror are.

    folder = read_sofast_folder(path)
    start = mirror_start(folder, distance_mm, point_mm, signal, mask)
    lab = lab_scene(folder, start, distance_mm, point_mm, mask, u_mm, v_mm)
    lab.scene

All maps are upright: rows grow along the camera's y. The world is the mirror's frame: its origin at the facet's
centre, x and y those of the facet's file, z along the normal there. The files do not tell the camera's focal length and
pixels in mm, its aperture, or the screen's number of pixels: a scene needs them, PITCH_MM and the others stand for
them, and no slope depends on them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from irtscots_cl.calibration.mirror_pose import MirrorPose, direction_of, expected_pose, pose_of_corners, projected
from irtscots_cl.calibration.outline import outline, polygon_corners
from irtscots_cl.calibration.robust_plane import robust_plane
from irtscots_cl.formats.sofast_setup import SofastDisplay, SofastFolder
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.frame import Frame, aim_of
from irtscots_cl.measurement.surface_heights import triangulated
from irtscots_cl.optics.camera_model import CameraModel
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.camera_file import intrinsics_from
from irtscots_cl.scene.instrument import Camera, Detector, Orientation, Screen
from irtscots_cl.scene.mirror import Mirror
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.screen_shape import ScreenShape

UPRIGHT = np.diag([1.0, -1.0, -1.0])  # from the axes of OpenCV and of SOFAST's screen to a device's own
ORIENTATION: Orientation = "rows-reversed"  # of pictures as OpenCV stores them, the top row first
PITCH_MM, APERTURE_MM = 0.01, 1.0
SCREEN_COLUMNS = 1920
MARGIN = 1.02  # of the mirror's disk about the facet's corners: a pixel at a corner reaches over it
FLAT_MM = 1e12
ROUNDS, TURN_RAD = 50, 1e-11  # of turning the mirror to its normal


@dataclass(frozen=True)
class MirrorStart:
    """What the mirror's outline in the picture says. corners_px: [n, 2] (row, column) upright. misfit_px: rms distance
    of the facet's corners from them. distance_mm: between measured point and screen by the corners alone; pose: with
    the measured distance."""

    pose: MirrorPose
    corners_px: FloatArray
    misfit_px: float
    distance_mm: float


@dataclass(frozen=True)
class LabScene:
    """scene: the set-up with the mirror as a paraboloid. turn_rad: between the normal by the corners and by the slopes.
    curvature_xx, _yy, _xy: of the mirror, in 1/mm, by a plane through its slopes (xy: the mean of both)."""

    scene: Scene
    start: MirrorStart
    turn_rad: float
    curvature_xx: float
    curvature_yy: float
    curvature_xy: float
    pose: MirrorPose = field(repr=False)


def camera_of(folder: SofastFolder, frame: Frame, distance_mm: float) -> Camera:
    """The folder's camera in a frame, focused so far away. Raises ValueError if the file lacks its picture's size."""
    given = folder.camera
    if given.image_size_px is None:
        raise ValueError("the camera's file does not tell its picture's size")
    image_mm = given.fx * PITCH_MM
    place, look_at, turn = aim_of(frame, distance_mm)
    return Camera(
        position_mm=_point(place),
        look_at_mm=_point(look_at),
        aperture_diameter_mm=APERTURE_MM,
        focal_length_mm=float(1 / (1 / image_mm + 1 / distance_mm)),
        detector=Detector(pixels=given.image_size_px, pitch_mm=PITCH_MM, orientation=ORIENTATION),
        roll_deg=float(np.degrees(turn)),
        intrinsics=intrinsics_from(given),
    )


def screen_of(display: SofastDisplay, frame: Frame, distance_mm: float) -> Screen:
    """The display as a screen in a frame. Raises SceneError for points that fold over."""
    width, height = display.size_mm
    columns, rows = SCREEN_COLUMNS, max(round(SCREEN_COLUMNS * height / width), 2)
    # fractions run between the centres of the first and the last pixel
    pitch = (width / (columns - 1), height / (rows - 1))
    place, look_at, turn = aim_of(frame, distance_mm)
    shape = None
    if len(display.points_mm):
        fraction = np.column_stack([display.fractions[:, 0], 1 - display.fractions[:, 1]])
        count = np.array([columns, rows])
        on_edges = (fraction * (count - 1) + 0.5) / count
        points = display.points_mm @ UPRIGHT
        points = points if np.ptp(points[:, 2]) or points[0, 2] else points[:, :2]
        shape = ScreenShape(
            fractions=tuple(map(tuple, on_edges.tolist())),
            points_mm=tuple(map(tuple, points.tolist())),
            interpolation="linear",
        )
    return Screen(
        position_mm=_point(place),
        look_at_mm=_point(look_at),
        pixels=(columns, rows),
        pitch_mm=pitch,
        clocking_deg=float(np.degrees(turn)),
        shape=shape,
    )


def places_of_fractions(
    size_mm: tuple[float, float], fraction_x: FloatArray, fraction_y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Places (u, v) in mm on the grid of screen_of, of fractions (x, y) as display files have them: y grows downwards.

    size_mm: of the fractions from 0 to 1, which lie at the centres of the screen's outer pixels.
    """
    width, height = size_mm
    return (fraction_x - 0.5) * width, (0.5 - fraction_y) * height


def mirror_start(
    folder: SofastFolder, distance_mm: float, point_mm: FloatArray, signal: FloatArray, mask: BoolArray
) -> MirrorStart:
    """The mirror's pose from its outline. distance_mm: from the point [3] of the facet's file to the screen's origin.

    signal, mask: [rows, columns] upright, see outline. Raises ValueError where facet, camera and picture do not fit.
    """
    columns, rows = folder.camera.image_size_px or (0, 0)
    if mask.shape != (rows, columns):
        raise ValueError(f"the camera's file is of pictures of {columns} x {rows}, the measurement's have "
                         f"{mask.shape[1]} x {mask.shape[0]} pixels")  # fmt: skip
    model = CameraModel.of(camera_of(folder, Frame(np.zeros(3), np.eye(3)), distance_mm))
    screen_mm = UPRIGHT @ folder.orientation.screen_mm
    facet = folder.facet.corners_mm - folder.facet.centre_mm
    point = point_mm - folder.facet.centre_mm
    middle = [float(w.mean()) for w in np.nonzero(mask)]
    expected = expected_pose(direction_of(model, *middle), screen_mm, distance_mm)
    corners_px = _corners(model, outline(signal, mask), projected(model, expected.to_camera(facet)))
    pose, misfit = pose_of_corners(model, facet, corners_px, expected)
    found = float(np.linalg.norm(pose.to_camera(point) - screen_mm))
    return MirrorStart(pose.at_distance(point, screen_mm, distance_mm), corners_px, misfit, found)


def _corners(model: CameraModel, edge: FloatArray, expected: FloatArray) -> FloatArray:
    """Corners [n, 2] (row, column) in the picture; the sides are straight where the lens does not bend them."""

    def straight(places: FloatArray) -> FloatArray:
        x, y = model.image_point(places[:, 0], places[:, 1])
        return np.stack([y / model.pitch_mm[1], x / model.pitch_mm[0]], -1)

    y, x = (polygon_corners(straight(edge), straight(expected)) * model.pitch_mm[::-1]).T
    return np.stack(model.pixel(x, y), -1)


def lab_scene(
    folder: SofastFolder,
    start: MirrorStart,
    distance_mm: float,
    point_mm: FloatArray,
    mask: BoolArray,
    u_mm: FloatArray,
    v_mm: FloatArray,
    name: str = "",
) -> LabScene:
    """The scene of a measurement. u_mm, v_mm: [rows, columns] upright, places on the screen (places_of_fractions).

    The corners give the mirror's normal to some mrad, the slopes much better: the frame is turned until a plane through
    the slopes is level at the origin, and moved along the camera's line until the measured distance is right. The
    paraboloid's radius is that of the plane's mean curvature.
    """
    rows_columns, places = np.nonzero(mask), (u_mm[mask], v_mm[mask])
    screen_mm = UPRIGHT @ folder.orientation.screen_mm
    point = point_mm - folder.facet.centre_mm
    pose, curvature = start.pose, np.zeros(3)
    for _ in range(ROUNDS):
        scene = _scene(folder, pose, curvature, name)
        chief = ChiefRays(scene)
        at_x, at_y, at_z = chief.reverse(*rows_columns)[0].T
        slopes = triangulated(chief, at_x, at_y, at_z, *places)
        use = np.isfinite(at_z + slopes[0])
        (x, xx, xy), (y, yx, yy) = (robust_plane(at_x[use], at_y[use], slope[use]) for slope in slopes)
        curvature = np.array([xx, yy, (xy + yx) / 2])
        sag = (point[:2] ** 2 @ curvature[:2]) / 2 + point[0] * point[1] * curvature[2]
        measured = np.array([point[0], point[1], sag])
        pose = pose.turned_to(np.array([-x, -y, 1.0])).at_distance(measured, screen_mm, distance_mm)
        if np.hypot(x, y) < TURN_RAD:
            break
    else:
        raise ValueError(
            "the mirror's normal: no frame fits the slopes; facet, camera and screen contradict each other"
        )
    turn = float(np.arccos(np.clip(start.pose.axes[:, 2] @ pose.axes[:, 2], -1, 1)))
    c_xx, c_yy, c_xy = curvature.tolist()
    return LabScene(_scene(folder, pose, curvature, name), start, turn, c_xx, c_yy, c_xy, pose)


def _scene(folder: SofastFolder, pose: MirrorPose, curvature: FloatArray, name: str) -> Scene:
    """The scene of a mirror's pose and its curvatures xx, yy, xy in 1/mm."""
    camera_mm = pose.camera_mm
    away = float(np.linalg.norm(camera_mm))
    # the screen's axes in the camera's frame, then in the mirror's
    axes = UPRIGHT @ Rotation.from_rotvec(folder.orientation.rotation_vector).as_matrix() @ UPRIGHT @ pose.axes
    screen_mm = camera_mm + UPRIGHT @ folder.orientation.screen_mm @ pose.axes
    corners = folder.facet.corners_mm - folder.facet.centre_mm
    mean = float(curvature[:2].mean())
    return Scene(
        name=re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip(".-")[:64] or "facet",
        mirror=Mirror(
            radius_mm=1 / mean if abs(mean) * FLAT_MM > 1 else FLAT_MM,
            conic=-1.0,
            diameter_mm=float(2 * MARGIN * np.hypot(corners[:, 0], corners[:, 1]).max()),
        ),
        screen=screen_of(folder.display, Frame(screen_mm, axes), float(np.linalg.norm(screen_mm))),
        camera=camera_of(folder, Frame(camera_mm, pose.axes), away),
    )


def _point(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
