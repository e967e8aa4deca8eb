"""The mirror's deviation in a `result.h5` of this program, as a map: from the pixels' mirror points to an even grid.

The pixels of a camera see the mirror at points that are on no even grid. The deviation is interpolated between them by
cubics (Clough and Tocher); a point of the grid is valid if a valid pixel's is within three quarters of the pitch. The
pitch is the median distance of neighbouring pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from irtscots_cl.formats.frames import check_size, reading
from irtscots_cl.formats.hdf5 import GroupReader, opened
from irtscots_cl.formats.height_map import SURFACE, UNIT_MM, Findings, HeightMap, MapOptions
from irtscots_cl.formats.zygo_datx import check_dataset
from irtscots_cl.maths.arrays import FloatArray

REACH = 0.75  # of the pitch, from a point of the grid to a valid pixel's
LEAST_PIXELS = 4


def is_result(path: Path) -> bool:
    """Whether an HDF5 file holds a deviation and its mirror points."""
    try:
        with h5py.File(path, "r") as file:
            links = [file.get(name, getlink=True) for name in ("deviation_nm", "mirror")]
            return all(isinstance(link, h5py.HardLink) for link in links)
    except (OSError, RuntimeError, KeyError):
        return False


@dataclass(frozen=True)
class ResultGrid:
    """A result's deviation on the grid of the camera's pixels, [rows, columns]; NaN where a pixel was not used.

    column_mm, row_mm: (x, y) on the mirror from a pixel to the next along columns and rows, the median. uneven: by
    which part of it a tenth of the steps differ at least. height_error_mm: rms of the stated errors; slope_errors:
    those of the slopes in x and y [rad]; NaN where the file has none.
    """

    heights_mm: FloatArray = field(repr=False)
    column_mm: tuple[float, float]
    row_mm: tuple[float, float]
    uneven: float
    height_error_mm: float
    slope_errors: tuple[float, float]

    @property
    def pitch_mm(self) -> tuple[float, float]:
        """Distances of the pixels along columns and rows."""
        return math.hypot(*self.column_mm), math.hypot(*self.row_mm)


def read_result_grid(path: Path) -> ResultGrid:
    """The deviation of a result where the pixels are. Raises ValueError, with one line, for what cannot be read."""
    with reading(path, "result"), opened(path) as file:
        heights = _numbers(path, file, "", "deviation_nm") * UNIT_MM["nm"]
        x, y = (_numbers(path, file, "mirror", name) for name in ("x_mm", "y_mm"))
        if not x.shape == y.shape == heights.shape or heights.ndim != 2:
            raise ValueError(f"{path}: mirror/x_mm, mirror/y_mm, deviation_nm: must be maps of one size")
        steps = [np.stack([np.diff(x, axis=axis), np.diff(y, axis=axis)], -1).reshape(-1, 2) for axis in (1, 0)]
        steps = [of_axis[np.isfinite(of_axis).all(1)] for of_axis in steps]
        if min(map(len, steps)) < LEAST_PIXELS:
            raise ValueError(f"{path}: too few valid pixels for a spectrum")
        medians = [np.median(of_axis, axis=0) for of_axis in steps]
        lengths = [np.linalg.norm(s, axis=1) / np.linalg.norm(m) for s, m in zip(steps, medians, strict=True)]
        height_error = _rms_of(path, file, "", "height_standard_error_nm") * UNIT_MM["nm"]
        slopes = tuple(_rms_of(path, file, "slope", f"{axis}_standard_error_rad") for axis in "xy")
    return ResultGrid(
        heights, (float(medians[0][0]), float(medians[0][1])), (float(medians[1][0]), float(medians[1][1])),
        float(max(np.quantile(np.abs(of_axis - 1), 0.9) for of_axis in lengths)), height_error, (slopes[0], slopes[1]),
    )  # fmt: skip


def _rms_of(path: Path, file: h5py.File, group: str, name: str) -> float:
    """Rms of the finite values of a map; NaN where there is none or no such map."""
    if f"{group}/{name}" not in file:
        return math.nan
    values = _numbers(path, file, group, name)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def read_result_map(path: Path, options: MapOptions) -> HeightMap:
    """The deviation of a result, on an even grid. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    with reading(path, "result"), opened(path) as file:
        heights = _numbers(path, file, "", "deviation_nm") * UNIT_MM["nm"]
        x, y = (_numbers(path, file, "mirror", name) for name in ("x_mm", "y_mm"))
        if not x.shape == y.shape == heights.shape:
            raise ValueError(f"{path}: mirror/x_mm, mirror/y_mm, deviation_nm: must be of one size")
        pitch = _pitch(x, y)
        good = np.isfinite(heights) & np.isfinite(x) & np.isfinite(y)
        if good.sum() < LEAST_PIXELS or not pitch > 0:
            raise ValueError(f"{path}: {int(good.sum())} valid pixels: too few for a map")
        grid, centre = _on_grid(found, x[good], y[good], heights[good], pitch)
    return found.build(
        grid,
        "result",
        pitch_mm=found.pitch_mm((pitch, pitch)),
        wavelength_nm=options.wavelength_nm,
        kind=found.kind(SURFACE),
        centre_mm=centre,
    )


def _numbers(path: Path, file: h5py.File, group: str, name: str) -> FloatArray:
    data = GroupReader(file, path, group).dataset(name)
    check_dataset(path, data)
    return np.asarray(data[()], np.float64)


def _pitch(x: FloatArray, y: FloatArray) -> float:
    """Median distance of neighbouring pixels' points; NaN where there are none."""
    steps = [np.hypot(np.diff(x, axis=axis), np.diff(y, axis=axis)).ravel() for axis in (0, 1)]
    known = np.concatenate(steps)
    known = known[np.isfinite(known)]
    return float(np.median(known)) if known.size else float("nan")


def _on_grid(
    found: Findings, x: FloatArray, y: FloatArray, heights: FloatArray, pitch: float
) -> tuple[FloatArray, tuple[float, float]]:
    """Heights on a grid of the pitch about the middle of the points' bounding box, and that middle."""
    from scipy.interpolate import CloughTocher2DInterpolator
    from scipy.spatial import cKDTree

    middles, axes = [], []
    for place in (x, y):
        low, high = float(place.min()), float(place.max())
        count = int(min((high - low) / pitch, 1e9)) + 1
        middles.append((low + high) / 2)
        axes.append((count, middles[-1]))
    check_size(found.where, axes[0][0], axes[1][0], 1, 1, len(x), 64)
    along = [middle + (np.arange(count) - (count - 1) / 2) * pitch for count, middle in axes]
    grid_x, grid_y = np.meshgrid(*along)
    points = np.stack([x, y], axis=1)
    distance, _ = cKDTree(points).query(np.stack([grid_x, grid_y], axis=-1).reshape(-1, 2))
    values = CloughTocher2DInterpolator(points, heights, rescale=False)(grid_x, grid_y)
    near = distance.reshape(grid_x.shape) <= REACH * pitch
    found.warnings.append(f"the deviation is interpolated from {len(x)} pixels to a grid of {pitch:.6g} mm")
    return np.where(near, values, np.nan), (middles[0], middles[1])
