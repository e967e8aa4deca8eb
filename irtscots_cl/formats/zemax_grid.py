"""Zemax OpticStudio's grid sag files .DAT: sags on a grid, in ASCII.

The first line has nx, ny, delx, dely, the unit (0 mm, 1 cm, 2 inch, 3 m) and the decentre of the grid; then nx x ny
lines of z, dz/dx, dz/dy, d2z/dxdy and, if it is there, a flag that is 1 where there is no data. The first of them is
the corner at -x, +y; points follow from left to right, row by row. Lines that begin with ! are comments.

Sources: docs/formats.md names those of every statement.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np

from irtscots_cl.formats.frames import check_size, reading
from irtscots_cl.formats.height_map import SURFACE, UNIT_MM, Findings, HeightMap, MapOptions
from irtscots_cl.formats.text_numbers import cut_off, line_of, number, opened_text, whole_number
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system.atomic_files import replacing

UNIT_FLAGS = ("mm", "cm", "in", "m")
LEAST_POINTS = 5  # of each axis
MAX_SIDE = 2**16
SHORTEST_LINE = 2  # bytes of a point


def is_zemax_grid(path: Path) -> bool:
    """Whether a text file begins as a grid sag file does: seven numbers, then lines of at most five."""
    with opened_text(path) as file:
        lines = [file.readline(1000) for _ in range(100)]
    rest = [line.split() for line in lines if line.strip() and not line.startswith("!")]
    if len(rest) < 2 or len(rest[0]) not in (5, 7) or len(rest[1]) > 5:
        return False
    head = rest[0]
    return head[0].isdigit() and head[1].isdigit() and head[4] in ("0", "1", "2", "3")


def read_zemax_grid(path: Path, options: MapOptions) -> HeightMap:
    """The map of a grid sag file. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    with reading(path, "Zemax grid"), opened_text(path) as file:
        line, at = "", 0
        while not line.strip() or line.startswith("!"):
            at += 1
            line = line_of(file, found.where, at)
            if not line:
                raise ValueError(f"{path}: has no line of nx, ny, delx, dely, unit")
        columns, rows, unit_mm, pitch, centre = _head(line.split(), f"{path}: line {at}")
        check_size(path, columns, rows, 1, SHORTEST_LINE, path.stat().st_size + 1, 1)
        found.warnings += cut_off(path)
        heights = _points(file, columns * rows, str(path), at)
    return found.build(
        heights.reshape(rows, columns)[::-1],
        "Zemax grid sag",
        unit_mm,
        pitch_mm=found.pitch_mm(pitch),
        wavelength_nm=options.wavelength_nm,
        kind=found.kind(SURFACE),
        centre_mm=centre,
    )


def _head(words: list[str], where: str) -> tuple[int, int, float, tuple[float, float], tuple[float, float]]:
    if len(words) not in (5, 7):
        raise ValueError(f"{where}: {len(words)} values: must be nx, ny, delx, dely, unit, xdec, ydec")
    columns, rows = (whole_number(word, where, 1, MAX_SIDE) for word in words[:2])
    unit_mm = UNIT_MM[UNIT_FLAGS[whole_number(words[4], f"{where}: unit", 0, 3)]]
    delx, dely, *centre = (number(word, where) * unit_mm for word in (*words[2:4], *words[5:7], "0", "0"))
    return columns, rows, unit_mm, (abs(delx), abs(dely)), (centre[0], centre[1])


def _points(file: IO[str], count: int, where: str, at: int) -> FloatArray:
    """The sags of all points, NaN where the flag says no data."""
    values = np.empty(count)
    k = 0
    while line := line_of(file, where, at + 1):
        at += 1
        words = line.split()
        if not words:
            continue
        if k == count:
            raise ValueError(f"{where}: line {at}: more than its {count} points")
        if len(words) > 5:
            raise ValueError(f"{where}: line {at}: {len(words)} values: must be z, 3 derivatives and the no-data flag")
        try:
            value, missing = float(words[0]), len(words) == 5 and float(words[4]) != 0
        except ValueError:
            raise ValueError(f"{where}: line {at}: must be numbers") from None
        values[k] = np.nan if missing else value
        k += 1
    if k < count:
        raise ValueError(f"{where}: {k} of its {count} points: cut off or broken")
    return values


def write_zemax_grid(path: Path, height_map: HeightMap) -> tuple[str, ...]:
    """Write a grid sag file in mm, derivatives 0, which makes the program find them itself. Returns notes.

    Invalid points have the flag, and the height of the nearest valid one, since some programs do not look at the flag.
    A wavefront is written as the surface that makes it. Raises ValueError for a map without a lateral scale or of less
    than 5 points along an axis.
    """
    surface = height_map.as_kind(SURFACE)
    rows, columns = surface.heights_mm.shape
    if surface.pitch_mm is None:
        raise ValueError(f"{path}: a Zemax grid needs a lateral scale, which the map does not have: give --pitch-mm")
    if min(rows, columns) < LEAST_POINTS:
        raise ValueError(
            f"{path}: {columns} x {rows} points: a Zemax grid has at least {LEAST_POINTS} x {LEAST_POINTS}"
        )
    filled = _filled(surface)[::-1].ravel()
    valid = surface.valid[::-1].ravel()
    pitch, centre = surface.pitch_mm, surface.centre_mm
    with replacing(path) as temporary, open(temporary, "w", encoding="ascii", newline="") as file:
        file.write(f"{columns} {rows} {pitch[0]!r} {pitch[1]!r} 0 {centre[0]!r} {centre[1]!r}\r\n")
        for height, good in zip(filled.tolist(), valid.tolist(), strict=True):
            file.write(f"{height!r} 0 0 0 {0 if good else 1}\r\n")
    notes: tuple[str, ...] = ("a Zemax grid holds no wavelength",)
    if height_map.kind != SURFACE:
        notes += ("the wavefront is written as a surface of half its height",)
    if not valid.all():
        notes += (f"{int((~valid).sum())} points without data have the flag, and the nearest valid height",)
    return notes


def _filled(height_map: HeightMap) -> FloatArray:
    if height_map.valid.all():
        return height_map.heights_mm
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~height_map.valid, return_distances=False, return_indices=True)
    filled: FloatArray = height_map.heights_mm[tuple(nearest)]
    return filled
