"""result.h5: images, maps and their units."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from irtscots_cl.formats.hdf5 import write_dataset
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.orientation import stored
from irtscots_cl.maths.integration import separate_islands
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.image_datasets import write_images
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import replacing


def write_result(
    path: Path,
    stack: ImageStack,
    result: Reconstruction,
    attributes: dict[str, str],
    bars: ErrorBars | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write result.h5: images [lines, rows, columns] in the stack's unit with standard errors, lines, mirror points,
    mask, centroids, slopes and height. attributes: of the file (scene as TOML, seed, device, versions). bars: standard
    errors from the noise of the images, where the measure gives them; else those of the height are the replicates'.
    progress(done, total): called now and then, with numbers of light curves.

    Images and maps lie in the file as the scene's `camera.detector.orientation` says; the attribute names it.
    """
    orientation = result.nominal.camera.detector.orientation
    islands = result.islands or separate_islands(result.mask)
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        for key, value in attributes.items():
            file.attrs[key] = value
        file.attrs["orientation"] = orientation
        for scan in (stack.x, stack.y):
            write_images(file, scan, orientation, progress and _of_both(progress, stack, scan))
            _write(file, f"lines/{scan.axis}_mm", scan.positions_mm, "mm")
            if len(scan.positions_mm) > 1:
                width_mm = scan.line_width * np.diff(scan.positions_mm).mean()
                file[f"lines/{scan.axis}_mm"].attrs["line_width_mm"] = width_mm
        for name, values, unit in (
            ("mirror/x_mm", result.x_mm, "mm"),
            ("mirror/y_mm", result.y_mm, "mm"),
            ("mask", result.mask, "1"),
            ("islands", islands.label, "1"),
            ("island_groups", islands.group_map, "1"),
            ("flags", result.flags, "1"),
            ("centroid/x_mm", result.centroid_x_mm, "mm"),
            ("centroid/y_mm", result.centroid_y_mm, "mm"),
            ("slope/x_rad", result.slope_x, "rad"),
            ("slope/y_rad", result.slope_y, "rad"),
            ("height_mm", result.height_mm, "mm"),
            ("deviation_nm", result.deviation_mm * 1e6, "nm"),
            ("height_standard_error_nm", (bars.height_mm if bars else result.height_standard_error_mm()) * 1e6, "nm"),
            *_error_maps(result, bars),
        ):
            _write(file, name, stored(values, orientation), unit)


def _of_both(progress: Callable[[int, int], None], stack: ImageStack, scan: Scan) -> Callable[[int, int], None]:
    """The progress of one scan as that of both, x first."""
    before, total = 0 if scan is stack.x else len(stack.x.pixels), len(stack.x.pixels) + len(stack.y.pixels)
    return lambda done, _: progress(before + done, total)


def _error_maps(result: Reconstruction, bars: ErrorBars | None) -> list[tuple[str, np.ndarray, str]]:
    """Standard errors of centroids and slopes, and the chi-square of the light curves, by name and with their unit."""
    if bars is None:
        return []
    maps = [("slope/x_standard_error_rad", bars.slope_x, "rad"), ("slope/y_standard_error_rad", bars.slope_y, "rad")]
    for estimate in result.estimates_of_scans or ():
        axis = estimate.scan.axis
        for name, values, unit in (
            (f"centroid/{axis}_standard_error_mm", estimate.error_mm, "mm"),
            (f"light_curve/{axis}_chi_square", estimate.chi_square, "1"),
        ):
            on_grid = np.full(result.mask.shape, np.nan)
            on_grid.ravel()[estimate.scan.pixels] = values
            maps.append((name, on_grid, unit))
    return maps


def _write(file: h5py.File, name: str, values: np.ndarray, unit: str) -> None:
    interruption.check()
    write_dataset(file, name, values, unit)
