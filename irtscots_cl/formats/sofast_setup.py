"""A SOFAST laboratory's files (OpenCSP, Sandia National Laboratories): display, spatial orientation, facet; a folder.

Lengths in the files are metres. The camera's frame is OpenCV's: x to the right and y down in the picture, z away from
the camera. The screen's frame has x and y along the screen and z towards the optic: nearly parallel to the camera's.
The display file says where the fractions (x, y) of the shown picture lie in the screen's frame, between the points
linearly. The spatial orientation takes camera coordinates c to screen coordinates s:

    s = R (c - t)      R: the rotation vector r_cam_screen, t: v_cam_screen_cam, the screen's origin seen by the camera

The facet's frame has its z axis out of the optic's front.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.hdf5 import GroupReader, groups_of, is_hdf5, opened
from irtscots_cl.formats.opencv_camera import GROUP as CAMERA
from irtscots_cl.formats.opencv_camera import OpenCvCamera, read_sofast_camera
from irtscots_cl.maths.arrays import FloatArray

MM = 1e3  # in a metre
DISPLAY, ORIENTATION, RESPONSE = "DisplayShape", "SpatialOrientation", "ImageCalibration"
POINTS = {"distorted2D": ("xy_screen_coords", 2), "distorted3D": ("xyz_screen_coords", 3)}
MODELS = ("rectangular2D", *POINTS)  # of displays, the more complete ones last
MAX_POINTS = 4096
MAX_CORNERS = 64
MAX_JSON = 2**20
MAX_FILES = 1000  # of a folder


@dataclass(frozen=True)
class SofastDisplay:
    """model: of MODELS. size_mm: (x, y) of the fractions from 0 to 1: the file's, or that of a straight line through
    the points. fractions: [n, 2] and points_mm: [n, 3] in the screen's frame; none of a rectangle."""

    model: str
    name: str
    size_mm: tuple[float, float]
    fractions: FloatArray = field(repr=False)
    points_mm: FloatArray = field(repr=False)


@dataclass(frozen=True)
class SofastOrientation:
    """rotation_vector: [3] rad, from camera to screen coordinates. screen_mm: [3] the screen's origin, in the camera's
    frame."""

    rotation_vector: FloatArray
    screen_mm: FloatArray


@dataclass(frozen=True)
class SofastFacet:
    """corners_mm: [n, 3] along the outline, counter-clockwise or clockwise. centre_mm: [3]. In the facet's frame."""

    corners_mm: FloatArray
    centre_mm: FloatArray


@dataclass(frozen=True)
class SofastFolder:
    """The files of a folder, and what they hold. response: the file of the table of screen and camera, if any.
    displays: all display files of the folder; display_file: the one that was read."""

    camera: OpenCvCamera
    display: SofastDisplay
    orientation: SofastOrientation
    facet: SofastFacet
    display_file: Path
    displays: tuple[Path, ...]
    response: Path | None


def read_sofast_display(path: Path) -> SofastDisplay:
    """Read a display. Raises ValueError, with one line that names file and key, for one that has another form."""
    with opened(path) as file:
        read = GroupReader(file, path, DISPLAY)
        model, name = read.text("screen_model"), read.text("name")
        if model not in MODELS:
            raise read.problem("screen_model", f"{model!r}; must be one of {', '.join(MODELS)}")
        if model not in POINTS:
            width, height = (float(read.numbers(key)) * MM for key in ("screen_x", "screen_y"))
            if not (width > 0 and height > 0):
                raise read.problem("screen_x", f"{width / MM:g} x {height / MM:g} m; must be above 0")
            return SofastDisplay(model, name, (width, height), np.zeros((0, 2)), np.zeros((0, 3)))
        key, axes = POINTS[model]
        fractions = read.numbers("xy_screen_fraction", 2, None, most=2 * MAX_POINTS).T
        points = read.numbers(key, axes, None, most=axes * MAX_POINTS).T * MM
        if len(fractions) != len(points) or len(points) < 4:
            raise read.problem(key, f"{len(points)} points for {len(fractions)} fractions; must be as many, 4 or more")
        if not (np.ptp(fractions, axis=0) > 0).all():
            raise read.problem("xy_screen_fraction", "all on one line; must span an area")
    points = np.column_stack([points, np.zeros((len(points), 3 - axes))])
    width, height = (abs(float(np.polyfit(fractions[:, k], points[:, k], 1)[0])) for k in (0, 1))
    return SofastDisplay(model, name, (width, height), fractions, points)


