"""Height maps in files of any format: read by what the file begins with, written by the name's ending."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from irtscots_cl.formats.frames import first_line, reading
from irtscots_cl.formats.height_map import HeightMap, MapOptions

if TYPE_CHECKING:
    from irtscots_cl.maths.map_figures import Unit

Reader = Callable[[Path, MapOptions], HeightMap]
Writer = Callable[[Path, HeightMap], tuple[str, ...]]

# What can be written, by the ending of its name; the Zemax grid shares .dat with MetroPro and needs its own word.
ENDINGS = {
    ".dat": "zygo-dat", ".datx": "zygo-datx", ".int": "codev", ".fits": "fits", ".fit": "fits", ".fts": "fits",
    ".tif": "tiff", ".tiff": "tiff", ".csv": "csv", ".xyz": "xyz", ".npz": "npz", ".npy": "npy", ".sdf": "sdf",
    ".x3p": "x3p",
}  # fmt: skip
FORMATS = (
    "zygo-dat", "zygo-datx", "codev", "codev-zfr", "codev-zrn", "zemax", "fits", "tiff", "csv", "xyz", "npz", "npy",
    "sdf", "x3p",
)  # fmt: skip
WITH_INTENSITY = ("zygo-dat", "zygo-datx")
NEGLIGIBLE_MM = 1e-6  # of a centre that is not written
WITH_CENTRE = ("zemax", "fits", "tiff", "csv", "xyz", "npz")
WITH_COMMENT = (
    "zygo-dat", "zygo-datx", "codev", "codev-zfr", "codev-zrn", "fits", "tiff", "csv", "xyz", "npz",
)  # fmt: skip
WITH_UNIT = ("fits", "tiff", "csv", "xyz", "npy")  # formats whose heights may be in several units
_OTHERS = {
    b"Zygo ASCII Data File": "MetroPro's ASCII: save it as .dat (binary) or .datx",
    b"Zygo XYZ Data File": "MetroPro's XYZ: save it as .dat (binary) or .datx",
    b"\x89PNG": "a picture (PNG), which has no unit: save heights as numbers",
    b"\xff\xd8\xff": "a picture (JPEG), which has no unit: save heights as numbers",
}

# Options of what only some formats have, and the readers that know them.
_ONLY_OF = {
    "number": ("read_zygo_datx", "read_map_fits", "read_map_tiff", "read_map_npz", "read_map_npy"),
    "array": ("read_map_npz",),
    "quantity": ("read_result_map",),
    "unit": (
        "read_zygo_datx",
        "read_map_fits",
        "read_map_tiff",
        "read_map_npz",
        "read_map_npy",
        "read_map_table",
    ),
}
_OF_OTHERS = {
    "number": "holds one map", "array": "has no arrays by name", "quantity": "is no result of this program",
    "unit": "has its own unit",
}  # fmt: skip


def open_map(path: Path, options: MapOptions | None = None) -> HeightMap:
    """The map in a file, whatever its name is. options: what the file does not say.

    Raises ValueError, with one line that names the file, for what cannot be read.
    """
    path = Path(path)
    try:
        with open(path, "rb") as file:
            start = file.read(4096)
    except OSError as error:
        raise ValueError(f"{path}: not a readable file: {error.strerror or first_line(error)}") from None
    if not start:
        raise ValueError(f"{path}: not a readable map: 0 bytes")
    for signature, what in _OTHERS.items():
        if start.startswith(signature):
            raise ValueError(f"{path}: {what}")
    reader, options = _reader(path, start), options or MapOptions()
    for name, readers in _ONLY_OF.items():
        if getattr(options, name) is not None and reader.__name__ not in readers:
            raise ValueError(f"{path}: --{name}: must be left out, a file of this format {_OF_OTHERS[name]}")
    return reader(path, options)


def _reader(path: Path, start: bytes) -> Reader:
    """The reader for a file that begins so; the others' libraries are not imported."""
    if start[:3] == b"\x88\x1b\x03":
        from irtscots_cl.formats.zygo_dat import read_zygo_dat as reader
    elif start[:8] == b"\x89HDF\r\n\x1a\n":
        from irtscots_cl.formats.result_map import is_result, read_result_map

        if is_result(path):
            return read_result_map
        from irtscots_cl.formats.zygo_datx import read_zygo_datx as reader
    elif start[:6] == b"SIMPLE":
        from irtscots_cl.formats.map_fits import read_map_fits as reader
    elif start[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        from irtscots_cl.formats.map_tiff import read_map_tiff as reader
    elif start[:4] == b"PK\x03\x04":
        with reading(path, "zip"), zipfile.ZipFile(path) as archive:
            is_x3p = "main.xml" in archive.namelist()
        if is_x3p:
            from irtscots_cl.formats.iso_x3p import read_iso_x3p as reader
        else:
            from irtscots_cl.formats.map_npz import read_map_npz as reader
    elif start[:6] == b"\x93NUMPY":
        from irtscots_cl.formats.map_npz import read_map_npy as reader
    elif start[:8] in (b"aISO-1.0", b"bISO-1.0"):
        from irtscots_cl.formats.iso_sdf import read_iso_sdf as reader
    else:
        return _text_reader(path, start)
    return reader


def _text_reader(path: Path, start: bytes) -> Reader:
    from irtscots_cl.formats.codev_int import is_codev_int, read_codev_int
    from irtscots_cl.formats.map_table import is_table, read_map_table
    from irtscots_cl.formats.zemax_grid import is_zemax_grid, read_zemax_grid

    if b"\0" not in start:
        if is_codev_int(path):
            return read_codev_int
        if is_zemax_grid(path):
            return read_zemax_grid
        if is_table(path):
            return read_map_table
    raise ValueError(
        f"{path}: not a readable map: begins as none of MetroPro, DATX, result.h5, CODE V, Zemax grid, FITS, TIFF, "
        "CSV, XYZ, NPZ, NPY, SDF, X3P does (a table's line of names must begin with #, its decimals have points)"
    )


def format_of(path: Path) -> str:
    """The format to write by a name's ending. Raises ValueError for an ending that is none's."""
    suffix = path.suffix.lower()
    if suffix not in ENDINGS:
        raise ValueError(f"{path}: no format has the ending {suffix!r}: must be one of {', '.join(ENDINGS)}")
    return ENDINGS[suffix]


def write_map(
    path: Path,
    height_map: HeightMap,
    form: str | None = None,
    *,
    unit: str | None = None,
    terms: int = 37,
    disk: Unit | None = None,
) -> tuple[str, ...]:
    """Write a map. Returns notes: what the format does not hold, and how heights are rounded.

    form: one of FORMATS; default: by the name's ending, .dat being MetroPro's. unit: of the heights, for the formats
    WITH_UNIT; default: their own. terms, disk: of the Zernike files (codev-zfr, codev-zrn); the disk in mm, or in
    pixels from the map's middle where the pitch is unknown, by default the smallest that holds the valid pixels.

    Raises ValueError, with one line that names the file, for what a format cannot hold.
    """
    path = Path(path)
    form = form or format_of(path)
    if form not in FORMATS:
        raise ValueError(f"{path}: format {form!r}: must be one of {', '.join(FORMATS)}")
    if unit is not None and form not in WITH_UNIT:
        raise ValueError(f"{path}: unit {unit}: the format {form} has its own unit; leave it out")
    if not height_map.valid.any():
        raise ValueError(f"{path}: the map has no valid height")
    if not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {path.parent}")
    if form in ("codev-zfr", "codev-zrn"):
        from irtscots_cl.formats.codev_int import write_codev_zernike
        from irtscots_cl.formats.codev_zernike import disk_in_pixels

        pixels = None if disk is None else disk_in_pixels(height_map, disk)
        notes = write_codev_zernike(path, height_map, terms, form[-3:].upper(), pixels)
    elif disk is not None:
        raise ValueError(f"{path}: a disk is of codev-zfr and codev-zrn, not of the format {form}")
    elif form in WITH_UNIT:
        notes = _written_with_unit(path, height_map, form, unit)
    else:
        notes = _writer(form)(path, height_map)
    return (*notes, *_lost(height_map, form))


def _lost(height_map: HeightMap, form: str) -> tuple[str, ...]:
    """Notes on what a format has no place for."""
    notes: tuple[str, ...] = ()
    if height_map.intensity is not None and form not in WITH_INTENSITY:
        notes += (f"{len(height_map.intensity)} intensity frames are not written",)
    if max(map(abs, height_map.centre_mm)) > NEGLIGIBLE_MM and form not in WITH_CENTRE:
        x, y = height_map.centre_mm
        notes += (f"the map's centre, at {x:g}, {y:g} mm, is not written",)
    if height_map.comment and form not in WITH_COMMENT:
        notes += ("the map's comment is not written",)
    return notes


def _writer(form: str) -> Writer:
    if form == "zygo-dat":
        from irtscots_cl.formats.zygo_dat import write_zygo_dat as writer
    elif form == "zygo-datx":
        from irtscots_cl.formats.zygo_datx import write_zygo_datx as writer
    elif form == "codev":
        from irtscots_cl.formats.codev_int import write_codev_grid as writer
    elif form == "zemax":
        from irtscots_cl.formats.zemax_grid import write_zemax_grid as writer
    elif form == "npz":
        from irtscots_cl.formats.map_npz import write_map_npz as writer
    elif form == "sdf":
        from irtscots_cl.formats.iso_sdf import write_iso_sdf as writer
    else:
        from irtscots_cl.formats.iso_x3p import write_iso_x3p as writer
    return writer


def _written_with_unit(path: Path, height_map: HeightMap, form: str, unit: str | None) -> tuple[str, ...]:
    if form == "fits":
        from irtscots_cl.formats.map_fits import write_map_fits as writer
    elif form == "tiff":
        from irtscots_cl.formats.map_tiff import write_map_tiff as writer
    elif form == "csv":
        from irtscots_cl.formats.map_table import write_map_csv as writer
    elif form == "xyz":
        from irtscots_cl.formats.map_table import write_map_xyz as writer
    else:
        from irtscots_cl.formats.map_npz import write_map_npy as writer
    return writer(path, height_map) if unit is None else writer(path, height_map, unit)
