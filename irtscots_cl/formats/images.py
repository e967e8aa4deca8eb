"""A laboratory's camera images: a folder, files, or one file with many frames, read frame by frame.

    frames = open_frames("recorded/")
    frames.count, frames.shape, frames.dtype, frames.saturation, frames.notes
    for image in frames: ...          # [rows, columns], counts as stored; one frame in memory at a time
    frames[7]                         # the eighth frame, read when asked for

TIFF, PNG, FITS, SER, NPZ, NPY and HDF5. Every image has its first row at the picture's top; counts are not scaled.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from threading import Lock
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.frames import Frame, ImageFile, ReadOptions, first_line, natural_key
from irtscots_cl.system import interruption

# Kind of file: the endings of its names, the bytes it begins with.
_KINDS = {
    "TIFF": ((".tif", ".tiff", ".btf"), (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    "PNG": ((".png",), (b"\x89PNG\r\n\x1a\n",)),
    "FITS": ((".fits", ".fit", ".fts", ".fz"), (b"SIMPLE  =",)),
    "SER": ((".ser",), (b"LUCAM-RECORDER",)),
    "NPZ": ((".npz",), (b"PK\x03\x04", b"PK\x05\x06")),
    "NPY": ((".npy",), (b"\x93NUMPY",)),
    "HDF5": ((), (b"\x89HDF\r\n\x1a\n",)),  # by no ending: a folder's results are no images
}
# Known, and no measurement or not read here: what to do instead.
JPEG = b"\xff\xd8\xff"
_REFUSED = {
    JPEG: "a JPEG: its counts are changed by the compression; record TIFF, PNG, FITS or SER",
    b"BM": "a BMP; convert to TIFF or PNG",
    b"\x1f\x8b": "packed by gzip; unpack it first",
}
SUFFIXES = frozenset(suffix for suffixes, _ in _KINDS.values() for suffix in suffixes)
_NAMED = 3  # names in a note


@dataclass(frozen=True)
class FrameSource:
    """The frames of files, in order: images [rows, columns] that are read when they are asked for.

    files: each with its frames. saturation: count at which samples are saturated; infinite where none is known.
    notes: one line each: what was found, done or left out.
    """

    files: tuple[ImageFile, ...]
    saturation: float
    notes: tuple[str, ...]
    _last: dict[int, Frame] = field(default_factory=dict, repr=False, compare=False)
    _lock: Any = field(default_factory=Lock, repr=False, compare=False)  # several threads may ask for frames

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of every frame."""
        return self.files[0].shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of every frame."""
        return self.files[0].dtype

    @property
    def count(self) -> int:
        """Frames of all files."""
        return self._ends[-1]

    def __len__(self) -> int:
        return self.count

    @overload
    def __getitem__(self, number: int) -> Frame: ...
    @overload
    def __getitem__(self, number: slice) -> list[Frame]: ...

    def __getitem__(self, number: int | slice) -> Frame | list[Frame]:
        """A frame, or a list of those of a slice. The last one read is kept: do not write into it."""
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(self.count))]
        number = range(self.count)[number]  # IndexError outside
        with self._lock:
            if number not in self._last:
                self._last.clear()
                self._last[number] = self._read(number)
            return self._last[number]

    def _read(self, number: int) -> Frame:
        interruption.check()
        file, page = self.place(number)
        image = file.read(page)
        if image.shape != file.shape or image.dtype != file.dtype:
            raise ValueError(f"{self.name(number)}: {_form(image.shape, image.dtype)}; its header says otherwise")
        image.flags.writeable = False
        return image

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(self.count))

    def place(self, number: int) -> tuple[ImageFile, int]:
        """The file of a frame, and the frame's number in it."""
        number = range(self.count)[number]  # IndexError outside
        k = bisect_right(self._ends, number)
        return self.files[k], number - (self._ends[k - 1] if k else 0)

    @cached_property
    def _ends(self) -> list[int]:
        """Frames of the files up to each."""
        return list(accumulate(file.count for file in self.files))

    def name(self, number: int) -> str:
        """What to call a frame in messages: its file, and its number there, from 1."""
        file, page = self.place(number)
        return str(file.path) if file.count == 1 else f"{file.path} frame {page + 1}"

    @property
    def times(self) -> NDArray[np.datetime64] | None:
        """When the frames were taken, [count], UTC; None unless all files say so."""
        known = [file.times for file in self.files if file.times is not None]
        return np.concatenate(known) if len(known) == len(self.files) else None

    @property
    def exposures_s(self) -> list[float | None]:
        """Exposure time of every frame, None where its file says none."""
        return [file.exposure_s for file in self.files for _ in range(file.count)]

    def part(self, numbers: Iterable[int]) -> FramePart:
        """Some of the frames, in the order asked for: those of one exposure, or of one manifest's series."""
        return FramePart(self, tuple(range(self.count)[k] for k in numbers))