def read_sofast_orientation(path: Path) -> SofastOrientation:
    """Read a spatial orientation of camera and screen. Raises ValueError as read_sofast_display does."""
    with opened(path) as file:
        read = GroupReader(file, path, ORIENTATION)
        rotation, place = read.numbers("r_cam_screen", 3), read.numbers("v_cam_screen_cam", 3) * MM
        if not np.linalg.norm(rotation) <= 2 * np.pi:
            raise read.problem("r_cam_screen", f"{rotation.tolist()}; must be a rotation vector in rad")
        return SofastOrientation(rotation, place)


def read_sofast_facet(path: Path) -> SofastFacet:
    """Read the JSON file of a facet. Raises ValueError as read_sofast_display does."""
    try:
        text = path.read_bytes()[: MAX_JSON + 1]
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror or type(error).__name__}") from None
    try:
        table = json.loads(text) if len(text) <= MAX_JSON else None
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise ValueError(f"{path}: is not JSON of at most {MAX_JSON} bytes; the file of a SOFAST facet is")
    corners = _points(table, path, "v_facet_corners")
    centre = _points(table, path, "v_centroid_facet")
    if not 3 <= len(corners) <= MAX_CORNERS:
        raise ValueError(f"{path}: v_facet_corners: {len(corners)} corners; must be 3 to {MAX_CORNERS}")
    if len(centre) != 1:
        raise ValueError(f"{path}: v_centroid_facet: {len(centre)} points; must be one")
    return SofastFacet(corners, centre[0])


def _points(table: dict[str, Any], path: Path, key: str) -> FloatArray:
    """Points [n, 3] in mm of a table of x, y, z in metres."""
    axes = table.get(key)
    rows: list[Any] = [axes.get(axis) for axis in "xyz"] if isinstance(axes, dict) else []
    if not rows or not all(isinstance(row, list) and len(row) == len(rows[0]) <= MAX_CORNERS for row in rows):
        raise ValueError(f"{path}: {key}: must be a table of x, y, z: three arrays of as many numbers, in metres")
    if not all(type(value) in (int, float) and abs(value) < 1e6 for row in rows for value in row):
        raise ValueError(f"{path}: {key}: must hold finite numbers, in metres")
    points: FloatArray = np.array(rows, float).T * MM
    return points


def read_sofast_folder(folder: Path, display: Path | None = None) -> SofastFolder:
    """The files of a laboratory that lie in one folder, found by what they hold.

    display: the display file to read; by default the folder's most complete one (points in space, then in a plane, then
    a rectangle). Raises ValueError, with one line, where a file is missing or cannot be told from another.
    """
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    if not files or len(files) > MAX_FILES:
        raise ValueError(
            f"{folder}: {len(files) or 'no'} files; must be a folder with the files of a SOFAST laboratory"
        )
    groups = {path: groups_of(path) for path in files if path.is_file() and is_hdf5(path)}
    of_kind = {kind: [path for path, names in groups.items() if kind in names]
               for kind in (CAMERA, DISPLAY, ORIENTATION, RESPONSE)}  # fmt: skip
    facets = [path for path in files if path.suffix.lower() == ".json" and _holds_facet(path)]
    found = {"camera": of_kind[CAMERA], "spatial orientation": of_kind[ORIENTATION], "facet (JSON)": facets}
    for what, paths in found.items():
        if len(paths) != 1:
            names = ": " + ", ".join(path.name for path in paths[:4]) if paths else ""
            raise ValueError(f"{folder}: {len(paths) or 'no'} files of a {what}{names}; must be one")
    if len(of_kind[RESPONSE]) > 1:
        names = ", ".join(path.name for path in of_kind[RESPONSE][:4])
        raise ValueError(f"{folder}: {len(of_kind[RESPONSE])} files of an image calibration: {names}; must be one")
    displays = of_kind[DISPLAY]
    if display is None:
        if not displays:
            raise ValueError(f"{folder}: no file of a display (group {DISPLAY}); must have one")
        display = max(displays, key=lambda path: MODELS.index(read_sofast_display(path).model))
    return SofastFolder(
        read_sofast_camera(of_kind[CAMERA][0]),
        read_sofast_display(display),
        read_sofast_orientation(of_kind[ORIENTATION][0]),
        read_sofast_facet(facets[0]),
        display,
        tuple(displays),
        of_kind[RESPONSE][0] if of_kind[RESPONSE] else None,
    )


def _holds_facet(path: Path) -> bool:
    try:
        return b'"v_facet_corners"' in path.read_bytes()[:MAX_JSON]
    except OSError:
        return False
