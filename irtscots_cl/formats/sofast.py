"""Measurements of SOFAST, the fringe deflectometry of OpenCSP (Sandia National Laboratories), from their HDF5 files.

The group MeasurementSofastFringe holds, in metres:

    fringe_images        [rows, columns, frames]: the y series, then the x series, four steps each
    mask_images          [rows, columns, 2]: black screen, then white screen
    fringe_periods_x/_y  numbers of periods over the screen
    dist_optic_screen    distance from the measured point of the optic to the screen (older: optic_screen_dist)
    v_measure_point_facet  that point in the optic's frame (older: measure_point)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.hdf5 import GroupReader, groups_of, opened
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system import interruption
from irtscots_cl.system.memory import check_memory

GROUP = "MeasurementSofastFringe"
STEPS = 4  # of every series
MM = 1e3  # in a metre
MAX_SERIES = 64
MAX_UNPACKED = 1100  # bytes of images for a byte in the file: no compression of HDF5's own reaches it
ROWS_AT_ONCE = 64


@dataclass(frozen=True)
class SofastMeasurement:
    """frames: [frames, rows, columns] as stored, the y series first. dark, white: [rows, columns]. periods_x,
    periods_y: numbers of periods over the screen. screen_distance_mm: from point_mm [3] of the optic to the screen."""

    frames: NDArray[Any] = field(repr=False)
    dark: NDArray[Any] = field(repr=False)
    white: NDArray[Any] = field(repr=False)
    periods_x: tuple[float, ...]
    periods_y: tuple[float, ...]
    screen_distance_mm: float
    point_mm: FloatArray
    name: str
    date: str


@dataclass(frozen=True)
class SofastResponse:
    """shown: [n] values shown on the screen. camera: [n] what the camera gives for them."""

    shown: FloatArray
    camera: FloatArray


def is_sofast_measurement(path: Path) -> bool:
    """Whether a file is an HDF5 file with a SOFAST fringe measurement."""
    return GROUP in groups_of(path)


def read_sofast_measurement(path: Path) -> SofastMeasurement:
    """Read a measurement. Raises ValueError, with one line that names the file and the key, for one that has another
    form or claims more values than it holds."""
    with opened(path) as file:
        return _measurement(GroupReader(file, path, GROUP))


def read_sofast_response(path: Path) -> SofastResponse:
    """Read an image calibration: the table of the screen's and camera's response. Raises ValueError as above."""
    with opened(path) as file:
        read = GroupReader(file, path, "ImageCalibration")
        shown, camera = (read.numbers(name, None) for name in ("display_values", "camera_values"))
        if len(shown) != len(camera):
            raise ValueError(
                f"{path}: display_values has {len(shown)} values, camera_values {len(camera)}; must be equal"
            )
        return SofastResponse(shown, camera)


def _images(read: GroupReader, name: str) -> h5py.Dataset:
    """A dataset [rows, columns, frames] whose values the file really holds."""
    data = read.dataset(name)
    if data.dtype.kind not in "fiu" or data.shape is None or len(data.shape) != 3 or 0 in data.shape:
        form = "empty" if data.shape is None else f"of shape {list(data.shape)} and type {data.dtype}"
        raise read.problem(name, f"{form}; must be images [rows, columns, frames] of real numbers")
    stored = data.id.get_storage_size()
    if data.nbytes > MAX_UNPACKED * stored:
        what = f"{list(data.shape)} = {data.nbytes} bytes of images, of which the file holds {stored}"
        raise read.problem(name, what)
    check_memory(f"{read.path}: {read.group}/{name}: {data.size} values", 3.0 * data.nbytes)
    return data


def _measurement(read: GroupReader) -> SofastMeasurement:
    periods_y, periods_x = (read.numbers(f"fringe_periods_{axis}", None, most=MAX_SERIES) for axis in "yx")
    fringes, masks = _images(read, "fringe_images"), _images(read, "mask_images")
    rows, columns, count = fringes.shape
    wanted = STEPS * (len(periods_x) + len(periods_y))
    if count != wanted:
        raise read.problem(
            "fringe_images", f"{count} frames; must be {STEPS} for each of the {wanted // STEPS} numbers of periods"
        )
    if masks.shape != (rows, columns, 2):
        raise read.problem("mask_images", f"shape {list(masks.shape)}; must be {[rows, columns, 2]}: black, white")
    for axis, periods in (("x", periods_x), ("y", periods_y)):
        if not (periods > 0).all():
            raise read.problem(f"fringe_periods_{axis}", f"{periods.tolist()}; must be above 0")
    (distance,) = _some(read, ("dist_optic_screen", "optic_screen_dist"), 1)
    point = _some(read, ("v_measure_point_facet", "measure_point"), 3)
    pair = masks[()]
    return SofastMeasurement(
        _frames_first(fringes),
        pair[..., 0],
        pair[..., 1],
        tuple(map(float, periods_x)),
        tuple(map(float, periods_y)),
        float(distance) * MM,
        point * MM,
        read.text("name"),
        read.text("date"),
    )


def _some(read: GroupReader, names: tuple[str, str], count: int) -> FloatArray:
    """So many numbers under the first of two names, or the second if only that is there."""
    return read.numbers(names[names[0] not in read.file[GROUP] and names[1] in read.file[GROUP]], count)


def _frames_first(images: h5py.Dataset) -> NDArray[Any]:
    """The images [frames, rows, columns], read in parts."""
    rows, columns, count = images.shape
    frames = np.empty((count, rows, columns), images.dtype.newbyteorder("="))
    step = max(ROWS_AT_ONCE, images.chunks[0]) if images.chunks else ROWS_AT_ONCE
    for first in range(0, rows, step):
        interruption.check()
        frames[:, first : first + step] = np.moveaxis(images[first : first + step], -1, 0)
    return frames
