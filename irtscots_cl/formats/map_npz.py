"""Height maps in NumPy's files: NPZ with units and scale as arrays, NPY with bare heights.

NPZ: `heights_mm` [rows, columns], row 0 at the smallest y, and where known `pitch_mm` (x, y, or one number for both),
`wavelength_nm`, `centre_mm` [2], `wavefront` (0 or 1), `comment` (lines of text). An NPY file needs to be told the
unit; its rows are taken to lie in the same way.
"""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.frames import ReadOptions, reading
from irtscots_cl.formats.height_map import SURFACE, UNIT_MM, WAVEFRONT, Findings, HeightMap, MapOptions
from irtscots_cl.formats.npz import open_npy, open_npz
from irtscots_cl.formats.text_numbers import comment_lines, short
from irtscots_cl.system.atomic_files import replacing

HEIGHTS = "heights_mm"
MAX_BYTES = 1000  # of an array beside the heights
MAX_COMMENT = 2**15  # bytes of the comment


def read_map_npz(path: Path, options: MapOptions) -> HeightMap:
    """The map of an NPZ file. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    with reading(path, "NPZ"), zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        array = options.array or HEIGHTS
        if f"{array}.npy" not in names:
            there = ", ".join(short(name.removesuffix(".npy")) for name in names[:4]) or "none"
            raise ValueError(f"{path}: has no array {short(array)}: give --array, one of: {there}")
        few = {name: _few(archive, name) for name in ("pitch_mm", "wavelength_nm", "centre_mm", "wavefront")}
        comment = _comment(archive)
    file = open_npz(path, ReadOptions(npz_array=array))
    heights = np.asarray(file.read(found.chosen(file.count, f"maps in {short(array)}")), float)
    pitch, centre, waves = few["pitch_mm"], few["centre_mm"], few["wavelength_nm"]
    wavefront = few["wavefront"]
    kind = None if wavefront is None else WAVEFRONT if wavefront[0] else SURFACE
    wavelength = found.wavelength_nm(None if waves is None else waves[0])
    unit_mm = found.unit_mm("mm" if array == HEIGHTS else None, wavelength)
    if array != HEIGHTS:
        found.warnings.append(f"array {short(array)} does not tell its row order: row 0 is taken as the lowest")
    return found.build(
        heights,
        "NPZ",
        unit_mm,
        pitch_mm=found.pitch_mm(None if pitch is None or len(pitch) > 2 else (pitch[0], pitch[-1])),
        wavelength_nm=wavelength,
        kind=found.kind(kind),
        comment=comment,
        centre_mm=(0.0, 0.0) if centre is None or len(centre) != 2 else (centre[0], centre[1]),
    )


def _few(archive: zipfile.ZipFile, name: str) -> list[float] | None:
    """A few numbers of a small array; None where there is none."""
    if f"{name}.npy" not in archive.namelist():
        return None
    with archive.open(f"{name}.npy") as stream:
        data = stream.read(MAX_BYTES)
    stream_of = io.BytesIO(data)
    if np.lib.format.read_magic(stream_of) != (1, 0):
        return None
    shape, _, kind = np.lib.format.read_array_header_1_0(stream_of)
    count = math.prod(shape)
    if kind.kind not in "uifb" or not 1 <= count <= (len(data) - stream_of.tell()) // kind.itemsize:
        return None
    return [float(value) for value in np.frombuffer(data, kind, count, stream_of.tell())]


def _comment(archive: zipfile.ZipFile) -> tuple[str, ...]:
    """The lines of a small array of text; none where there is none."""
    if "comment.npy" not in archive.namelist():
        return ()
    with archive.open("comment.npy") as stream:
        data = io.BytesIO(stream.read(MAX_COMMENT))
    if np.lib.format.read_magic(data) != (1, 0):
        return ()
    _, _, kind = np.lib.format.read_array_header_1_0(data)
    if kind.kind != "U" or not kind.itemsize:
        return ()
    rest = data.read()
    return comment_lines(map(str, np.frombuffer(rest[: len(rest) // kind.itemsize * kind.itemsize], kind)))


def read_map_npy(path: Path, options: MapOptions) -> HeightMap:
    """The map of an NPY file, in the unit told. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    file = open_npy(path, ReadOptions())
    number = found.chosen(file.count, "arrays")
    wavelength = found.wavelength_nm(None)
    unit_mm = found.unit_mm(None, wavelength)
    found.warnings.append("an NPY file does not tell its row order: row 0 is taken as the lowest")
    heights = np.asarray(file.read(number), float)
    kind, pitch = found.kind(None), found.pitch_mm(None)
    return found.build(heights, "NPY", unit_mm, pitch_mm=pitch, wavelength_nm=wavelength, kind=kind)


def write_map_npz(path: Path, height_map: HeightMap) -> tuple[str, ...]:
    """Write an NPZ file. Returns notes, none."""
    arrays: dict[str, NDArray[Any]] = {
        HEIGHTS: height_map.heights_mm,
        "centre_mm": np.array(height_map.centre_mm),
        "wavefront": np.array([float(height_map.kind == WAVEFRONT)]),
    }
    if height_map.pitch_mm is not None:
        arrays["pitch_mm"] = np.array(height_map.pitch_mm)
    if height_map.wavelength_nm is not None:
        arrays["wavelength_nm"] = np.array([height_map.wavelength_nm])
    if height_map.comment:
        arrays["comment"] = np.array(height_map.comment)
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, values in arrays.items():
            stream = io.BytesIO()
            np.lib.format.write_array(stream, np.ascontiguousarray(values))
            archive.writestr(f"{name}.npy", stream.getvalue())
    return ()


def write_map_npy(path: Path, height_map: HeightMap, unit: str = "mm") -> tuple[str, ...]:
    """Write bare heights in a unit of length, row 0 at the smallest y. Returns notes."""
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.lib.format.write_array(file, np.ascontiguousarray(height_map.heights_mm / UNIT_MM[unit]))
    return (f"an NPY file holds only heights, here in {unit}: no lateral scale, wavelength or kind",)
