"""ISO 25178-71's surface data files .sdf, as text (aISO-1.0) and binary (bISO-1.0).

A header of fixed fields (81 bytes in binary files, little endian), then profiles of points: height = value x Zscale,
lengths in metres. Profiles follow along y, the first one at the smallest y.

Sources: docs/formats.md names those of every statement.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import IO

import numpy as np

from irtscots_cl.formats.binary_array import binary_array
from irtscots_cl.formats.frames import check_size, reading
from irtscots_cl.formats.height_map import SURFACE, Findings, HeightMap, MapOptions
from irtscots_cl.formats.text_numbers import cut_off, line_of, number, opened_text, short, whole_number
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system.atomic_files import replacing

MAGICS = (b"aISO-1.0", b"bISO-1.0")
TYPES = {0: "u1", 1: "<u2", 2: "<u4", 3: "<f4", 4: "i1", 5: "<i2", 6: "<i4", 7: "<f8"}
NO_VALUE = {1: 2**16 - 1, 2: 2**32 - 1, 5: -(2**15), 6: -(2**31)}  # of the types of 16 and 32 bits
HEADER = struct.Struct("<8s10s12s12sHHddddBBB")
FIELDS = ("numpoints", "numprofiles", "xscale", "yscale", "zscale", "datatype")
BAD = {"bad": float("nan")}


def read_iso_sdf(path: Path, options: MapOptions) -> HeightMap:
    """The map of an SDF file. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    with reading(path, "SDF"):
        with open(path, "rb") as file:
            start = file.read(HEADER.size)
        found.warnings += () if start[:8] == MAGICS[1] else cut_off(path)
        values, scales = _binary(path, start) if start[:8] == MAGICS[1] else _text(path)
        for name, scale in zip(("Xscale", "Yscale", "Zscale"), scales, strict=True):
            if not (np.isfinite(scale) and (scale != 0 or name != "Zscale")):
                raise ValueError(f"{path}: {name} = {scale:g}: must be a finite number of metres, not 0")
    return found.build(
        values,
        "SDF",
        scales[2] * 1e3,
        pitch_mm=found.pitch_mm((scales[0] * 1e3, scales[1] * 1e3)),
        wavelength_nm=options.wavelength_nm,
        kind=found.kind(SURFACE),
    )


def _binary(path: Path, start: bytes) -> tuple[FloatArray, tuple[float, float, float]]:
    if len(start) < HEADER.size:
        raise ValueError(f"{path}: {len(start)} of the {HEADER.size} bytes of its header: cut off")
    _, _, _, _, columns, rows, x, y, z, _, compression, kind, _ = HEADER.unpack(start)
    if compression or kind not in TYPES:
        raise ValueError(f"{path}: compression {compression}, data type {kind}: must be 0, and 0 to 7")
    dtype = np.dtype(TYPES[kind])
    check_size(path, columns, rows, 1, dtype.itemsize, path.stat().st_size - HEADER.size, 1)
    stored = binary_array(path, dtype, HEADER.size, rows, columns)
    return _valid(stored.astype(float), kind), (x, y, z)


def _valid(values: FloatArray, kind: int) -> FloatArray:
    return np.where(values == NO_VALUE[kind], np.nan, values) if kind in NO_VALUE else values


def _text(path: Path) -> tuple[FloatArray, tuple[float, float, float]]:
    with opened_text(path) as file:
        head = _header(file, str(path))
        columns, rows = (whole_number(head[k], f"{path}: {k}", 1, 2**16) for k in FIELDS[:2])
        x, y, z = (number(head[k], f"{path}: {k}") for k in FIELDS[2:5])
        kind = whole_number(head["datatype"], f"{path}: datatype", 0, 7)
        check_size(path, columns, rows, 1, 2, path.stat().st_size + 1, 1)
        data = _until_star(file, columns * rows, str(path))
    return _valid(data.reshape(rows, columns), kind), (x, y, z)


def _header(file: IO[str], where: str) -> dict[str, str]:
    line_of(file, where, 1)  # the format's name
    head: dict[str, str] = {}
    for at in range(2, 1000):
        line = line_of(file, where, at)
        if line.strip().startswith("*"):
            break
        key, equals, value = line.partition("=")
        if not equals and line.strip():
            raise ValueError(f"{where}: line {at}: {short(line)!r}: must be key = value, or *")
        head[key.strip().lower()] = value.strip()
        if not line:
            break
    missing = [key for key in FIELDS if key not in head]
    if missing:
        raise ValueError(f"{where}: its header has no {missing[0]}: cut off or broken")
    if head.get("compression", "0") != "0":
        raise ValueError(f"{where}: compression {short(head['compression'])}: must be 0")
    return head


def _until_star(file: IO[str], count: int, where: str) -> FloatArray:
    """`count` numbers; what follows them (a trailer after *) is not read."""
    values = np.empty(count)
    at, rest = 0, ""
    while at < count:
        piece = file.read(2**16)
        words = (rest + piece).split()
        rest = words.pop() if piece and words and not piece[-1].isspace() else ""
        for word in words[: count - at]:
            values[at] = number(word, where, BAD)
            at += 1
        if not piece:
            break
        if len(rest) > 1000:
            raise ValueError(f"{where}: {short(rest)!r}: must be a number")
    if at < count:
        raise ValueError(f"{where}: {at} of its {count} values: cut off or broken")
    return values


def write_iso_sdf(path: Path, height_map: HeightMap) -> tuple[str, ...]:
    """Write a binary SDF file of 64-bit heights in metres. Returns notes.

    A wavefront is written as the surface that makes it. Raises ValueError for a map without a lateral scale.
    """
    surface = height_map.as_kind(SURFACE)
    if surface.pitch_mm is None:
        raise ValueError(f"{path}: an SDF file needs a lateral scale, which the map does not have: give --pitch-mm")
    rows, columns = surface.heights_mm.shape
    if max(rows, columns) > 65535:
        raise ValueError(f"{path}: {columns} x {rows} pixels: an SDF file holds at most 65535 each way")
    x, y = (pitch * 1e-3 for pitch in surface.pitch_mm)
    head = HEADER.pack(
        MAGICS[1], b"irtscots".ljust(10), b"0" * 12, b"0" * 12, columns, rows, x, y, 1e-3, 0.0, 0, 7, 0
    )  # fmt: skip
    with replacing(path) as temporary:
        temporary.write_bytes(head + surface.heights_mm.astype("<f8").tobytes())
    notes = ("an SDF file holds no wavelength",)
    return notes if height_map.kind == SURFACE else (*notes, "the wavefront is written as a surface of half its height")
