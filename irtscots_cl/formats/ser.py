"""SER files: series of frames of 8 or 16 bits as programs for astronomical cameras write them, with times in a trailer.

Version 3 of the format: a header of 178 bytes, the frames, and optionally a time for each frame, in units of 100 ns
since the year 1, UTC. The header's flag for the byte order of 16-bit samples says 0 for big-endian, but many programs
write it the other way round, so that it tells nothing: the order is found from the data, or given as an option.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.frames import BYTE_ORDERS, Frame, ImageFile, ReadOptions, check_size, native, reading

HEADER = struct.Struct("<14s7i40s40s40sqq")  # identity, seven numbers, three texts, two times
MONO = 0
COLOURS = {8: "Bayer RGGB", 9: "Bayer GRBG", 10: "Bayer GBRG", 11: "Bayer BGGR", 16: "Bayer CYYM", 17: "Bayer YCMY",
           18: "Bayer YMCY", 19: "Bayer MYYC", 100: "RGB", 101: "BGR"}  # fmt: skip
TRIED = 3  # frames that the byte order is found from
# The wrong order turns the fast low byte into the high one. Its neighbours then differ by far more; white noise over
# all 16 bits alone would give 1.
CLEARLY = 2.0
TICKS_1970 = 621355968000000000  # of 100 ns from the year 1 to 1970
TICKS_10000 = 3155378976000000000


@dataclass(frozen=True)
class _Header:
    colour: int
    flag: int
    columns: int
    rows: int
    bits: int
    count: int

    @property
    def sample_bytes(self) -> int:
        return 1 if self.bits <= 8 else 2

    @property
    def frame_bytes(self) -> int:
        return self.columns * self.rows * self.sample_bytes


def open_ser(path: Path, options: ReadOptions) -> ImageFile:
    """The frames of a SER file. Raises ValueError, with one line, for colour, sizes that do not fit the file, and
    16-bit samples whose byte order the data do not tell."""
    with reading(path, "SER"):
        header = _read_header(path)
        order, bits, notes = _byte_order(path, header, options)
        times, note = _times(path, header)
    dtype = np.dtype("u1" if header.sample_bytes == 1 else "u2")

    def read(number: int) -> Frame:
        with reading(path, "SER"):
            return _read(path, header, order, number)

    shape = (header.rows, header.columns)
    return ImageFile(path, shape, header.count, dtype, bits, read, (*notes, *note), times)


def _read_header(path: Path) -> _Header:
    with open(path, "rb") as file:
        data = file.read(HEADER.size)
    if len(data) < HEADER.size:
        raise ValueError(f"{path}: {len(data)} bytes: a SER file has a header of {HEADER.size}")
    _, _, colour, flag, columns, rows, bits, count, *_ = HEADER.unpack(data)
    if colour != MONO:
        raise ValueError(f"{path}: colour ({COLOURS.get(colour, f'ColorID {colour}')}): must be mono (ColorID 0)")
    if not 1 <= bits <= 16:
        raise ValueError(f"{path}: {bits} bits: must be 1 to 16")
    header = _Header(colour, flag, columns, rows, bits, count)
    stored = path.stat().st_size - HEADER.size
    if count == 0:
        raise ValueError(f"{path}: 0 frames, and {stored} bytes after the header: its recording was not finished")
    check_size(path, columns, rows, count, header.sample_bytes, stored, 1)
    return header


def _read(path: Path, header: _Header, order: str, number: int) -> Frame:
    with open(path, "rb") as file:
        file.seek(HEADER.size + number * header.frame_bytes)
        data = file.read(header.frame_bytes)
    if len(data) < header.frame_bytes:
        raise ValueError(f"{path}: frame {number + 1}: cut off")
    kind = np.dtype("u1") if header.sample_bytes == 1 else np.dtype("<u2" if order == "little" else ">u2")
    return native(np.frombuffer(data, kind).reshape(header.rows, header.columns)).copy()


def _byte_order(path: Path, header: _Header, options: ReadOptions) -> tuple[str, int, tuple[str, ...]]:
    """The byte order, the bits of the samples, and notes on how they are known."""
    if header.sample_bytes == 1:
        return "little", 8, ()
    most = 2**header.bits - 1
    numbers = sorted({round(k * (header.count - 1) / (TRIED - 1)) for k in range(TRIED)})
    traces = [_traces(_read(path, header, "little", number)) for number in numbers]
    highest = {order: max(one.highest[k] for one in traces) for k, order in enumerate(BYTE_ORDERS)}
    found, how = options.ser_byte_order, "as told"
    if found is None:
        found, how = _plausible(traces, highest, most)
    if found is None:
        raise ValueError(
            f"{path}: the byte order of its 16-bit samples cannot be told from the data, and programs do not agree on "
            'the header\'s flag: state it (ser_byte_order, "little" or "big")'
        )
    notes = [f"byte order {found}-endian, {how}"]
    if highest[found] <= most:
        return found, header.bits, tuple(notes)
    notes.append(f"counts up to {highest[found]} though its header says {header.bits} bits: taken as 16")
    return found, 16, tuple(notes)


@dataclass(frozen=True)
class _Traces:
    """What a frame shows of its byte order: the highest count and the roughness by either order (little, big), whether
    any low and any high byte is not 0, and whether both orders give the same."""

    highest: tuple[int, int]
    roughness: tuple[float, float]
    has_low: bool
    has_high: bool
    same: bool


def _traces(image: Frame) -> _Traces:
    swapped = image.byteswap()
    return _Traces(
        (int(image.max()), int(swapped.max())),
        (_roughness(image), _roughness(swapped)),
        bool((image & 0xFF).any()),
        bool((image & 0xFF00).any()),
        bool(np.array_equal(image, swapped)),
    )


def _plausible(traces: list[_Traces], highest: dict[str, int], most: int) -> tuple[str | None, str]:
    """The byte order that the frames can have: counts within the bits, and a picture and not noise."""
    fits = [order for order, count in highest.items() if count <= most]
    if len(fits) == 1:
        return fits[0], "since the counts of the other order are above the header's bits"
    if all(one.same for one in traces):
        return "little", "which does not matter for its data"
    if any(one.has_low for one in traces) and any(one.has_high for one in traces):
        little, big = (sum(one.roughness[k] for one in traces) for k in (0, 1))
        if little * CLEARLY < big or big * CLEARLY < little:
            return ("little" if little < big else "big"), "found from the data"
    return None, ""  # with one byte always 0, 8-bit counts and 256 times these counts look alike


def _roughness(image: Frame) -> float:
    """Mean difference of neighbours."""
    total, count = 0, 0
    for later, earlier in ((image[1:], image[:-1]), (image[:, 1:], image[:, :-1])):
        total += int((np.maximum(later, earlier) - np.minimum(later, earlier)).sum(dtype=np.int64))
        count += later.size
    return total / max(1, count)


def _times(path: Path, header: _Header) -> tuple[NDArray[np.datetime64] | None, tuple[str, ...]]:
    """The times of the frames, and a note where there are none."""
    start = HEADER.size + header.count * header.frame_bytes
    with open(path, "rb") as file:
        file.seek(start)
        data = file.read(8 * header.count)
    if not data:
        return None, ("no times",)
    if len(data) < 8 * header.count:
        return None, (f"{len(data)} bytes of times, for {header.count} frames {8 * header.count}: left out",)
    ticks: NDArray[Any] = np.frombuffer(data, "<i8")
    if not ((ticks > 0) & (ticks < TICKS_10000)).all():
        return None, ("times that are none: left out",)
    notes = () if (np.diff(ticks) >= 0).all() else ("times that go back from frame to frame",)
    return ((ticks - TICKS_1970) // 10).astype("datetime64[us]"), notes
