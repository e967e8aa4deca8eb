"""The option `--export` of run and reconstruct: the measured deviation as a map of another program."""

from __future__ import annotations

import argparse
from pathlib import Path

from irtscots_cl.cli.common import warn


def add_export(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--export",
        action="append",
        default=[],
        metavar="FILE",
        help="also write the deviation from the design as a map; the ending tells the format (.dat, .datx, .int, "
        ".fits, .tif, .csv, .xyz, .npz, .npy, .sdf, .x3p), or its name and a colon before the file do "
        "(zemax:part.dat); may be repeated. `irtscots convert DIR/result.h5 FILE` does the same later",
    )


def export_targets(options: argparse.Namespace) -> list[tuple[Path, str]]:
    """File and format of every --export. Raises ValueError, before anything is computed, for what cannot be written."""
    from irtscots_cl.formats.maps import FORMATS, format_of

    targets: list[tuple[Path, str]] = []
    for text in options.export:
        word, colon, rest = text.partition(":")
        path = Path(rest if colon and word in FORMATS else text)
        form = word if colon and word in FORMATS else format_of(path)
        if not path.parent.is_dir():
            raise ValueError(f"--export = {text}: there is no folder {path.parent}")
        if path.is_dir():
            raise ValueError(f"--export = {text}: is a folder; must be a file to write")
        if path in (one for one, _ in targets):
            raise ValueError(f"--export = {text}: is given twice")
        if form == "fits":
            _needs_astropy(text)
        targets.append((path, form))
    return targets


def _needs_astropy(text: str) -> None:
    from importlib.util import find_spec

    if find_spec("astropy") is None:
        raise ValueError(f"--export = {text}: a FITS file needs astropy: pip install irtscots-cl[fits]")


def export(folder: Path, targets: list[tuple[Path, str]]) -> dict[str, object]:
    """Write the deviation of the folder's result.h5. Returns facts for the JSON, empty without targets.

    Raises ValueError, with one line that says so, where the results are there and a map of them cannot be written.
    """
    from irtscots_cl.formats.maps import open_map, write_map

    if not targets:
        return {}
    result = folder / "result.h5"
    try:
        height_map = open_map(result)
        written = []
        for path, form in targets:
            notes = write_map(path, height_map, form)
            written.append({"file": str(path), "format": form, "notes": list(notes)})
    except ValueError as error:
        raise ValueError(f"{error} (--export; results are in {folder})") from None
    for text in height_map.warnings:
        if "wavelength" not in text:
            warn(f"{result}: {text}")
    return {"exported": written}


def print_exported(facts: dict[str, object]) -> None:
    """What was written, for people."""
    for one in facts.get("exported", ()):  # type: ignore[attr-defined]
        print(f"map in {one['file']}" + "".join(f"; {note}" for note in one["notes"]))
