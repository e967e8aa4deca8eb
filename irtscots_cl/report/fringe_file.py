"""result.h5 of fringes: maps with the rows and columns of the images as they lie in their file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from irtscots_cl.formats.hdf5 import write_dataset
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.maths.integration import separate_islands
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import replacing

REASON_WORDS = (
    "used", "masked", "without fringes", "too few samples", "order in doubt", "series disagree",
    "off the mirror's edge", "fiducial", "bad pixel",
)  # fmt: skip
REASON_UNIT = ", ".join(f"{number} {words}" for number, words in enumerate(REASON_WORDS))
Rows = list[tuple[str, np.ndarray, str]]


@dataclass(frozen=True)
class FringeMaps:
    """coordinates: of the images as stored. points_mm: [rows, columns, 3] upright, where the pixels' places are in the
    screen's frame. stored: turns an upright map as the images are stored. reason: of the images as stored, why pixels
    are not used (measurement.fringe_quality.Reason); None: not known. second_harmonic: over the first, by axis, of the
    images as stored. coverage: share of each pixel on the mirror by its outline in the picture, upright; None where no
    outline was found."""

    coordinates: ScreenCoordinates
    points_mm: FloatArray = field(repr=False)
    stored: Callable[[Any], Any] = field(repr=False)
    reason: IntArray | None = field(default=None, repr=False)
    second_harmonic: Mapping[str, FloatArray] = field(default_factory=dict, repr=False)
    coverage: FloatArray | None = field(default=None, repr=False)


def write_fringe_result(
    path: Path, maps: FringeMaps, result: Reconstruction, attributes: Mapping[str, str], bars: ErrorBars
) -> None:
    """Write result.h5: places on the screen, as fractions and in mm, modulation, mirror points, slopes and height, all
    [rows, columns] as the images are stored, with standard errors. attributes: of the file."""
    upright = [*screen_rows(maps.points_mm, result), *surface_rows(result, bars)]
    if maps.coverage is not None:
        upright.append(("outline/coverage", maps.coverage.astype(np.float32), "1"))
    why: Rows = [] if maps.reason is None else [("excluded", maps.reason.astype(np.uint8), REASON_UNIT)]
    rows = [*why, *_fringes(maps), *((name, maps.stored(values), unit) for name, values, unit in upright)]
    write_rows(path, rows, attributes)


def write_rows(path: Path, rows: Rows, attributes: Mapping[str, str]) -> None:
    """Write datasets (name, values, unit) and attributes into an HDF5 file."""
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        for key, value in attributes.items():
            file.attrs[key] = value
        for name, values, unit in rows:
            interruption.check()
            write_dataset(file, name, values, unit)


def _fringes(maps: FringeMaps) -> Rows:
    """What the fringes say, of the images as stored."""
    found = maps.coordinates
    rows: Rows = [("modulation", weakest_modulation(found), "1")]
    for axis, one in found.axes.items():
        rows += [
            (f"screen/{axis}_fraction", one.fraction, "1"),
            (f"screen/{axis}_fraction_standard_error", one.standard_error, "1"),
            (f"fringes/{axis}_modulation", one.modulation, "1"),
            (f"fringes/{axis}_phase_rad", one.phase_rad, "rad"),
            (f"fringes/{axis}_amplitude", one.amplitude, "counts"),
            (f"fringes/{axis}_offset", one.offset, "counts"),
            (f"fringes/{axis}_residual", one.residual, "counts"),
            (f"fringes/{axis}_samples_left_out", one.missing, "1"),
            (f"fringes/{axis}_saturated_share", saturated_share(one), "1"),
            (f"fringes/{axis}_phase_residual_rad", phase_residual(one), "rad"),
            (f"fringes/{axis}_noise", noise_map(one), "counts"),
            (f"fringes/{axis}_misfit", one.misfit, "1"),
            (f"fringes/{axis}_wrong_order_probability", one.wrong, "1"),
        ]
        if axis in maps.second_harmonic:
            rows.append((f"fringes/{axis}_second_harmonic", maps.second_harmonic[axis], "1"))
    return rows


def phase_residual(one: AxisCoordinates) -> np.ndarray:
    """What the fits leave, as a phase [series, rows, columns]: residual over amplitude."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share: np.ndarray = one.residual / one.amplitude
        return share


def noise_map(one: AxisCoordinates) -> np.ndarray:
    """Noise of a sample [rows, columns] by the noise found in all pixels, at the pixel's mean light; NaN if unknown."""
    mean = np.asarray(one.offset, float).mean(axis=0)
    noise = one.survey.noise
    found: np.ndarray = np.full(mean.shape, np.nan) if noise is None else np.sqrt(noise.variance(mean))
    return np.where(np.isfinite(mean), found, np.nan)


def saturated_share(one: AxisCoordinates) -> np.ndarray:
    """Share [rows, columns] of the axis' samples that are saturated or no numbers."""
    share: np.ndarray = one.missing / one.fringes.count
    return share


def weakest_modulation(found: ScreenCoordinates) -> np.ndarray:
    """The least modulation [rows, columns] of all series."""
    least: np.ndarray = np.minimum(*(one.modulation.min(axis=0) for one in found.axes.values()))
    return least


def screen_rows(points_mm: FloatArray, result: Reconstruction) -> Rows:
    """Where the pixels' places are, [rows, columns, 3] in the screen's frame, and their standard errors; upright."""
    errors = result.place_errors_mm or (np.full(result.mask.shape, np.nan),) * 2
    return [
        *((f"screen/{axis}_mm", points_mm[..., k], "mm") for k, axis in enumerate("xyz")),
        *((f"screen/{axis}_standard_error_mm", error, "mm") for axis, error in zip("xy", errors, strict=True)),
    ]


def surface_rows(result: Reconstruction, bars: ErrorBars) -> Rows:
    """Mirror points, slopes and heights with standard errors, upright."""
    islands = result.islands or separate_islands(result.mask)
    return [
        ("mask", result.mask, "1"),
        ("islands", islands.label, "1"),
        ("island_groups", islands.group_map, "1"),
        ("mirror/x_mm", result.x_mm, "mm"),
        ("mirror/y_mm", result.y_mm, "mm"),
        ("slope/x_rad", result.slope_x, "rad"),
        ("slope/y_rad", result.slope_y, "rad"),
        ("slope/x_standard_error_rad", bars.slope_x, "rad"),
        ("slope/y_standard_error_rad", bars.slope_y, "rad"),
        ("height_mm", result.height_mm, "mm"),
        ("deviation_nm", result.deviation_mm * 1e6, "nm"),
        ("height_standard_error_nm", bars.height_mm * 1e6, "nm"),
    ]
