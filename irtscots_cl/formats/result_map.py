"""A measured map of this program, from the pixels' mirror points to an even grid.

The pixels of a camera see the mirror at points that are on no even grid. The values are interpolated between them by a
polynomial of degree 4, and cubics (Clough and Tocher) for the rest; a point of the grid is valid if a valid pixel's is
within three quarters of the pitch. The pitch is the median distance of neighbouring pixels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.frames import check_size, reading
from irtscots_cl.formats.hdf5 import GroupReader, opened
from irtscots_cl.formats.height_map import RESULT_QUANTITIES, SURFACE, UNIT_MM, Findings, HeightMap, MapOptions
from irtscots_cl.formats.zygo_datx import check_dataset
from irtscots_cl.maths.arrays import FloatArray

REACH = 0.75  # of the pitch, from a point of the grid to a valid pixel's
LEAST_PIXELS = 4
MOST_CHECKED = 300  # rows and columns whose pixels are left out in turn, to judge the interpolation
LEAST_FITTED = 60  # points, for a polynomial of 15 terms
DEVIATION, HEIGHT, STANDARD_ERROR = RESULT_QUANTITIES
_PLACE = "x, y: mirror's frame, z = 0"
# What can be taken from a result: dataset, mm per unit, and what the values are.
QUANTITIES = {
    DEVIATION: ("deviation_nm", UNIT_MM["nm"], f"Deviation from design along z, + towards camera; {_PLACE}"),
    HEIGHT: ("height_mm", 1.0, f"Surface (design and deviation), + towards camera; {_PLACE}"),
    STANDARD_ERROR: ("height_standard_error_nm", UNIT_MM["nm"], f"Standard error of the height; {_PLACE}"),
}


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
    """A map of a result on an even grid: the deviation, or the quantity told. Raises ValueError, with one line, for
    what cannot be read."""
    with reading(path, "result"), opened(path) as file:
        name, unit_mm, _ = QUANTITIES[options.quantity or DEVIATION]
        heights = _numbers(path, file, "", name) * unit_mm
        x, y = (_numbers(path, file, "mirror", name) for name in ("x_mm", "y_mm"))
        groups = _numbers(path, file, "", "island_groups") if "island_groups" in file else np.ones(heights.shape)
        if not x.shape == y.shape == heights.shape == groups.shape:
            raise ValueError(f"{path}: mirror/x_mm, mirror/y_mm, {name}: must be of one size")
        return map_of_pixels(str(path), x, y, heights, groups, options)


def map_of_pixels(
    where: str, x: FloatArray, y: FloatArray, heights: FloatArray, groups: FloatArray, options: MapOptions
) -> HeightMap:
    """The map of heights [rows, columns] in mm at mirror points x, y, NaN where invalid.

    groups: [rows, columns], 1 for the largest group of pixels whose heights are known against each other. Only that one
    is in the map. Raises ValueError for too few pixels.
    """
    found = Findings(where, options)
    good = np.isfinite(heights) & np.isfinite(x) & np.isfinite(y)
    others = int((good & (groups > 1)).sum())
    if others:
        found.warnings.append(f"{others} pixels of other islands, of unknown piston, are left out")
        good &= groups <= 1
    pitch = _pitch(np.where(good, x, np.nan), np.where(good, y, np.nan))
    if good.sum() < LEAST_PIXELS or not pitch > 0:
        raise ValueError(f"{where}: {int(good.sum())} valid pixels: too few for a map")
    grid, centre = _on_grid(found, x[good], y[good], heights[good], pitch)
    error_nm = _change_nm(x, y, heights, good)
    if np.isfinite(error_nm):
        found.warnings[-1] += f"; pixels left out in turn come back to {error_nm:.2g} nm rms, noise included"
    return found.build(
        grid,
        "result",
        pitch_mm=found.pitch_mm((pitch, pitch)),
        wavelength_nm=options.wavelength_nm,
        kind=found.kind(SURFACE),
        centre_mm=centre,
        comment=(QUANTITIES[options.quantity or DEVIATION][2], found.warnings[-1]),
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
    from scipy.spatial import cKDTree

    middles, axes = [], []
    for place in (x, y):
        low, high = float(place.min()), float(place.max())
        count = int(min((high - low) / pitch, 1e9)) + 1
        middles.append(round((low + high) / 2, 9) + 0.0)
        axes.append((count, middles[-1]))
    check_size(found.where, axes[0][0], axes[1][0], 1, 1, len(x), 64)
    along = [middle + (np.arange(count) - (count - 1) / 2) * pitch for count, middle in axes]
    grid_x, grid_y = np.meshgrid(*along)
    points = np.stack([x, y], axis=1)
    distance, _ = cKDTree(points).query(np.stack([grid_x, grid_y], axis=-1).reshape(-1, 2))
    values = _interpolated(points, heights, grid_x, grid_y)
    near = distance.reshape(grid_x.shape) <= REACH * pitch
    found.warnings.append(f"interpolated from {len(x)} pixels to a grid of {pitch:.6g} mm")
    return np.where(near, values, np.nan), (middles[0], middles[1])


def _interpolated(points: FloatArray, heights: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Values at x, y; NaN outside the points' convex hull. A polynomial is exact for the low orders, cubics take the
    rest."""
    from scipy.interpolate import CloughTocher2DInterpolator

    middle = points.mean(axis=0)
    scale = np.abs(points - middle).max()
    near, (u, v) = (points - middle) / scale, ((x - middle[0]) / scale, (y - middle[1]) / scale)
    degree = 4 if len(points) >= LEAST_FITTED else 0
    basis = _monomials(near[:, 0], near[:, 1], degree)
    coefficients = np.linalg.lstsq(basis, heights)[0]
    rest = heights - basis @ coefficients
    # The tolerance of its gradients is absolute below 1: what is small in its unit would come out worse.
    size = float(np.abs(rest).max()) or 1.0
    found: FloatArray = CloughTocher2DInterpolator(near, rest / size)(u, v) * size
    found += _monomials(u, v, degree) @ coefficients
    return found


