"""HDF5 datasets of images that are dark almost everywhere: only chunks with light are stored, and read.

A chunk that was never written takes no place in a file and reads as the fill value, 0. So a dataset keeps the shape
that its readers expect, and takes the size and the time of what differs from 0.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import NamedTuple

import h5py
import numpy as np

from irtscots_cl.maths.arrays import FloatArray

CHUNK = (8, 32, 32)  # lines, rows, columns: neighbours are lit by neighbouring lines, and one line reads fast enough
LEVEL = 1  # of deflate: level 4 takes half as long again for a twentieth of the size


class Tile(NamedTuple):
    """The rows and columns of one chunk, from its first, and the lines from the first to before the end."""

    row: int
    column: int
    first_line: int
    end_line: int


def create_sparse(file: h5py.File, name: str, shape: tuple[int, ...], unit: str, fill: float = 0.0) -> h5py.Dataset:
    """A dataset [lines, rows, columns] of float64 without any value yet: it reads as `fill`."""
    chunk = tuple(min(size, limit) for size, limit in zip(shape, CHUNK, strict=True))
    dataset = file.create_dataset(
        name, shape, np.float64, chunks=chunk, compression="gzip", compression_opts=LEVEL, shuffle=True, fillvalue=fill
    )
    dataset.attrs["unit"] = unit
    return dataset


def write_tile(dataset: h5py.Dataset, row: int, column: int, line: int, values: FloatArray) -> None:
    """Write lines [lines, chunk rows, chunk columns] of a tile that nothing was written to yet.

    row, column, line: the first of a chunk. Values beyond the dataset's edges must be 0, as fill whole chunks do.
    Chunks of zeros alone are left out; NaN is a value.
    """
    step = dataset.chunks[0]
    for first in range(0, len(values), step):
        chunk = values[first : first + step]
        if not chunk.any():
            continue
        if len(chunk) < step:
            chunk = np.concatenate([chunk, np.zeros((step - len(chunk), *chunk.shape[1:]))])
        shuffled = np.ascontiguousarray(chunk).view(np.uint8).reshape(-1, chunk.itemsize).T  # as HDF5's own filter
        dataset.id.write_direct_chunk((line + first, row, column), zlib.compress(shuffled.tobytes(), LEVEL))


def stored_tiles(dataset: h5py.Dataset, most: float = 0.5) -> list[Tile] | None:
    """The tiles of a dataset [lines, rows, columns] in which there are values, with the lines of their chunks.

    None for a dataset that is not in chunks, that does not read as 0 where there are none, or whose tiles are more than
    the share `most` of it.
    """
    if dataset.ndim != 3 or dataset.chunks is None or dataset.fillvalue != 0 or not hasattr(dataset.id, "chunk_iter"):
        return None
    found: dict[tuple[int, int], tuple[int, int]] = {}

    def add(chunk: h5py.h5d.StoreInfo) -> None:
        line, row, column = chunk.chunk_offset
        low, high = found.get((row, column), (line, line))
        found[row, column] = (min(low, line), max(high, line))

    dataset.id.chunk_iter(add)
    (step, rows, columns), count = dataset.chunks, len(dataset)
    tiles = [Tile(*place, low, min(high + step, count)) for place, (low, high) in sorted(found.items())]
    size = sum(tile.end_line - tile.first_line for tile in tiles) * rows * columns
    return tiles if size <= most * dataset.size else None


def read_tiles(dataset: h5py.Dataset, tiles: list[Tile]) -> Iterator[tuple[Tile, np.ndarray]]:
    """Each of the tiles with its values [lines, rows, columns]; those at the edges are cut off there."""
    _, rows, columns = dataset.chunks
    for tile in tiles:
        row, column = slice(tile.row, tile.row + rows), slice(tile.column, tile.column + columns)
        yield tile, dataset[tile.first_line : tile.end_line, row, column]
