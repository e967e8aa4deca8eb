"""A camera's calibration by OpenCV, or by a program that uses OpenCV's model: from its files, and as one.

Read are OpenCV's own YAML and JSON, ROS's camera_info, plain YAML or JSON with the same matrices, and SOFAST's HDF5.
The pixel (0, 0) of the picture is the centre of its top left pixel, x to the right, y down.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from irtscots_cl.formats.hdf5 import MAX_TEXT, GroupReader, groups_of, is_hdf5, opened
from irtscots_cl.formats.opencv_text import find, number, numbers, read_tables, shown, whole

COUNTS = (0, 4, 5, 8)  # of distortion coefficients that the camera's model has
LONG_COUNTS = {12: "the thin prism's s1 to s4", 14: "the thin prism's s1 to s4 and the tilts tau_x, tau_y"}
# Names of the keys in files; the first is OpenCV's own.
MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "intrinsic_matrix", "intrinsics", "K", "k", "mtx")
COEFFICIENTS = (
    "distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "dist_coeff", "distCoeffs", "distortion",
    "D", "d", "dist",
)  # fmt: skip
SIZES = (("image_width", "image_height"), ("image_Width", "image_Height"), ("width", "height"))
PAIRS = ("image_size", "img_size", "imageSize", "resolution")
MODELS = ("", "plumb_bob", "rational_polynomial", "radtan", "opencv", "pinhole")
GROUP = "Camera"  # of SOFAST's files


@dataclass(frozen=True)
class OpenCvCamera:
    """fx, fy, cx, cy: focal lengths and principal point in pixels. distortion: none, or k1, k2, p1, p2 (, k3 (, k4, k5,
    k6)). image_size_px: (columns, rows) of the calibrated picture; None where the file does not tell it."""

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    image_size_px: tuple[int, int] | None = None
    name: str = ""


def read_camera(path: Path) -> OpenCvCamera:
    """The camera of a calibration file. Raises ValueError, with one line that names the file, the key, its value and
    the remedy, for one that cannot be read or has another model."""
    if is_hdf5(path):
        return read_sofast_camera(path)
    tables = read_tables(path)
    tables = _inner(tables)
    _check_model(tables, path)
    key, matrix = find(tables, MATRIX)
    if not key:
        known = ", ".join(list(tables)[:8])
        raise ValueError(
            f"{path}: has no {MATRIX[0]} (keys: {known or 'none'}); a camera calibration of OpenCV has one"
        )
    lens, coefficients = find(tables, COEFFICIENTS)
    if not lens:
        raise ValueError(
            f"{path}: has no {COEFFICIENTS[0]}; must have it, an empty array for a lens without distortion"
        )
    found = [] if coefficients in ([], "") else numbers(coefficients, path, lens)
    name = tables.get("camera_name", "")
    name = name[:MAX_TEXT] if isinstance(name, str) else ""
    return checked_camera(path, (key, numbers(matrix, path, key)), (lens, found), _size(tables, path), name)


def read_sofast_camera(path: Path) -> OpenCvCamera:
    """The camera of a SOFAST file. Raises ValueError as read_camera does.

    The last element of the matrix may be other than 1: OpenCV, with which SOFAST works, ignores it.
    """
    if GROUP not in groups_of(path):
        raise ValueError(f"{path}: has no group {GROUP}; the HDF5 file of a SOFAST camera has one")
    with opened(path) as file:
        read = GroupReader(file, path, GROUP)
        matrix = read.numbers("intrinsic_mat", 3, 3).ravel().tolist()
        coefficients = read.numbers("distortion_coef", None, most=14).tolist()
        columns, rows = read.numbers("image_shape_xy", 2).tolist()
        size = tuple(whole(n, path, f"{GROUP}/image_shape_xy", 1) for n in (columns, rows))
        matrix[8] = 1.0
        named = f"{GROUP}/intrinsic_mat", f"{GROUP}/distortion_coef"
        return checked_camera(path, (named[0], matrix), (named[1], coefficients), (size[0], size[1]), read.text("name"))


def checked_camera(
    path: Path,
    matrix: tuple[str, list[float]],
    coefficients: tuple[str, list[float]],
    size: tuple[int, int] | None,
    name: str,
) -> OpenCvCamera:
    """A camera of a matrix and coefficients, each with its key in the file. Raises ValueError for another model."""
    key, values = matrix
    if len(values) != 9:
        raise ValueError(f"{path}: {key}: {len(values)} numbers; must be a matrix of 3 x 3")
    fx, skew, cx, below, fy, cy, *last = values
    if skew != 0:
        raise ValueError(
            f"{path}: {key}[0][1] = {skew:g}: a skew of the pixels, which the model does not have, nor do OpenCV's "
            "functions; must be 0: calibrate without skew"
        )
    if below != 0 or last != [0.0, 0.0, 1.0]:
        raise ValueError(f"{path}: {key} = {values}: must be [fx, 0, cx, 0, fy, cy, 0, 0, 1]")
    if not (fx > 0 and fy > 0):
        raise ValueError(f"{path}: {key}: focal lengths {fx:g}, {fy:g}; must be above 0")
    return OpenCvCamera(fx, fy, cx, cy, _short(path, *coefficients), size, name)


def _short(path: Path, key: str, values: list[float]) -> tuple[float, ...]:
    """The coefficients that the model has. Raises ValueError where others are not zero."""
    if len(values) in LONG_COUNTS and any(values[8:]):
        raise ValueError(
            f"{path}: {key}: {len(values)} coefficients with {LONG_COUNTS[len(values)]} = {values[8:]}, which the "
            "model does not have; calibrate with at most 8 (without CALIB_THIN_PRISM_MODEL and CALIB_TILTED_MODEL)"
        )
    values = values[:8] if len(values) in LONG_COUNTS else values
    if len(values) not in COUNTS:
        raise ValueError(
            f"{path}: {key}: {len(values)} coefficients; must be 4 (k1, k2, p1, p2), 5 (and k3) or 8 (and k4, k5, k6)"
        )
    return tuple(values) if any(values) else ()


def _inner(tables: dict[str, Any]) -> dict[str, Any]:
    """The table with the camera: the file's own, or the only one in it that has a matrix."""
    if find(tables, MATRIX)[0]:
        return tables
    inner = [table for table in tables.values() if isinstance(table, dict) and find(table, MATRIX)[0]]
    return inner[0] if len(inner) == 1 else tables


