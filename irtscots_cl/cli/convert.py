"""The command `irtscots convert`."""

from __future__ import annotations

import argparse
from pathlib import Path

from irtscots_cl.cli.common import command, print_json
from irtscots_cl.cli.map_options import FORMATS_READ, add_map_options, described, disk_of, map_facts, read_map


def add(commands) -> None:
    parser = command(
        commands,
        "convert",
        _execute,
        "write a height map in another format",
        "What a format does not hold, and how it rounds, is said. docs/formats.md has what each format says.",
        example="out/result.h5 mirror.dat",
    )
    parser.add_argument("source", metavar="A", type=Path, help=f"a map: {FORMATS_READ}")
    parser.add_argument(
        "target",
        metavar="B",
        type=Path,
        help="file to write; its ending tells the format: .dat, .datx, .int, .fits, .tif, .csv, .xyz, .npz, .npy, "
        ".sdf, .x3p",
    )
    parser.add_argument(
        "--format",
        dest="form",
        metavar="F",
        help="format of B where the ending does not tell it: zemax (grid sag .DAT), codev-zfr or codev-zrn (fringe or "
        "standard Zernike coefficients), or another one by its name",
    )
    parser.add_argument(
        "--terms", type=int, default=37, metavar="N", help="Zernike terms of codev-zfr and codev-zrn; default 37"
    )
    parser.add_argument(
        "--to-unit", metavar="U", help="unit of B's heights, where its format has a choice: m, cm, in, mm, um or nm"
    )
    parser.add_argument("--flip", metavar="AXES", help="x (left and right), y (top and bottom) or xy")
    parser.add_argument(
        "--rotate",
        action="count",
        default=0,
        help="a quarter turn counterclockwise, x to the right and y up, after any flip; may be repeated",
    )
    parser.add_argument("--negate", action="store_true", help="turn heights over")
    add_map_options(parser)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.formats.height_map import UNIT_MM
    from irtscots_cl.formats.maps import FORMATS, format_of, write_map

    form = options.form or format_of(options.target)
    if form not in FORMATS:
        raise ValueError(f"--format = {form}: must be one of {', '.join(FORMATS)}")
    if options.to_unit not in (None, *UNIT_MM):
        raise ValueError(f"--to-unit = {options.to_unit}: must be one of {', '.join(UNIT_MM)}")
    if options.target.is_dir():
        raise ValueError(f"{options.target}: is a folder; must be a file to write")
    if options.target.exists() and options.source.exists() and options.target.samefile(options.source):
        raise ValueError(f"{options.target}: is the file to read; must be another one")
    height_map = read_map(options.source, options)
    if options.flip is not None:
        height_map = height_map.flipped(options.flip)
    for _ in range(options.rotate % 4):
        height_map = height_map.rotated()
    if options.negate:
        height_map = height_map.negated()
    disk = disk_of(options, height_map)
    notes = write_map(options.target, height_map, form, unit=options.to_unit, terms=options.terms, disk=disk)
    if options.json:
        print_json({**map_facts(height_map), "written": str(options.target), "format": form, "notes": list(notes)})
        return 0
    print(f"{options.target}: {form}, {described(height_map)}, from {height_map.origin}")
    for note in notes:
        print(f"  {note}")
    return 0
