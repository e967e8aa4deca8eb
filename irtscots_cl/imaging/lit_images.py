"""Light curves from image files of which little is stored: of each pixel the lines that hold all of its light."""

from __future__ import annotations

import math

import h5py
import numpy as np

from irtscots_cl.formats.sparse_hdf5 import Tile, read_tiles
from irtscots_cl.imaging.bad_values import check_values
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.system import interruption


def lit_curves(images: h5py.Dataset, tiles: list[Tile], name: str) -> tuple[IntArray, FloatArray]:
    """First lines [pixels] and light curves [pixels, window] of images [lines, rows, columns], pixels as in the file.

    tiles: those of the file; all else is dark. The window is the shortest that holds all light of every pixel; it lies
    on the scan's lines. Raises ValueError, named by `name`, for an infinite value.
    """
    count, shape = len(images), images.shape[1:]
    number = np.arange(math.prod(shape)).reshape(shape)
    parts, window = [], 1
    for tile, values in read_tiles(images, tiles):
        interruption.check()
        check_values(name, values, nan_allowed=True, first=(tile.first_line, tile.row, tile.column))
        rows, columns = values.shape[1:]
        pixels = number[tile.row : tile.row + rows, tile.column : tile.column + columns].ravel()
        begin, curves = _shortest(values.reshape(len(values), -1))
        parts.append((pixels, tile.first_line + begin, curves))
        window = max(window, curves.shape[1])
    first, flux = np.zeros(number.size, np.int64), np.zeros((number.size, window))
    for pixels, begin, curves in parts:
        first[pixels] = np.minimum(begin, count - window)
        at = (begin - first[pixels])[:, None] + np.arange(curves.shape[1])
        flux[pixels[:, None], at] = curves
    return first, flux


def _shortest(values: FloatArray) -> tuple[IntArray, FloatArray]:
    """First lines [n] and curves [n, window] of values [lines, n], with the shortest window that holds all light."""
    count, lit = len(values), values != 0  # NaN, a missing sample, is light
    some = lit.any(0)
    begin = np.where(some, lit.argmax(0), 0)
    end = np.where(some, count - lit[::-1].argmax(0), 1)
    window = int((end - begin).max())
    begin = np.minimum(begin, count - window)
    return begin, np.take_along_axis(values, begin + np.arange(window)[:, None], 0).T