def _check_model(tables: dict[str, Any], path: Path) -> None:
    """Raise ValueError for a model of the lens, or a part of the picture, that is not read from files."""
    model = str(tables.get("distortion_model", "")).lower()
    fisheye = str(tables.get("fisheye_model", "0")).lower() in ("1", "1.0", "true")
    if fisheye or model not in MODELS or "xi" in tables:
        key = "distortion_model" if model not in MODELS else "xi" if "xi" in tables else "fisheye_model"
        raise ValueError(
            f"{path}: {key} = {shown(tables[key])}: a model of fisheyes or other wide lenses, which is not known here; "
            "must be OpenCV's pinhole model with radial and tangential distortion (plumb_bob, rational_polynomial)"
        )
    for key in ("binning_x", "binning_y"):
        if key in tables and number(tables[key], path, key) > 1:
            raise ValueError(f"{path}: {key} = {shown(tables[key])}: must be left out; give binning in the scene")
    roi = tables.get("roi")
    if isinstance(roi, dict) and any(number(roi.get(key, 0), path, f"roi.{key}") for key in ("x_offset", "y_offset")):
        raise ValueError(f"{path}: roi: must be left out; give roi_px in the scene")


def _size(tables: dict[str, Any], path: Path) -> tuple[int, int] | None:
    for names in SIZES:
        if names[0] in tables and names[1] in tables:
            columns, rows = (whole(tables[name], path, name, 1) for name in names)
            return columns, rows
    key, pair = find(tables, PAIRS)
    if not key:
        return None
    sizes = numbers(pair, path, key)
    if len(sizes) != 2:
        raise ValueError(f"{path}: {key}: {len(sizes)} numbers; must be [columns, rows]")
    return whole(sizes[0], path, key, 1), whole(sizes[1], path, key, 1)


def opencv_yaml(camera: OpenCvCamera) -> str:
    """A camera as the YAML text that cv::FileStorage of all versions reads. image_size_px must be known."""
    if camera.image_size_px is None:
        raise ValueError("the camera's picture has no size; an OpenCV file needs it")
    columns, rows = camera.image_size_px
    name = re.sub(r"[^ -!#-\[\]-~]", " ", camera.name)
    lines = ["%YAML:1.0", "---", f'camera_name: "{name}"'] if name else ["%YAML:1.0", "---"]
    lines += [f"image_width: {columns}", f"image_height: {rows}"]
    lines += _matrix("camera_matrix", 3, [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0])
    lines += _matrix("distortion_coefficients", 1, list(camera.distortion or (0.0,) * 5))
    return "\n".join(lines) + "\n"


def _matrix(name: str, rows: int, values: list[float]) -> list[str]:
    data = ", ".join(repr(float(value)) for value in values)
    shape = [f"   rows: {rows}", f"   cols: {len(values) // rows}", "   dt: d", f"   data: [ {data} ]"]
    return [f"{name}: !!opencv-matrix", *shape]
