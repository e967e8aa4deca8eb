"""NumPy's NPZ and NPY files with frames: read one frame at a time, and never any code from them.

Arrays are [frames, rows, columns], or [rows, columns] for one frame.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from irtscots_cl.formats.frames import Frame, ImageFile, ReadOptions, check_size, native, natural_key, reading

DEFLATE_RATIO = 1032.0
CHANNELS = (3, 4)  # length of a last axis that is colour
STORED, DEFLATED = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED


class _Array:
    """An array's header: shape [frames, rows, columns], dtype as stored, whether columns come first in memory, and the
    bytes before its values."""

    def __init__(self, where: str, stream: IO[bytes]):
        version = np.lib.format.read_magic(stream)
        readers: dict[tuple[int, int], Any] = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        if version not in readers:
            raise ValueError(f"{where}: version {version} of the NPY format: must be 1.0 or 2.0")
        shape, self.fortran, self.dtype = readers[version](stream)
        self.start = stream.tell()
        if self.dtype.hasobject or self.dtype.kind not in "uif" or self.dtype.itemsize > 8:
            raise ValueError(f"{where}: values of type {str(self.dtype)[:40]}: must be real numbers of 8 to 64 bits")
        if len(shape) not in (2, 3):
            raise ValueError(f"{where}: shape {list(shape)}: must be [frames, rows, columns] or [rows, columns]")
        if len(shape) == 3 and shape[-1] in CHANNELS and min(shape[:2]) > max(CHANNELS):
            raise ValueError(f"{where}: shape {list(shape)}: colour; must be grey, [frames, rows, columns]")
        self.axes = len(shape)
        self.shape: tuple[int, int, int] = (1, *shape)[-3:]
        if self.fortran and self.axes == 3 and self.shape[0] > 1:
            raise ValueError(f"{where}: a stack in Fortran order: must be in C order (numpy.ascontiguousarray)")

    @property
    def frame_bytes(self) -> int:
        return self.shape[1] * self.shape[2] * int(self.dtype.itemsize)

    def frame(self, where: str, stream: IO[bytes]) -> Frame:
        """The next frame of a stream."""
        data = stream.read(self.frame_bytes)
        if len(data) < self.frame_bytes:
            raise ValueError(f"{where}: cut off")
        rows, columns = self.shape[1:]
        values = native(np.frombuffer(data, self.dtype))
        return values.reshape(columns, rows).T.copy() if self.fortran else values.reshape(rows, columns).copy()


def open_npy(path: Path, options: ReadOptions) -> ImageFile:
    """The frames of an NPY file. Raises ValueError, with one line, for another kind of array."""
    with reading(path, "NPY"), open(path, "rb") as file:
        array = _Array(str(path), file)
        stored = path.stat().st_size - array.start
        check_size(path, array.shape[2], array.shape[1], array.shape[0], array.dtype.itemsize, stored, 1)

    def read(number: int) -> Frame:
        with reading(path, "NPY"), open(path, "rb") as file:
            file.seek(array.start + number * array.frame_bytes)
            return array.frame(str(path), file)

    return _image_file(path, array, array.shape[0], read, ())


def open_npz(path: Path, options: ReadOptions) -> ImageFile:
    """The frames of an NPZ file: of the array named in the options, of its only stack, or its images in natural order
    of their names. Raises ValueError, with one line, for other contents."""
    with reading(path, "NPZ"), zipfile.ZipFile(path) as archive:
        arrays = {}
        for info in archive.infolist():
            name = info.filename.removesuffix(".npy")
            if options.npz_array in (None, name):
                arrays[name] = _header(path, name, info, archive)
    names, notes = _chosen(path, arrays, options)
    first = arrays[names[0]]
    for name in names[1:]:
        if (arrays[name].shape, arrays[name].dtype) != (first.shape, first.dtype):
            raise ValueError(
                f"{path}: array {name}: shape {list(arrays[name].shape[1:])}, {arrays[name].dtype}; {names[0]} has "
                f"{list(first.shape[1:])}, {first.dtype}: must be equal"
            )
    frames = _Frames(path, arrays, names)
    return _image_file(path, first, len(names) * first.shape[0], frames.read, notes)


def _header(path: Path, name: str, info: zipfile.ZipInfo, archive: zipfile.ZipFile) -> _Array:
    where = f"{path}: array {name[:40]}"
    if info.flag_bits & 1 or info.compress_type not in (STORED, DEFLATED):
        raise ValueError(f"{where}: encrypted, or packed in another way than NumPy does")
    with archive.open(info) as stream:
        array = _Array(where, stream)
    count, rows, columns = array.shape
    stored = min(info.compress_size, path.stat().st_size)
    ratio = 1.0 if info.compress_type == STORED else DEFLATE_RATIO
    check_size(where, columns, rows, count, array.dtype.itemsize, stored, ratio)
    if info.file_size < array.start + math.prod(array.shape) * array.dtype.itemsize:
        raise ValueError(f"{where}: claims {list(array.shape)} values, and has {info.file_size} bytes: cut off")
    return array


def _chosen(path: Path, arrays: dict[str, _Array], options: ReadOptions) -> tuple[list[str], tuple[str, ...]]:
    """Names of the arrays with the frames, and a note on those left out."""
    if not arrays:
        wanted = "no array in it" if options.npz_array is None else f"no array {options.npz_array!r} in it"
        raise ValueError(f"{path}: {wanted}")
    stacks = [name for name, array in arrays.items() if array.axes == 3]
    if not stacks:
        return sorted(arrays, key=natural_key), ()
    if len(stacks) > 1:
        raise ValueError(f"{path}: several stacks ({', '.join(stacks[:4])}): name one (npz_array)")
    others = [name for name in arrays if name not in stacks]
    return stacks, (f"arrays left out: {', '.join(others[:4])}",) if others else ()


class _Frames:
    """Reads the frames of an NPZ file. A packed array cannot be entered in its middle, so the place is kept for the
    next frame: reading in order unpacks each once."""

    def __init__(self, path: Path, arrays: dict[str, _Array], names: list[str]):
        self.path, self.arrays, self.names = path, arrays, names
        self.archive: zipfile.ZipFile | None = None
        self.stream: IO[bytes] | None = None
        self.next = -1

    def __del__(self) -> None:
        for opened in (self.stream, self.archive):
            if opened is not None:
                opened.close()

    def read(self, number: int) -> Frame:
        each = self.arrays[self.names[0]].shape[0]
        name, k = self.names[number // each], number % each
        array, where = self.arrays[name], f"{self.path}: array {name[:40]}"
        with reading(self.path, "NPZ"):
            if self.stream is None or number != self.next or k == 0:
                self.archive = self.archive or zipfile.ZipFile(self.path)
                if self.stream is not None:
                    self.stream.close()
                self.stream = self.archive.open(f"{name}.npy" if f"{name}.npy" in self.archive.namelist() else name)
                self.stream.seek(array.start + k * array.frame_bytes)
            self.next = -1  # unless the frame is read
            image = array.frame(where, self.stream)
            self.next = number + 1
            return image


def _image_file(path: Path, array: _Array, count: int, read: Any, notes: tuple[str, ...]) -> ImageFile:
    dtype = array.dtype.newbyteorder("=")
    bits = {"u": 8 * dtype.itemsize, "i": 8 * dtype.itemsize - 1, "f": 0}[dtype.kind]
    return ImageFile(path, array.shape[1:], count, dtype, bits, read, notes)
