"""HDF5 files: datasets with a unit are written; those of others are checked before their values are read, and all that
is wrong is one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from irtscots_cl.maths.arrays import FloatArray

MAX_TEXT = 1000  # characters of a name or a remark
SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 files do."""
    try:
        with open(path, "rb") as file:
            return file.read(len(SIGNATURE)) == SIGNATURE
    except OSError:
        return False


def groups_of(path: Path) -> tuple[str, ...]:
    """Names of the groups at the top of an HDF5 file, in this file itself; none for one that cannot be read."""
    try:
        with h5py.File(path, "r") as file:
            own = [name for name in file if isinstance(file.get(name, getlink=True), h5py.HardLink)]
            return tuple(name for name in own if file.get(name, getclass=True) is h5py.Group)
    except (OSError, RuntimeError, KeyError):
        return ()


def write_dataset(file: h5py.File, name: str, values: npt.ArrayLike, unit: str) -> h5py.Dataset:
    """A compressed dataset with the attribute `unit`, where h5py makes the groups of its name."""
    data = np.asarray(values)
    dataset = file.create_dataset(name, data=data, compression="gzip", compression_opts=1, shuffle=True)
    dataset.attrs["unit"] = unit
    return dataset


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """A file for reading. Raises ValueError, with one line, for what h5py cannot read in it."""
    if not path.is_file():
        why = "it is a folder" if path.is_dir() else "there is no file of that name"
        raise ValueError(f"{path}: not a readable HDF5 file: {why}")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except InterruptedError:
        raise
    except (OSError, RuntimeError, KeyError) as error:  # h5py raises any of them for broken files and endless links
        text = str(error.args[0] if error.args else error)
        raise ValueError(f"{path}: not a readable HDF5 file: {(text.splitlines() or ['?'])[0]}") from None


class GroupReader:
    """Datasets of one group of a file."""

    def __init__(self, file: h5py.File, path: Path, group: str):
        self.file, self.path, self.group = file, path, group

    def dataset(self, name: str) -> h5py.Dataset:
        """A dataset that is stored in this file itself; its values are not read yet."""
        place = f"{self.group}/{name}"
        links = [self.file.get(part, getlink=True) for part in (self.group, place)]
        elsewhere = any(isinstance(link, h5py.ExternalLink) for link in links)
        data = None if elsewhere else self.file.get(place)
        if elsewhere or (isinstance(data, h5py.Dataset) and (data.external or data.is_virtual)):
            raise self.problem(name, "its values are in another file; must be in this one")
        if not isinstance(data, h5py.Dataset):
            raise self.problem(name, f"{'missing' if data is None else 'a group'}; must be a dataset")
        return data

    def numbers(self, name: str, *shape: int | None, most: int = 2**16) -> FloatArray:
        """Finite numbers of a shape, where None stands for any length; at most so many.

        Axes of length 1 in the file may be more or fewer than asked for.
        """
        data = self.dataset(name)
        asked = f"{'x'.join('n' if n is None else str(n) for n in shape) or 'one'} numbers"
        asked += f", at most {most}" if None in shape else ""
        if data.dtype.kind not in "fiu" or data.shape is None or not 1 <= data.size <= most:
            found = "empty" if data.shape is None else f"of shape {list(data.shape)} and type {data.dtype}"
            raise self.problem(name, f"{found}; must be {asked}")
        lengths, wanted = ([n for n in sizes if n != 1] for sizes in (data.shape, shape))
        if len(lengths) < len(wanted):  # an axis of any length may have the length 1
            wanted = [n for n in wanted if n is not None]
        if len(lengths) != len(wanted) or any(a is not None and a != b for a, b in zip(wanted, lengths, strict=True)):
            raise self.problem(name, f"of shape {list(data.shape)}; must be {asked}")
        values: FloatArray = np.asarray(data[()], float).reshape([-1 if n is None else n for n in shape])
        if not np.isfinite(values).all():
            raise self.problem(name, "holds a value that is no finite number")
        return values

    def text(self, name: str) -> str:
        """A short text; empty where there is none."""
        place = f"{self.group}/{name}"
        data = None if isinstance(self.file.get(place, getlink=True), h5py.ExternalLink) else self.file.get(place)
        if not isinstance(data, h5py.Dataset) or data.shape != () or not h5py.check_string_dtype(data.dtype):
            return ""
        return str(data.asstr(errors="replace")[()])[:MAX_TEXT]

    def problem(self, name: str, what: str) -> ValueError:
        return ValueError(f"{self.path}: {self.group}/{name}: {what}")
