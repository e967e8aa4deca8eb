"""HDF5 files with frames: one dataset [frames, rows, columns], of the name given or the only one of that form."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from irtscots_cl.formats.frames import MAX_UNPACKED, Frame, ImageFile, ReadOptions, check_size, native, reading
from irtscots_cl.formats.hdf5 import opened

CHANNELS = (3, 4)  # length of a last axis that is colour
MAX_NAMED = 4


def open_hdf5(path: Path, options: ReadOptions) -> ImageFile:
    """The frames of an HDF5 file. Raises ValueError, with one line, for other contents."""
    with opened(path) as file:
        name = _name(path, file, options)
        data = file[name]
        where, (count, rows, columns) = f"{path}: {name}", data.shape
        if columns in CHANNELS and min(count, rows) > max(CHANNELS):
            raise ValueError(f"{where}: shape {list(data.shape)}: colour; must be grey, [frames, rows, columns]")
        packed = MAX_UNPACKED if data.compression or data.chunks else 1
        check_size(where, columns, rows, count, data.dtype.itemsize, data.id.get_storage_size(), packed)
        dtype = data.dtype.newbyteorder("=")

    def read(number: int) -> Frame:
        with reading(path, "HDF5"), opened(path) as again:
            return native(np.asarray(again[name][number]))

    bits = {"u": 8 * dtype.itemsize, "i": 8 * dtype.itemsize - 1, "f": 0}[dtype.kind]
    return ImageFile(path, (rows, columns), count, dtype, bits, read, (f"frames of dataset {name}",))


def _name(path: Path, file: h5py.File, options: ReadOptions) -> str:
    """Of the dataset with the frames: a stack of numbers in this file itself."""
    stacks: list[str] = []

    def look(name: str, data: Any) -> None:  # visits own groups and datasets alone, no links to other files
        is_own = isinstance(data, h5py.Dataset) and not data.external and not data.is_virtual
        if is_own and data.shape is not None and len(data.shape) == 3 and data.dtype.kind in "uif":
            stacks.append(f"/{name}")

    file.visititems(look)
    wanted = options.npz_array
    if wanted is not None:
        if f"/{wanted.strip('/')}" not in stacks:
            raise ValueError(f"{path}: {wanted!r}: no dataset of real numbers [frames, rows, columns]")
        return f"/{wanted.strip('/')}"
    if len(stacks) != 1:
        told = ", ".join(stacks[:MAX_NAMED])
        raise ValueError(
            f"{path}: {len(stacks) or 'no'} datasets [frames, rows, columns]{f' ({told}): name one' if told else ''}"
        )
    return stacks[0]
