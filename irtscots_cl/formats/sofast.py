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

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system import interruption
from irtscots_cl.system.memory import check_memory

GROUP = "MeasurementSofastFringe"
STEPS = 4  # of every series
MM = 1e3  # in a metre
MAX_SERIES = 64
MAX_UNPACKED = 1100  # bytes of images for a byte in the file: no compression of HDF5's own reaches it
MAX_TEXT = 1000
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
    try:
        with h5py.File(path, "r") as file:
            return isinstance(file.get(GROUP), h5py.Group)
    except (OSError, RuntimeError):
        return False


def read_sofast_measurement(path: Path) -> SofastMeasurement:
    """Read a measurement. Raises ValueError, with one line that names the file and the key, for one that has another
    form or claims more values than it holds."""
    with _opened(path) as file:
        return _measurement(_Reader(file, path, GROUP))


def read_sofast_response(path: Path) -> SofastResponse:
    """Read an image calibration: the table of the screen's and camera's response. Raises ValueError as above."""
    with _opened(path) as file:
        read = _Reader(file, path, "ImageCalibration")
        shown, camera = (read.numbers(name, 2**16) for name in ("display_values", "camera_values"))
        if len(shown) != len(camera):
            raise ValueError(
                f"{path}: display_values has {len(shown)} values, camera_values {len(camera)}; must be equal"
            )
        return SofastResponse(shown, camera)


class _opened:  # noqa: N801
    """A file for reading; what h5py raises for broken files becomes a ValueError of one line."""

    def __init__(self, path: Path):
        self.path = path

    def __enter__(self) -> h5py.File:
        if not self.path.is_file():
            why = "it is a folder" if self.path.is_dir() else "there is no file of that name"
            raise ValueError(f"{self.path}: not a readable HDF5 file: {why}")
        try:
            self.file = h5py.File(self.path, "r")
        except (OSError, RuntimeError) as error:
            raise ValueError(f"{self.path}: not a readable HDF5 file: {_first_line(error)}") from None
        return self.file

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self.file.close()
        if isinstance(error, (OSError, RuntimeError, KeyError)) and not isinstance(error, InterruptedError):
            raise ValueError(f"{self.path}: cannot be read: {_first_line(error)}") from None


def _first_line(error: BaseException) -> str:
    return str(error.args[0] if error.args else error).splitlines()[0]


class _Reader:
    """Datasets of one group of a file, checked before their values are read."""

    def __init__(self, file: h5py.File, path: Path, group: str):
        self.file, self.path, self.group = file, path, group

    def dataset(self, *names: str, shape: tuple[int, ...] = ()) -> h5py.Dataset:
        """The dataset of the first name that exists, of real numbers stored in this file; shape: its rank."""
        for name in names:
            place = f"{self.group}/{name}"
            links = [self.file.get(part, getlink=True) for part in (self.group, place)]
            if any(isinstance(link, h5py.ExternalLink) for link in links):
                raise self.problem(name, "its values are in another file; must be in this one")
            data = self.file.get(place)
            if data is None:
                continue
            if not isinstance(data, h5py.Dataset):
                raise self.problem(name, "a group; must be a dataset")
            if data.external or data.is_virtual:
                raise self.problem(name, "its values are in another file; must be in this one")
            return data
        raise self.problem(names[0], "missing; a SOFAST file has it")

    def numbers(self, name: str, most: int) -> FloatArray:
        """A row of at most so many finite numbers."""
        data = self.dataset(name)
        if data.dtype.kind not in "fiu" or data.shape is None or not 1 <= data.size <= most:
            raise self.problem(name, f"{_form(data)}; must be 1 to {most} numbers")
        values = np.asarray(data[()], float).ravel()
        if not np.isfinite(values).all():
            raise self.problem(name, "holds a value that is no finite number")
        return values

    def images(self, name: str) -> h5py.Dataset:
        """A dataset [rows, columns, frames] whose values the file really holds."""
        data = self.dataset(name)
        if data.dtype.kind not in "fiu" or data.shape is None or len(data.shape) != 3 or 0 in data.shape:
            raise self.problem(name, f"{_form(data)}; must be images [rows, columns, frames] of real numbers")
        stored = data.id.get_storage_size()
        if data.nbytes > MAX_UNPACKED * stored:
            raise self.problem(
                name, f"{list(data.shape)} = {data.nbytes} bytes of images, of which the file holds {stored}"
            )
        check_memory(f"{self.path}: {self.group}/{name}: {data.size} values", 3.0 * data.nbytes)
        return data

    def text(self, name: str) -> str:
        """A short text; empty where there is none."""
        data = self.file.get(f"{self.group}/{name}")
        if not isinstance(data, h5py.Dataset) or data.shape != () or not h5py.check_string_dtype(data.dtype):
            return ""
        return str(data.asstr(errors="replace")[()])[:MAX_TEXT]

    def problem(self, name: str, what: str) -> ValueError:
        return ValueError(f"{self.path}: {self.group}/{name}: {what}")


def _form(data: h5py.Dataset) -> str:
    return "empty" if data.shape is None else f"of shape {list(data.shape)} and type {data.dtype}"


def _measurement(read: _Reader) -> SofastMeasurement:
    periods_y, periods_x = (read.numbers(f"fringe_periods_{axis}", MAX_SERIES) for axis in "yx")
    fringes, masks = read.images("fringe_images"), read.images("mask_images")
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


def _some(read: _Reader, names: tuple[str, str], count: int) -> FloatArray:
    data = read.dataset(*names)
    name = data.name.rsplit("/", 1)[-1]
    values = read.numbers(name, count)
    if len(values) != count:
        raise read.problem(name, f"{len(values)} numbers; must be {count}")
    return values


def _frames_first(images: h5py.Dataset) -> NDArray[Any]:
    """The images [frames, rows, columns], read in parts."""
    rows, columns, count = images.shape
    frames = np.empty((count, rows, columns), images.dtype.newbyteorder("="))
    step = max(ROWS_AT_ONCE, images.chunks[0]) if images.chunks else ROWS_AT_ONCE
    for first in range(0, rows, step):
        interruption.check()
        frames[:, first : first + step] = np.moveaxis(images[first : first + step], -1, 0)
    return frames
