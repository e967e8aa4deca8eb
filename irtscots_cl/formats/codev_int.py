"""CODE V's interferogram files .int: a grid of whole numbers, or Zernike coefficients, in waves times SSZ.

Lines that begin with ! are comments; then a title and one line of keywords: GRD columns rows, or ZFR (fringe) or ZRN
(standard) and the number of coefficients; SUR or WFR; WVL, the wavelength in micrometres; SSZ, the value of one wave;
NDA, the value without data. Height = value x WVL / SSZ. Values come row by row, each from -x to +x, the top row first.

Sources: docs/formats.md names those of every statement.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from irtscots_cl.formats.codev_zernike import DEFAULT_SAMPLES, NAMES, Disk, fitted, samples_of
from irtscots_cl.formats.frames import check_size, reading
from irtscots_cl.formats.height_map import SURFACE, WAVEFRONT, Findings, HeightMap, MapOptions
from irtscots_cl.formats.text_numbers import (
    comment_lines,
    cut_off,
    line_of,
    number,
    numbers,
    opened_text,
    short,
    whole_number,
)
from irtscots_cl.formats.zygo_dat import writable_wavelength
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system.atomic_files import replacing, write_text

KINDS = {"SUR": SURFACE, "WFR": WAVEFRONT}
OTHER_KINDS = ("FIL", "THV", "BIR", "CAO", "APO")
NO_DATA = (-32768, 32767)  # what programs write for it; which of them is the default differs
WRITTEN_NO_DATA = -32768
MOST = 32766  # of a value that is written
PER_LINE = 10
MAX_SIDE = 2**16
MAX_COMMENT_LINES = 1000


@dataclass
class _Header:
    """The line of keywords. grid: (columns, rows); zernike: (name, number of coefficients); one of them is given."""

    title: str
    grid: tuple[int, int] | None = None
    zernike: tuple[str, int] | None = None
    kind: str | None = None
    wavelength_um: float | None = None
    ssz: float | None = None
    no_data: int | None = None
    x_scale: float = 1.0
    comment: tuple[str, ...] = ()


def is_codev_int(path: Path) -> bool:
    """Whether a text file begins as CODE V's interferograms do: comments, a title, GRD, ZFR or ZRN."""
    with opened_text(path) as file:
        lines = [file.readline(1000) for _ in range(1000)]
    rest = [line for line in lines if not line.startswith("!")]
    words = rest[1].split() if len(rest) > 1 else []
    return bool(words) and words[0].upper() in ("GRD", *NAMES)


def read_codev_int(path: Path, options: MapOptions) -> HeightMap:
    """The map of a CODE V interferogram. Raises ValueError, with one line, for what cannot be read.

    Zernike coefficients become a map on a square of DEFAULT_SAMPLES pixels, the unit disk's rim on the outer edges of
    its outer pixels; outside the disk it is invalid.
    """
    found = Findings(str(path), options)
    with reading(path, "CODE V"), opened_text(path) as file:
        header = _header(file, found)
        size = path.stat().st_size
        wavelength = found.wavelength_nm((header.wavelength_um or 0.0) * 1e3, needed=True)
        assert wavelength is not None
        kind = found.kind(header.kind)
        if header.zernike:
            values = _zernike_map(file, header, found, size)
        else:
            values = _grid(file, header, found, size)
        found.warnings += cut_off(path)
        unit_mm = wavelength * 1e-6 / _scale(header, found)
        if header.x_scale != 1:
            found.warnings.append(f"XSC = {header.x_scale:g}: pixels are not square; give both pitches")
    return found.build(
        values, "CODE V", unit_mm, pitch_mm=found.pitch_mm(None), wavelength_nm=wavelength, kind=kind,
        comment=comment_lines(header.comment),
    )  # fmt: skip


def _header(file: IO[str], found: Findings) -> _Header:
    where = found.where
    line, number_of = line_of(file, where, 1), 1
    comment = []
    while line.startswith("!"):
        number_of += 1
        comment.append(line[1:200])
        line = line_of(file, where, number_of)
        if number_of > MAX_COMMENT_LINES:
            raise ValueError(f"{where}: more than {MAX_COMMENT_LINES} lines of comment")
    header = _Header(short(line), comment=tuple(comment))
    words = line_of(file, where, number_of + 1).upper().split()
    k = 0
    while k < len(words):
        k += _keyword(words[k : k + 3], header, where)
    if (header.grid is None) == (header.zernike is None):
        raise ValueError(f"{where}: the line after the title must begin with GRD, ZFR or ZRN")
    return header


def _keyword(words: list[str], header: _Header, where: str) -> int:
    """Take in one keyword with its values; returns how many words that were."""
    name, values = words[0], words[1:]
    place = f"{where}: {short(name)}"
    needed = {"GRD": 2, "WVL": 1, "SSZ": 1, "NDA": 1, "XSC": 1, **dict.fromkeys(NAMES, 1)}.get(name, 0)
    if len(values) < needed:
        raise ValueError(f"{place}: must be followed by {needed} number{'s' * (needed > 1)}")
    if name == "GRD":
        columns, rows = (whole_number(value, place, 1, MAX_SIDE) for value in values[:2])
        header.grid = columns, rows
    elif name in NAMES:
        header.zernike = name, whole_number(values[0], place, 1, 1000)
    elif name in KINDS:
        header.kind = KINDS[name]
    elif name == "WVL":
        header.wavelength_um = number(values[0], place)
    elif name == "SSZ":
        header.ssz = number(values[0], place)
    elif name == "NDA":
        header.no_data = whole_number(values[0], place, -(2**40), 2**40)
    elif name == "XSC":
        header.x_scale = number(values[0], place)
    elif name in OTHER_KINDS:
        raise ValueError(f"{place}: no heights; must be SUR (surface) or WFR (wavefront)")
    elif name not in ("NNB", "NNR"):  # how to interpolate
        raise ValueError(f"{place}: a keyword that is not known")
    return 1 + needed


