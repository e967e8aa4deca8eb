"""What `irtscots map` and `irtscots convert` share: options for what a file does not say, and reading it."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from irtscots_cl.cli.common import warn

if TYPE_CHECKING:
    from irtscots_cl.formats.height_map import HeightMap, MapOptions
    from irtscots_cl.maths.map_figures import Unit

FORMATS_READ = (
    "MetroPro .dat, DATX, CODE V .int, Zemax grid sag .DAT, FITS, TIFF, CSV, XYZ, NPZ, NPY, SDF or X3P, told by its "
    "content; or the result.h5 of this program"
)


def add_map_options(
    parser: argparse.ArgumentParser, wavelength: str = "wavelength where the file tells none, for heights in waves"
) -> None:
    """Options of what a file does not say, and of the kind that is wanted. wavelength: help of --wavelength-nm."""
    parser.add_argument(
        "--unit", metavar="U", help="unit of the file's heights where it tells none: m, cm, in, mm, um, nm or wave"
    )
    parser.add_argument(
        "--pitch-mm",
        metavar="P",
        help="distance between pixels, one number or X,Y; replaces the file's own, with a warning",
    )
    parser.add_argument("--wavelength-nm", type=float, metavar="W", help=wavelength)
    parser.add_argument(
        "--holds",
        metavar="K",
        help="surface or wavefront: what the file's heights are, where it does not tell or only its scale factor does",
    )
    parser.add_argument("--number", type=int, metavar="N", help="which map of a file with several, from 1")
    parser.add_argument("--array", metavar="NAME", help="array of an NPZ file that is not this program's; needs --unit")
    parser.add_argument(
        "--quantity", metavar="Q", help="of a result.h5: deviation (default), height or standard-error (of the height)"
    )
    parser.add_argument(
        "--disk",
        metavar="R[,X,Y]",
        help="disk of the Zernike terms: radius and centre in mm, or in pixels from the map's middle where the lateral "
        "scale is unknown; default: the smallest one about the valid pixels' middle that holds them whole",
    )
    kind = parser.add_mutually_exclusive_group()
    for name, text in (("surface", "half of a wavefront's"), ("wavefront", "twice a surface's")):
        kind.add_argument(
            f"--{name}",
            dest="kind",
            action="store_const",
            const=name,
            help=f"take the map as a {name}: heights are {text}; default: as the file has it",
        )


def read_map(path: Path, options: argparse.Namespace) -> HeightMap:
    """The map in a file, as the kind that is wanted; its warnings go to stderr. Raises ValueError."""
    from irtscots_cl.formats.maps import open_map

    height_map = open_map(path, told_of_map(options))
    for text in height_map.warnings:
        warn(f"{path}: {text}")
    return height_map if options.kind is None else height_map.as_kind(options.kind)


def told_of_map(options: argparse.Namespace) -> MapOptions:
    """What the options tell of a file."""
    from irtscots_cl.formats.height_map import MapOptions

    return MapOptions(
        options.unit, _pitch(options.pitch_mm), options.wavelength_nm, options.holds, options.number, options.array,
        options.quantity,
    )  # fmt: skip


def _pitch(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2):
        raise ValueError(f"--pitch-mm = {text}: must be one number, or two with a comma between")
    return numbers[0], numbers[-1]


def disk_of(options: argparse.Namespace, height_map: HeightMap) -> Unit | None:
    """The disk of --disk; None without. Raises ValueError for what is none."""
    if options.disk is None:
        return None
    from irtscots_cl.maths.map_figures import Unit

    try:
        numbers = [float(word) for word in options.disk.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3) or not all(map(math.isfinite, numbers)) or numbers[0] <= 0:
        raise ValueError(f"--disk = {options.disk}: must be a radius above 0, or radius, x and y with commas between")
    x, y = numbers[1:] if len(numbers) == 3 else height_map.centre_mm
    return Unit(numbers[0], x, y)


def map_facts(height_map: HeightMap) -> dict[str, object]:
    """What a map is, for JSON."""
    rows, columns = height_map.heights_mm.shape
    return {
        "origin": height_map.origin,
        "rows": rows,
        "columns": columns,
        "valid_pixels": int(height_map.valid.sum()),
        "pitch_mm": None if height_map.pitch_mm is None else list(height_map.pitch_mm),
        "wavelength_nm": height_map.wavelength_nm,
        "kind": height_map.kind,
        "comment": list(height_map.comment),
        "warnings": list(height_map.warnings),
    }


def described(height_map: HeightMap) -> str:
    """A map in one line."""
    rows, columns = height_map.heights_mm.shape
    pitch = height_map.pitch_mm
    lateral = "lateral scale unknown" if pitch is None else f"pixels of {pitch[0]:g} x {pitch[1]:g} mm"
    waves = "" if height_map.wavelength_nm is None else f", {height_map.wavelength_nm:g} nm"
    valid = int(height_map.valid.sum())
    return f"{height_map.kind}, {columns} x {rows} pixels, {valid} of them valid, {lateral}{waves}"