class AnySource(Protocol):
    """What FramePart takes frames from: a FrameSource, or one that calibrates them."""

    @property
    def shape(self) -> tuple[int, int]: ...
    def __getitem__(self, number: int, /) -> Frame: ...
    def name(self, number: int) -> str: ...


@dataclass(frozen=True)
class FramePart(Sequence[Frame]):
    """Frames of a source in an order of their own, read when they are asked for: a Sequence of images."""

    source: AnySource
    numbers: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, int]:
        return self.source.shape

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, number: int) -> Frame: ...
    @overload
    def __getitem__(self, number: slice) -> list[Frame]: ...

    def __getitem__(self, number: int | slice) -> Frame | list[Frame]:
        if isinstance(number, slice):
            return [self.source[k] for k in self.numbers[number]]
        return self.source[self.numbers[number]]

    def name(self, number: int) -> str:
        return self.source.name(self.numbers[number])


def open_frames(
    paths: str | Path | Sequence[str | Path],
    *,
    saturation: float | None = None,
    options: ReadOptions | None = None,
) -> FrameSource:
    """The frames of a folder, of a file, or of several files in the order given.

    A folder's image files come in natural order (frame_2 before frame_10); hidden files, folders in it and files of
    other kinds are left out, with a note. Only headers are read here, so that thousands of files open quickly; frames
    are read one at a time. saturation: count at which samples are saturated; None: 2^bits - 1 of the files' samples,
    infinite for floating point. options: what the files cannot be trusted with.

    Raises ValueError, with one line that names the file, for what cannot be read: unknown kinds, colour, sizes or
    types that differ among the files, files that are cut off, no images at all, or an optional package that is missing.
    """
    options = options or ReadOptions()
    if saturation is not None and not saturation > 0:
        raise ValueError(f"saturation = {saturation}: must be above 0")
    given = [paths] if isinstance(paths, (str, Path)) else list(paths)
    if not given:
        raise ValueError("no image files")
    found, notes = [], []
    for path in map(Path, given):
        inside, note = _inside(path) if path.is_dir() else ([path], [])
        found += inside
        notes += note
    notes += _order_notes(found) if len(given) > 1 else []
    files = []
    for path in found:
        interruption.check()
        files.append(_open(path, options))
        _check_alike(files[0], files[-1])
    limit = files[0].saturation if saturation is None else float(saturation)
    return FrameSource(tuple(files), limit, (*notes, *_file_notes(files)))


def natural_order(paths: Iterable[Path]) -> list[Path]:
    """Paths by name, numbers in names by their value: frame_2 before frame_10."""
    return sorted(paths, key=lambda path: natural_key(path.name))


def _inside(folder: Path) -> tuple[list[Path], list[str]]:
    """The image files of a folder in natural order, and a note on what was left out."""
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise ValueError(f"{folder}: not a readable folder: {error.strerror or first_line(error)}") from None
    images = [e for e in entries if not is_hidden(e) and e.suffix.lower() in SUFFIXES and e.is_file()]
    others = [e.name for e in entries if e not in set(images)]
    if not images:
        kinds = ", ".join(sorted(SUFFIXES))
        inner = [e.name for e in natural_order(entries) if e.is_dir() and not is_hidden(e)]
        hint = f"; it has the folders {_some(inner)}: name them, in the frames' order" if inner else ""
        if any(e.suffix.lower() in (".jpg", ".jpeg") for e in entries):
            hint += f"; JPEG: {_REFUSED[JPEG].removeprefix('a JPEG: ')}"
        raise ValueError(f"{folder}: no images among its {len(entries)} entries; must be files named {kinds}{hint}")
    kinds_there = sorted({_kind_of_name(e) for e in images})
    if len(kinds_there) > 1:
        raise ValueError(
            f"{folder}: images of several kinds ({', '.join(kinds_there)}): the same frames may be there twice; "
            "name the files"
        )
    return natural_order(images), [f"{folder}: left out: {_some(others)}"] if others else []


