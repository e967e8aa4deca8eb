"""TIFF files of cameras: grey pages of integers or floating point, read by tifffile.

Every page is a frame, also in a file of three or four pages. Counts are not scaled: a page of 12 packed bits gives 0 to
4095. The Orientation tag is applied.
"""

from __future__ import annotations

import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.frames import (
    MAX_FRAMES,
    MAX_UNPACKED,
    Frame,
    ImageFile,
    ReadOptions,
    check_orientation,
    check_size,
    exposure_time,
    native,
    orientation_note,
    reading,
    upright,
    upright_shape,
)

WHITE_IS_ZERO, BLACK_IS_ZERO = 0, 1  # PhotometricInterpretation, TIFF 6.0
COLOUR = {2: "RGB", 3: "palette colour", 5: "CMYK", 6: "YCbCr", 8: "CIELab", 32803: "a colour filter array (Bayer)"}
UNCOMPRESSED, JPEGS = 1, (6, 7)
UNSIGNED, SIGNED, FLOAT = 1, 2, 3  # SampleFormat
BITS = {UNSIGNED: (8, 10, 12, 14, 16, 32), SIGNED: (8, 16, 32), FLOAT: (16, 32, 64)}
ORIENTATION, EXIF = 274, 34665


def open_tiff(path: Path, options: ReadOptions) -> ImageFile:
    """The pages of a TIFF or BigTIFF file. Raises ValueError, with one line, for what is no grey stack of frames."""
    import tifffile

    with reading(path, "TIFF"), tifffile.TiffFile(path) as file:
        count = _count_pages(path)
        if count != len(file.pages):
            raise ValueError(f"{path}: {len(file.pages)} of its {count} pages can be read: cut off or broken")
        first = _checked(path, 1, file.pages[0])
        shapes = [first]
        for number, page in enumerate(file.pages[1:], 2):
            shapes.append(_checked(path, number, page))
            if shapes[-1][:3] != first[:3]:
                sizes = [f"{s[0][1]} x {s[0][0]} pixels, {s[1]}, {s[2]} bits" for s in (shapes[-1], first)]
                raise ValueError(f"{path}: page {number} has {sizes[0]}, page 1 {sizes[1]}: must be equal")
        _check_all_pages(path, file, len(shapes))
        exposures = {_exposure(page) for page in file.pages}
    shape, dtype, bits, _ = first
    notes = [note for turn in sorted({s[3] for s in shapes}) for note in orientation_note(turn)]
    exposure = exposures.pop() if len(exposures) == 1 else None

    def read(number: int) -> Frame:
        return _read(path, number)

    return ImageFile(path, shape, len(shapes), dtype, bits, read, tuple(notes), exposure_s=exposure)


def _exposure(page: Any) -> float | None:
    """Exif's exposure time of a page, in its own directory or in Exif's."""
    exif = page.tags.get(EXIF)
    inside = exif.value if exif is not None and isinstance(exif.value, dict) else {}
    own = page.tags.get("ExposureTime")
    return exposure_time(inside.get("ExposureTime") if own is None else own.value)


def _count_pages(path: Path) -> int:
    """Pages by the chain of the file's own directories: where it leads out of the file tifffile ends, with no error."""
    length = path.stat().st_size
    with open(path, "rb") as file:
        start = file.read(16)
        end, big = ">" if start[:1] == b"M" else "<", start[2:4] in (b"+\0", b"\0+")
        link, entries, entry = ("Q", "Q", 20) if big else ("I", "H", 12)
        (at,) = struct.unpack_from(end + link, start, 8 if big else 4)
        seen: set[int] = set()
        while at:
            if at in seen or at > length or len(seen) >= MAX_FRAMES:
                raise ValueError(f"{path}: page {len(seen) + 1} is at byte {at} of {length}: cut off or broken")
            seen.add(at)
            file.seek(at)
            (number,) = struct.unpack(end + entries, file.read(struct.calcsize(entries)))
            file.seek(number * entry, os.SEEK_CUR)
            (at,) = struct.unpack(end + link, file.read(struct.calcsize(link)))
    return len(seen)


