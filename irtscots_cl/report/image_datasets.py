"""The images of a scan in result.h5: whole images for whoever reads them, lit chunks alone in the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import h5py
import numpy as np

from irtscots_cl.formats.sparse_hdf5 import create_sparse, write_tile
from irtscots_cl.imaging.image_stack import Scan
from irtscots_cl.imaging.orientation import stored, stored_shape
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.system import interruption


def write_images(
    file: h5py.File, scan: Scan, orientation: str, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write images/AXIS and images/AXIS_standard_error [lines, rows, columns], tile by tile of the detector.

    orientation: how images lie in the file. progress(done, total): called after each tile, with numbers of light
    curves. The standard error of a single replicate is not known: all NaN.
    """
    shape = (len(scan.positions_mm), *stored_shape(scan.shape, orientation))
    unknown = len(scan.weights) < 2
    images = create_sparse(file, f"images/{scan.axis}", shape, scan.unit)
    errors = create_sparse(file, f"images/{scan.axis}_standard_error", shape, scan.unit, np.nan if unknown else 0.0)
    done = 0
    for row, column, chosen, place in _tiles(scan, orientation, images.chunks[1:]):
        interruption.check()
        part = scan.part(chosen)
        jackknife = part.jackknife_w()
        _write(images, row, column, part.lines, place, jackknife[0])
        if not unknown:
            _write(errors, row, column, part.lines, place, jackknife_error(jackknife))
        done += len(chosen)
        if progress is not None:
            progress(done, len(scan.pixels))


def _tiles(scan: Scan, orientation: str, size: tuple[int, int]) -> Iterator[tuple[int, int, IntArray, IntArray]]:
    """First row and column in the file of each tile with light curves, their numbers [n] and their places [n] in it."""
    upright = np.arange(scan.shape[0] * scan.shape[1]).reshape(scan.shape)
    in_file = stored(upright, orientation)
    at = np.empty(upright.size, np.int64)
    at[in_file.ravel()] = upright.ravel()  # where each upright pixel lies in the file
    row, column = np.divmod(at[scan.pixels], in_file.shape[1])
    tile_row, tile_column = row // size[0], column // size[1]
    across = -(-in_file.shape[1] // size[1])
    tile = tile_row * across + tile_column
    place = (row - tile_row * size[0]) * size[1] + column - tile_column * size[1]
    order = np.argsort(tile, kind="stable")
    for chosen in np.split(order, np.flatnonzero(np.diff(tile[order])) + 1):
        if chosen.size:
            number = int(tile[chosen[0]])
            yield number // across * size[0], number % across * size[1], chosen, place[chosen]


def _write(dataset: h5py.Dataset, row: int, column: int, lines: IntArray, place: IntArray, values: FloatArray) -> None:
    """Write the curves [n, window] of the pixels at the places [n] of a tile."""
    step, *size = dataset.chunks
    lit = (values != 0) & (lines < len(dataset))
    if not lit.any():
        return
    of_lit = lines[lit]
    first = int(of_lit.min()) // step * step
    tile = np.zeros((int(of_lit.max()) + 1 - first, size[0] * size[1]))
    tile[of_lit - first, np.broadcast_to(place[:, None], lit.shape)[lit]] = values[lit]
    write_tile(dataset, row, column, first, tile.reshape(-1, *size))