def _monomials(u: FloatArray, v: FloatArray, degree: int) -> FloatArray:
    """[..., terms] of total degree up to `degree`."""
    return np.stack([u**i * v**k for i in range(degree + 1) for k in range(degree + 1 - i)], axis=-1)


def _change_nm(x: FloatArray, y: FloatArray, heights: FloatArray, good: NDArray[np.bool_]) -> float:
    """Rms in nm of heights less what the pixels around them give, every other one left out: an upper limit of the
    interpolation's error, since its points are closer. Of large maps the middle; NaN for too few pixels."""
    rows, columns = good.shape
    part = tuple(slice(max(0, n - MOST_CHECKED) // 2, (n + MOST_CHECKED) // 2) for n in (rows, columns))
    x, y, heights, good = x[part], y[part], heights[part], good[part]
    even = np.add.outer(np.arange(good.shape[0]), np.arange(good.shape[1])) % 2 == 0
    kept, left_out = good & even, good & ~even
    if min(kept.sum(), left_out.sum()) < LEAST_PIXELS:
        return float("nan")
    try:
        again = _interpolated(np.stack([x[kept], y[kept]], axis=1), heights[kept], x[left_out], y[left_out])
    except ValueError:  # all on one line
        return float("nan")
    change = again - heights[left_out]
    # pixels at the border and at holes have no neighbours on one side: they are no measure of the others
    inside = np.isfinite(change) & _surrounded(good)[left_out]
    return float(np.sqrt(np.mean(change[inside] ** 2)) * 1e6) if inside.any() else float("nan")


def _surrounded(good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels whose eight neighbours are good."""
    wide = np.pad(good, 1)
    rows, columns = good.shape
    parts = [wide[i : i + rows, k : k + columns] for i in range(3) for k in range(3)]
    found: NDArray[np.bool_] = np.logical_and.reduce(parts)
    return found


def read_pixel_maps(path: Path, names: Sequence[str]) -> tuple[dict[str, FloatArray], str]:
    """Maps [rows, columns] of a result by the datasets' names, and the orientation in which they lie in the file.

    Raises ValueError, one line, for what cannot be read, and for maps of different sizes.
    """
    with reading(path, "result"), opened(path) as file:
        maps = {}
        for name in names:
            group, _, last = name.rpartition("/")
            maps[name] = _numbers(path, file, group, last)
        if len({values.shape for values in maps.values()}) != 1 or next(iter(maps.values())).ndim != 2:
            raise ValueError(f"{path}: {', '.join(names)}: must be maps of one size")
        return maps, str(file.attrs.get("orientation", "upright"))
