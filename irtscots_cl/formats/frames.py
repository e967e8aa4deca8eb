"""What all readers of camera images share: a file's frames, checks of sizes, and a library's errors as one line."""

from __future__ import annotations

import logging
import math
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.system.memory import check_memory

Frame = NDArray[Any]

MAX_FRAME_VALUES = 2**28  # of one image: four times the largest camera's
MAX_FRAMES = 2**20  # of one file
# Bytes of an image for a byte in the file. Deflate reaches 1032, LZW about 2700; what packs more packs no measurement.
MAX_UNPACKED = 4096
BYTE_ORDERS = ("little", "big")
ROW_ORDERS = ("bottom-up", "top-down")


@dataclass(frozen=True)
class ReadOptions:
    """What a file cannot be trusted with. None: as the file says, or as found from its data.

    ser_byte_order: "little" or "big", of 16-bit SER files. fits_rows: whether a FITS file's first row is the picture's
    bottom ("bottom-up") or top ("top-down"). npz_array: name of the array in an NPZ file, or of the dataset in an HDF5
    file.
    """

    ser_byte_order: str | None = None
    fits_rows: str | None = None
    npz_array: str | None = None

    def __post_init__(self) -> None:
        for name, allowed in (("ser_byte_order", BYTE_ORDERS), ("fits_rows", ROW_ORDERS)):
            value = getattr(self, name)
            if value is not None and value not in allowed:
                raise ValueError(f"{name} = {value!r}: must be one of {', '.join(map(repr, allowed))}")


@dataclass(frozen=True)
class ImageFile:
    """The frames of one file, none of them read yet.

    shape: (rows, columns) as `read` gives them: first row at the picture's top. dtype: of `read`, in this machine's
    byte order. bits: of a sample as the camera stored it, without sign; 0 for floating point. notes: what was found
    or done that a reader of the results should know. read: a frame [rows, columns] by its number, from 0; raises
    ValueError, with one line that names the file, for what cannot be read. times: of the frames, where the file has
    them, as datetime64[us] in UTC. exposure_s: of every frame, where the file says one.
    """

    path: Path
    shape: tuple[int, int]
    count: int
    dtype: np.dtype[Any]
    bits: int
    read: Callable[[int], Frame] = field(repr=False, compare=False)
    notes: tuple[str, ...] = ()
    times: NDArray[np.datetime64] | None = field(default=None, repr=False, compare=False)
    exposure_s: float | None = None

    @property
    def saturation(self) -> float:
        """The largest count that the bits can hold; infinite for floating point."""
        return 2.0**self.bits - 1 if self.bits else math.inf


def check_size(
    where: Path | str, columns: int, rows: int, count: int, value_bytes: float, stored: int, ratio: float
) -> None:
    """Refuse, with a ValueError, sizes that no camera has, that the file cannot hold, or that the memory cannot.

    where: the file, or a part of it, for the message. stored: bytes that the file holds of all frames. ratio: bytes of
    an image that one of them can stand for.
    """
    size = f"{columns} x {rows} pixels"
    if columns < 1 or rows < 1 or columns * rows > MAX_FRAME_VALUES:
        raise ValueError(f"{where}: {size}: must be at least 1 x 1, at most {MAX_FRAME_VALUES} in all")
    if not 1 <= count <= MAX_FRAMES:
        raise ValueError(f"{where}: {count} frames: must be 1 to {MAX_FRAMES}")
    claimed = math.ceil(columns * rows * count * value_bytes)
    if claimed > ratio * stored:
        raise ValueError(
            f"{where}: claims {count} frame{'s' * (count > 1)} of {size} = {claimed} bytes, of which the file holds "
            f"{stored}: cut off or broken"
        )
    check_memory(f"{where}: an image of {size}", 24.0 * columns * rows)  # as stored, and twice as float64


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Turn whatever a library raises for a broken file into a ValueError of one line; own lines pass unchanged. What it
    warns of or logs is not shown: what matters of it is checked here.

    what: the kind of file, as in "TIFF".
    """
    logger = logging.getLogger("tifffile")
    before = logger.disabled
    try:
        logger.disabled = True
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except InterruptedError:
        raise
    except OSError as error:
        raise ValueError(f"{path}: not a readable {what} file: {error.strerror or first_line(error)}") from None
    except Exception as error:  # the libraries raise some twenty kinds for broken files
        if isinstance(error, ValueError) and str(error).startswith(f"{path}: "):
            raise
        raise ValueError(f"{path}: not a readable {what} file: {first_line(error)}") from None
    finally:
        logger.disabled = before


def first_line(error: BaseException) -> str:
    """What an error says, in one printable line of at most 200 characters."""
    lines = str(error.args[0] if error.args else error).splitlines()
    text = "".join(c if c.isprintable() else "?" for c in lines[0]) if lines else ""
    return text[:200] or type(error).__name__


def natural_key(name: str) -> tuple[list[tuple[int, str]], str]:
    """For sorting names with the numbers in them by value: frame_2 before frame_10."""
    parts = re.findall(r"[0-9]+|[^0-9]+", name)
    digits = [part.lstrip("0") if part[0] in "0123456789" else None for part in parts]
    return [(2**31, p.casefold()) if d is None else (len(d), d) for p, d in zip(parts, digits, strict=True)], name


def native(image: Frame) -> Frame:
    """The same values in this machine's byte order."""
    return np.asarray(image, image.dtype.newbyteorder("="))


def upright(image: Frame, orientation: int) -> Frame:
    """An image as it is to be seen, by the Orientation (1 to 8) of TIFF 6.0 and Exif that says how it is stored."""
    image = image.T if orientation >= 5 else image
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    return np.ascontiguousarray(image)


def upright_shape(shape: tuple[int, int], orientation: int) -> tuple[int, int]:
    """(rows, columns) of `upright`."""
    return (shape[1], shape[0]) if orientation >= 5 else shape


def exposure_time(value: Any) -> float | None:
    """An exposure time [s] as a header has it: a number, or a ratio of two. None for what is none."""
    try:
        top, bottom = value if isinstance(value, tuple) else (value, 1)
        seconds = float(top) / float(bottom)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return seconds if 0 < seconds < math.inf else None


def check_orientation(path: Path, orientation: Any) -> int:
    """An Orientation tag's value; 1 where there is none. Raises ValueError for one that does not exist."""
    if orientation is None:
        return 1
    if not isinstance(orientation, int) or not 1 <= orientation <= 8:
        raise ValueError(f"{path}: Orientation = {str(orientation)[:40]}: must be 1 to 8")
    return orientation


def orientation_note(orientation: int) -> tuple[str, ...]:
    return () if orientation == 1 else (f"Orientation {orientation} of the file applied",)
