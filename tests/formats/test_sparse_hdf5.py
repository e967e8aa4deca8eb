"""Datasets of which little is stored: what is read, by plain h5py too, and what is left out."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from irtscots_cl.formats.sparse_hdf5 import CHUNK, Tile, create_sparse, read_tiles, stored_tiles, write_tile

SHAPE = (20, 70, 40)  # lines, rows, columns: no multiple of a chunk's


def tile_of(values, row, column):
    """The values of a tile, as write_tile takes them: 0 beyond the edges."""
    tile = np.zeros((len(values), *CHUNK[1:]))
    part = values[:, row : row + CHUNK[1], column : column + CHUNK[2]]
    tile[:, : part.shape[1], : part.shape[2]] = part
    return tile


@pytest.fixture
def written(tmp_path):
    """A file with light in two tiles of six, and what it should hold."""
    values = np.zeros(SHAPE)
    values[9:13, 3, 5] = [1.5, -2.0, np.nan, 1e-300]
    values[19, 69, 39] = 7.0
    with h5py.File(tmp_path / "a.h5", "w") as file:
        dataset = create_sparse(file, "images/x", SHAPE, "W")
        write_tile(dataset, 0, 0, 8, tile_of(values, 0, 0)[8:])
        write_tile(dataset, 64, 32, 0, tile_of(values, 64, 32))
    return tmp_path / "a.h5", values


def test_plain_h5py_reads_all_values(written):
    path, values = written
    with h5py.File(path) as file:
        assert file["images/x"].attrs["unit"] == "W"
        np.testing.assert_array_equal(file["images/x"][()], values)


def test_only_chunks_with_values_are_stored(written):
    with h5py.File(written[0]) as file:
        assert file["images/x"].id.get_num_chunks() == 2
        assert stored_tiles(file["images/x"]) == [Tile(0, 0, 8, 16), Tile(64, 32, 16, 20)]


def test_stored_tiles_hold_all_that_is_not_0(written):
    path, values = written
    found = np.zeros(SHAPE)
    with h5py.File(path) as file:
        for tile, part in read_tiles(file["images/x"], stored_tiles(file["images/x"])):
            rows, columns = part.shape[1:]
            place = np.s_[tile.row : tile.row + rows, tile.column : tile.column + columns]
            found[tile.first_line : tile.end_line][:, *place] = part
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize("options", [{}, {"chunks": CHUNK, "fillvalue": np.nan}, {"chunks": (1, 70, 40)}])
def test_other_datasets_are_read_whole(tmp_path, options):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        dataset = file.create_dataset("x", SHAPE, "f8", **options)
        if options.get("chunks") == (1, 70, 40):
            dataset[:11] = 1.0  # more than half
        assert stored_tiles(dataset) is None


def test_a_dataset_without_any_value_has_no_tiles(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        dataset = create_sparse(file, "x", (3, 2, 2), "W", np.nan)
        assert np.isnan(dataset[()]).all() and dataset.chunks == (3, 2, 2)
        assert stored_tiles(create_sparse(file, "y", (3, 2, 2), "W")) == []
