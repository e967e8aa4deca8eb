"""Height maps in TIFF files: one grey page of floating point, the top row first.

TIFF has no unit of heights. This package writes 32-bit floats and says unit, kind, wavelength, pitch and centre as JSON
in ImageDescription; files of others need to be told the unit.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.frames import ReadOptions, reading
from irtscots_cl.formats.height_map import KINDS, UNIT_MM, UNITS, Findings, HeightMap, MapOptions
from irtscots_cl.formats.text_numbers import comment_lines
from irtscots_cl.formats.tiff import open_tiff
from irtscots_cl.system.atomic_files import replacing

MARK = "irtscots_cl_map"
DESCRIPTION = 270  # the tag
MAX_TEXT = 10**4


def read_map_tiff(path: Path, options: MapOptions) -> HeightMap:
    """The map of a TIFF file's page, its only one or the one told. Raises ValueError, with one line, if it cannot."""
    found = Findings(str(path), options)
    file = open_tiff(path, ReadOptions())
    page = found.chosen(file.count, "pages")
    found.warnings += file.notes
    heights = np.asarray(file.read(page), float)[::-1]
    with reading(path, "TIFF"):
        said = _said(path, page)
        wavelength = found.wavelength_nm(_number(said, "wavelength_nm"))
        unit = said.get("unit")
        unit_mm = found.unit_mm(unit if unit in UNITS else None, wavelength)
        kind = said.get("kind")
        pitch, centre = _pair(said, "pitch_mm"), _pair(said, "centre_mm")
    return found.build(
        heights,
        "TIFF",
        unit_mm,
        pitch_mm=found.pitch_mm(pitch),
        wavelength_nm=wavelength,
        kind=found.kind(kind if kind in KINDS else None),
        centre_mm=centre or (0.0, 0.0),
        comment=comment_lines(str(said.get("comment", "")).splitlines()),
    )


def _said(path: Path, page: int) -> dict[str, Any]:
    """What this package wrote about the map; empty for files of others."""
    import tifffile

    with tifffile.TiffFile(path) as file:
        tag = file.pages[page].tags.get(DESCRIPTION)  # type: ignore[union-attr]
        text = "" if tag is None or tag.count > MAX_TEXT else str(tag.value)
    if MARK not in text:
        return {}
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}


def _number(said: dict[str, Any], key: str) -> float | None:
    value = said.get(key)
    return float(value) if isinstance(value, (int, float)) else None


def _pair(said: dict[str, Any], key: str) -> tuple[float, float] | None:
    value = said.get(key)
    if not isinstance(value, list) or len(value) != 2 or not all(isinstance(v, (int, float)) for v in value):
        return None
    return float(value[0]), float(value[1])


def write_map_tiff(path: Path, height_map: HeightMap, unit: str = "nm") -> tuple[str, ...]:
    """Write a TIFF file of 32-bit floats in a unit of length. Returns notes."""
    import tifffile

    said = {
        MARK: 1, "unit": unit, "kind": height_map.kind, "wavelength_nm": height_map.wavelength_nm,
        "pitch_mm": height_map.pitch_mm, "centre_mm": height_map.centre_mm, "first_row": "top",
        "comment": "\n".join(height_map.comment),
    }  # fmt: skip
    heights = (height_map.heights_mm[::-1] / UNIT_MM[unit]).astype(np.float32)
    with replacing(path) as temporary:
        tifffile.imwrite(
            temporary, heights, photometric="minisblack", description=json.dumps(said), metadata=None, software=False
        )
    return (f"heights are 32-bit floats in {unit}: rounded to 6e-8 of each",)