def _checked(path: Path, number: int, page: Any) -> tuple[tuple[int, int], np.dtype[Any], int, int]:
    """Of a page: shape (upright), dtype, bits without sign (0: floating point), orientation."""
    where = f"{path}: page {number}"
    photometric = int(page.photometric)
    if photometric == WHITE_IS_ZERO:
        raise ValueError(f"{where}: 0 is white (MinIsWhite), counts fall with light: must be stored as MinIsBlack")
    if photometric != BLACK_IS_ZERO or page.samplesperpixel != 1:
        what = COLOUR.get(photometric, f"{page.samplesperpixel} samples per pixel")
        raise ValueError(f"{where}: {what}: must be one grey channel; record mono, or extract one channel as grey")
    if page.compression in JPEGS:
        raise ValueError(f"{where}: compressed as JPEG, which changes the counts: must be stored without loss")
    kind, bits = int(page.sampleformat), int(page.bitspersample)
    if bits not in BITS.get(kind, ()) or page.imagedepth != 1:
        raise ValueError(
            f"{where}: samples of {bits} bits, format {kind}, depth {page.imagedepth}: must be whole numbers of "
            "8, 10, 12, 14, 16 or 32 bits or floating point of 16, 32 or 64"
        )
    rows, columns = int(page.imagelength), int(page.imagewidth)
    _check_stored(where, page, rows, columns, bits)
    tag = page.tags.get(ORIENTATION)
    turn = check_orientation(path, None if tag is None else int(tag.value))
    letter = {UNSIGNED: "u", SIGNED: "i", FLOAT: "f"}[kind]
    dtype = np.dtype(f"{letter}{max(1, 2 ** math.ceil(math.log2(bits)) // 8)}")
    return upright_shape((rows, columns), turn), dtype, {UNSIGNED: bits, SIGNED: bits - 1, FLOAT: 0}[kind], turn


def _check_stored(where: str, page: Any, rows: int, columns: int, bits: int) -> None:
    """Refuse a page whose strips or tiles are not all in the file: tifffile gives zeros for those without bytes."""
    length = page.parent.filehandle.size
    offsets, counts = page.dataoffsets, page.databytecounts
    parts = math.prod(page.chunked)
    inside = sum(at > 0 and n > 0 and at + n <= length for at, n in zip(offsets, counts, strict=False))
    if inside < parts or inside < max(len(offsets), len(counts)):
        raise ValueError(f"{where}: {inside} of its {parts} strips or tiles are in the file: cut off or broken")
    ratio = 1 if page.compression == UNCOMPRESSED else MAX_UNPACKED
    row_bytes = math.ceil(columns * bits / 8)
    check_size(where, columns, rows, 1, row_bytes / columns if columns else 1, min(sum(counts), length), ratio)


def _check_all_pages(path: Path, file: Any, pages: int) -> None:
    """Refuse a file that says it holds more frames than it has pages, as ImageJ's of more than 4 GiB do."""
    said = file.imagej_metadata.get("images", 1) if file.is_imagej else 1
    if file.is_shaped:
        said = math.prod((file.shaped_metadata or [{}])[0].get("shape", [1])[:-2])
    if isinstance(said, int) and said > pages:
        raise ValueError(f"{path}: {pages} pages, though its description says {said} images: must be a page for each")


def _read(path: Path, number: int) -> Frame:
    import tifffile

    with reading(path, "TIFF"), tifffile.TiffFile(path) as file:
        page: Any = file.pages[number]
        _, dtype, _, turn = _checked(path, number + 1, page)
        try:
            image = page.asarray(maxworkers=1)
        except (ValueError, ImportError) as error:
            if "imagecodecs" in str(error):
                raise ValueError(
                    f"{path}: {page.bitspersample} bits, compression {page.compression}: needs imagecodecs: "
                    "pip install irtscots-cl[images]"
                ) from None
            raise
        return upright(native(image).astype(dtype, copy=False), turn)