def _scale(header: _Header, found: Findings) -> float:
    if header.ssz is None:
        found.warnings.append("the file has no SSZ: values are taken as waves")
        return 1.0
    if not 1e-9 <= abs(header.ssz) <= 1e12:
        raise ValueError(f"{found.where}: SSZ = {header.ssz:g}: must be within 1e12 and not 0")
    return header.ssz


def _grid(file: IO[str], header: _Header, found: Findings, size: int) -> FloatArray:
    """Values [rows, columns] in the map's row order, NaN where there is no data."""
    assert header.grid is not None
    columns, rows = header.grid
    check_size(found.where, columns, rows, 1, 2, size + 1, 1)  # a digit and a space each
    values = numbers(file, columns * rows, found.where)
    if header.no_data is not None:
        missing = values == header.no_data
    else:
        missing = (values == NO_DATA[0]) | (values == NO_DATA[1])
        found.warnings.append(
            f"the file has no NDA: {int(missing.sum())} values of {NO_DATA[0]} or {NO_DATA[1]} are taken as missing"
        )
    return np.where(missing, np.nan, values).reshape(rows, columns)[::-1]


def _zernike_map(file: IO[str], header: _Header, found: Findings, size: int) -> FloatArray:
    assert header.zernike is not None
    name, count = header.zernike
    if 2 * count > size + 1:
        raise ValueError(f"{found.where}: {name} {count}: more coefficients than the file can hold")
    values = numbers(_without_comments(file, found.where), count, found.where)
    if not np.isfinite(values).all():
        raise ValueError(f"{found.where}: holds a coefficient that is not finite")
    found.warnings.append(
        f"{count} Zernike coefficients ({NAMES[name]}): made into a map of {DEFAULT_SAMPLES} pixels across the disk; "
        "angles from +x towards +y, rim coefficients"
    )
    return samples_of(name, values, DEFAULT_SAMPLES)


def _without_comments(file: IO[str], where: str) -> IO[str]:
    import io

    lines = []
    while line := line_of(file, where, 0):
        lines.append("" if line.startswith("!") else line)
        if len(lines) > 10**5:
            raise ValueError(f"{where}: more than {10**5} lines after its header")
    return io.StringIO("".join(lines))


def write_codev_grid(path: Path, height_map: HeightMap) -> tuple[str, ...]:
    """Write a grid. Returns notes: on the rounding, and that the lateral scale is not in the file.

    Values are whole numbers up to 32766: the heights' range is divided into that many steps.
    """
    wavelength, notes = writable_wavelength(height_map)
    rows, columns = height_map.heights_mm.shape
    waves = height_map.heights_mm[::-1] / (wavelength * 1e-6)
    largest = float(np.nanmax(np.abs(waves)))
    ssz = float(f"{MOST / largest:.9g}") if largest > 0 else float(MOST)
    if largest * ssz > MOST + 0.4:
        ssz = float(f"{MOST / largest * (1 - 1e-8):.9g}")
    if height_map.pitch_mm and abs(height_map.pitch_mm[0] / height_map.pitch_mm[1] - 1) > 1e-9:
        raise ValueError(f"{path}: pixels that are not square: use another format")
    values = np.where(np.isfinite(waves), np.rint(waves * ssz), WRITTEN_NO_DATA).astype(int).ravel()
    kind = "SUR" if height_map.kind == SURFACE else "WFR"
    head = f"GRD {columns} {rows} {kind} WVL {wavelength * 1e-3:.10g} SSZ {ssz:.9g} NDA {WRITTEN_NO_DATA}"
    lines = [*(f"! {line}" for line in height_map.comment), "Height map written by irtscots-cl", head]
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="\r\n") as file:
        file.writelines(f"{line}\n" for line in lines)  # some readers need CRLF
        for k in range(0, len(values), PER_LINE):
            file.write(" ".join(map(str, values[k : k + PER_LINE].tolist())) + "\n")
    quantum = wavelength / ssz
    return (*notes, f"heights are rounded to {quantum:.3g} nm", "a CODE V file holds no lateral scale")


def write_codev_zernike(
    path: Path, height_map: HeightMap, count: int, name: str = "ZFR", disk: Disk | None = None
) -> tuple[str, ...]:
    """Write `count` Zernike coefficients of a map. Returns notes: the disk that was used, and what the fit leaves.

    disk: in pixels; default: the smallest circle about the middle of the valid pixels that holds them whole.
    """
    wavelength, notes = writable_wavelength(height_map)
    coefficients, disk, rest_mm = fitted(str(path), name, height_map, count, disk)
    rows = height_map.heights_mm.shape[0]
    said = f"disk of radius {disk.radius:.6g} pixels about row {disk.row:.6g}, column {disk.column:.6g}, from 0"
    kind = "SUR" if height_map.kind == SURFACE else "WFR"
    lines = [
        *(f"! {line}" for line in height_map.comment),
        f"! {said} (row 0 at the bottom, {rows} rows)",
        "Zernike coefficients written by irtscots-cl",
    ]
    lines += [f"{name} {count} {kind} WVL {wavelength * 1e-3:.10g} SSZ 1.0"]
    lines += [f"{value / (wavelength * 1e-6):.15g}" for value in coefficients]
    write_text(path, "\r\n".join(lines) + "\r\n")
    return (*notes, said, f"the {count} terms leave {rest_mm * 1e6:.4g} nm rms")