def is_hidden(path: Path) -> bool:
    """Whether a file is one that programs and systems put beside others, as ._IMG_1.tif."""
    return path.name.startswith((".", "~")) or path.name.endswith("~")


def _kind_of_name(path: Path) -> str:
    return next((kind for kind, (suffixes, _) in _KINDS.items() if path.suffix.lower() in suffixes), "")


def _order_notes(paths: list[Path]) -> list[str]:
    """A note where files came as a shell sorts them, though their numbers say otherwise."""
    names = [path.name for path in paths]
    natural = [path.name for path in natural_order(paths)]
    if names == natural or names != sorted(names) or len({path.parent for path in paths}) > 1:
        return []
    k = next(k for k, (a, b) in enumerate(zip(names, natural, strict=True)) if a != b)
    return [f"the files are in the order given, which is the alphabet's: {names[k]} before {natural[k]}"]


def _open(path: Path, options: ReadOptions) -> ImageFile:
    try:
        with open(path, "rb") as file:
            start = file.read(16)
    except OSError as error:
        raise ValueError(f"{path}: not a readable image file: {error.strerror or first_line(error)}") from None
    if not start:
        raise ValueError(f"{path}: not a readable image file: 0 bytes")
    for signature, what in _REFUSED.items():
        if start.startswith(signature):
            raise ValueError(f"{path}: {what}")
    for kind, (_, signatures) in _KINDS.items():
        if start.startswith(signatures):
            return _opener(kind)(path, options)
    raise ValueError(f"{path}: not a readable image file: begins as none of {', '.join(_KINDS)} does")


def _opener(kind: str) -> Callable[[Path, ReadOptions], ImageFile]:
    """The reader of a kind of files; the libraries of the others are not imported."""
    if kind == "TIFF":
        from irtscots_cl.formats.tiff import open_tiff as opener
    elif kind == "PNG":
        from irtscots_cl.formats.png import open_png as opener
    elif kind == "FITS":
        from irtscots_cl.formats.fits import open_fits as opener
    elif kind == "SER":
        from irtscots_cl.formats.ser import open_ser as opener
    elif kind == "NPZ":
        from irtscots_cl.formats.npz import open_npz as opener
    elif kind == "HDF5":
        from irtscots_cl.formats.hdf5_frames import open_hdf5 as opener
    else:
        from irtscots_cl.formats.npz import open_npy as opener
    return opener


def _check_alike(first: ImageFile, other: ImageFile) -> None:
    """Refuse, with a ValueError that names the file, frames that do not fit those of the first one."""
    if other.shape != first.shape:
        raise ValueError(
            f"{other.path}: {_size(other.shape)}; {first.path.name} has {_size(first.shape)}: must be equal"
        )
    if (other.dtype, other.bits) != (first.dtype, first.bits):
        kinds = [f"{file.dtype} samples of {file.bits or 8 * file.dtype.itemsize} bits" for file in (other, first)]
        raise ValueError(f"{other.path}: {kinds[0]}; {first.path.name} has {kinds[1]}: must be equal")


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]} pixels"


def _form(shape: tuple[int, ...], dtype: np.dtype[Any]) -> str:
    return f"values of shape {list(shape)} and type {dtype}"


def _file_notes(files: list[ImageFile]) -> list[str]:
    """The files' notes, each once with the files that it is about."""
    about: dict[str, list[str]] = {}
    for file in files:
        for note in file.notes:
            about.setdefault(note, []).append(file.path.name)
    return [f"{_some(names)}: {note}" for note, names in about.items()]


def _some(names: list[str]) -> str:
    shown = ", ".join("".join(c if c.isprintable() else "?" for c in name) for name in names[:_NAMED])
    return shown if len(names) <= _NAMED else f"{shown} and {len(names) - _NAMED} more"
