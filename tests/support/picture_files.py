"""Small image files made byte by byte, independent of the libraries that read them, and pictures to put into them."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest

from irtscots_cl.formats.frames import ReadOptions

ROWS, COLUMNS = 11, 9


def letter_f(low=10, high=200, dtype=np.uint8):
    """An F as it is to be seen, its first row at the top: no turn or mirror image of it is the same."""
    image = np.full((ROWS, COLUMNS), low, dtype)
    image[1:10, 2] = high  # the stem
    image[1, 2:7] = high
    image[5, 2:5] = high
    image[0, 0] = low + 1  # a mark at the top left
    return image


def ramp(count=1, dtype=np.uint16, top=4095, rows=ROWS, columns=COLUMNS):
    """Smooth pictures [count, rows, columns] that all differ, up to `top`."""
    k, row, column = np.mgrid[:count, :rows, :columns]
    values = 0.05 + 0.9 * (0.5 * row / rows + 0.3 * column / columns + 0.2 * k / max(count, 1))
    return np.rint(values * top).astype(dtype)


def packed(image, bits):
    """The rows of an image, samples of so many bits one after the other, each row to a whole byte."""
    rows = []
    for row in image:
        text = "".join(format(int(value), f"0{bits}b") for value in row)
        text += "0" * (-len(text) % 8)
        rows.append(bytes(int(text[k : k + 8], 2) for k in range(0, len(text), 8)))
    return b"".join(rows)


def tiff(pages, bits, *, big=False, photometric=1, kind=1, samples=1, orientation=1, shapes=None, tags=None):
    """A TIFF 6.0 file of pages, each the bytes of one strip. tags: (tag, type 3 or 4, value) that replace or add."""
    end = ">" if big else "<"
    out = bytearray((b"MM" if big else b"II") + struct.pack(end + "HI", 42, 8))
    for number, data in enumerate(pages):
        rows, columns = shapes[number] if shapes else (ROWS, COLUMNS)
        values = {
            256: (4, columns), 257: (4, rows), 258: (3, bits), 259: (3, 1), 262: (3, photometric),
            274: (3, orientation), 277: (3, samples), 278: (4, rows), 279: (4, len(data)), 339: (3, kind),
        }  # fmt: skip
        values[273] = (4, len(out) + 2 + 12 * (len(values) + 1) + 4)
        values |= {tag: (form, value) for tag, form, value in tags or ()}
        out += struct.pack(end + "H", len(values))
        for tag, (form, value) in sorted(values.items()):
            out += struct.pack(end + "HHI", tag, form, 1)
            out += struct.pack(end + "HH", value, 0) if form == 3 else struct.pack(end + "I", value)
        length = len(data) + len(data) % 2
        following = len(out) + 4 + length if number + 1 < len(pages) else 0
        out += struct.pack(end + "I", following) + data.ljust(length, b"\0")
    return bytes(out)


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(image, bits, colour, *, extra=b"", size=None):
    """A PNG file. image: [rows, columns] or [rows, columns, channels]; extra: chunks before the data."""
    kind = ">u2" if bits == 16 else "u1"
    raw = b"".join(b"\0" + (packed([row.ravel()], bits) if bits < 8 else row.astype(kind).tobytes()) for row in image)
    columns, rows = size or (image.shape[1], image.shape[0])
    header = struct.pack(">IIBBBBB", columns, rows, bits, colour, 0, 0, 0)
    data = chunk(b"IHDR", header) + extra + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + data


def ser(frames, bits=8, *, order="little", flag=0, colour=0, count=None, trailer=b"", size=None):
    """A SER file of frames [count, rows, columns]."""
    columns, rows = size or frames.shape[:0:-1]
    numbers = (0, colour, flag, columns, rows, bits, len(frames) if count is None else count)
    header = struct.pack("<14s7i40s40s40sqq", b"LUCAM-RECORDER", *numbers, b"", b"", b"", 0, 0)
    kind = "u1" if bits <= 8 else ("<u2" if order == "little" else ">u2")
    return header + frames.astype(kind).tobytes() + trailer


def fits(planes, bitpix, *cards):
    """A FITS file. planes: stored values [rows, columns] or [frames, rows, columns], first row first. cards: texts."""
    axes = planes.shape[::-1]
    lines = ["SIMPLE  =                    T", f"BITPIX  = {bitpix:20d}", f"NAXIS   = {len(axes):20d}"]
    lines += [f"NAXIS{k}  = {n:20d}" for k, n in enumerate(axes, 1)]
    header = "".join(line.ljust(80) for line in (*lines, *cards, "END"))
    header += " " * (-len(header) % 2880)
    data = planes.astype({8: "u1", 16: ">i2", 32: ">i4", 64: ">i8", -32: ">f4", -64: ">f8"}[bitpix]).tobytes()
    return header.encode("ascii") + data + b"\0" * (-len(data) % 2880)


def frames(file):
    """All frames [count, rows, columns] of an opened file."""
    return np.stack([file.read(k) for k in range(file.count)])


def read_all(opener, path, options):
    return frames(opener(path, options))


def refusal(opener, path, data, options=None):
    """The one line that says why a file with these bytes cannot be opened and read."""
    path.write_bytes(data)
    with pytest.raises(ValueError, match=".") as caught:
        read_all(opener, path, options or ReadOptions())
    said = str(caught.value)
    assert said.isprintable() and said.startswith(f"{path}: ")
    return said


def outcome(opener, path, data):
    """Of any bytes: "read", or the one line of the refusal. Anything else is raised."""
    path.write_bytes(data)
    try:
        images = read_all(opener, path, ReadOptions())
    except ValueError as error:
        assert str(error).isprintable() and str(error).startswith(f"{path}: "), str(error)
        return str(error)
    assert images.ndim == 3
    return "read"
