"""Height maps in FITS files: one image, the bottom row first, unit and scale as keywords.

BUNIT is the heights' unit, CDELT1 and CDELT2 with CUNIT1 the pitch, CRVAL and CRPIX the centre. WAVELEN [nm] and
MAPKIND (SURFACE or WAVEFRONT) are keywords of this package. Values are read as formats/fits.py says.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.fits import open_fits, planes
from irtscots_cl.formats.frames import ReadOptions, reading
from irtscots_cl.formats.height_map import UNIT_MM, Findings, HeightMap, MapOptions, unit_named
from irtscots_cl.formats.text_numbers import comment_lines
from irtscots_cl.system.atomic_files import replacing


def read_map_fits(path: Path, options: MapOptions) -> HeightMap:
    """The map of a FITS file's image, its only one or the one told. Raises ValueError, with one line, if it cannot."""
    found = Findings(str(path), options)
    file = open_fits(path, ReadOptions())
    number = found.chosen(file.count, "images")
    found.warnings += [note for note in file.notes if "bottom-up" not in note and "top-down" not in note]
    heights = np.asarray(file.read(number), float)[::-1]
    with reading(path, "FITS"):
        header = _header(path, number)
        wavelength = found.wavelength_nm(_number(header, "WAVELEN"))
        unit = str(header.get("BUNIT", "")).strip()
        name = unit_named(unit)
        if unit and name is None:
            raise ValueError(f"{path}: BUNIT = {unit[:20]!r}: must be a length such as nm, or wave")
        unit_mm = found.unit_mm(name, wavelength)
        pitch, centre = _grid(header, heights.shape, found)
        kind = str(header.get("MAPKIND", "")).strip().lower() or None
        if kind not in (None, "surface", "wavefront"):
            raise ValueError(f"{path}: MAPKIND = {kind[:20]!r}: must be SURFACE or WAVEFRONT")
    return found.build(
        heights,
        "FITS",
        unit_mm,
        pitch_mm=found.pitch_mm(pitch),
        wavelength_nm=wavelength,
        kind=found.kind(kind),
        centre_mm=centre,
        comment=comment_lines(map(str, header.get("COMMENT", ()))),
    )


def _header(path: Path, number: int) -> Any:
    """Header of the unit that an image, by its number from 0, is in: each may have a unit and scale of its own."""
    from astropy.io import fits

    with open(path, "rb") as file, fits.open(file, memmap=False, do_not_scale_image_data=True) as units:
        with_images = (unit for unit in units if unit.is_image and unit.header.get("NAXIS", 0))
        of_images = [unit for unit in with_images for _ in range(planes(unit.header))]
        return of_images[number].header.copy()


def _number(header: Any, key: str) -> float | None:
    value = header.get(key)
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _grid(
    header: Any, shape: tuple[int, ...], found: Findings
) -> tuple[tuple[float, float] | None, tuple[float, float]]:
    """Pitch and centre in mm; no pitch where the unit is none of length, as on the sky."""
    scales = [UNIT_MM.get(unit_named(str(header.get(f"CUNIT{k}", ""))) or "", 0.0) for k in (1, 2)]
    steps = [_number(header, f"CDELT{k}") or 0.0 for k in (1, 2)]
    if not all(scales) or not all(steps):
        return None, (0.0, 0.0)
    if min(steps) < 0:
        found.warnings.append(f"CDELT1, CDELT2 = {steps[0]:g}, {steps[1]:g}: their signs are not used")
    centre = []
    for k, length in ((1, shape[1]), (2, shape[0])):
        at = _number(header, f"CRPIX{k}")
        at = (length + 1) / 2 if at is None else at
        centre.append(
            ((_number(header, f"CRVAL{k}") or 0.0) + ((length + 1) / 2 - at) * abs(steps[k - 1])) * scales[k - 1]
        )
    return (abs(steps[0]) * scales[0], abs(steps[1]) * scales[1]), (centre[0], centre[1])


def write_map_fits(path: Path, height_map: HeightMap, unit: str = "mm") -> tuple[str, ...]:
    """Write a FITS file of 64-bit heights in a unit of length. Returns notes. Raises ValueError without astropy."""
    try:
        from astropy.io import fits
    except ImportError:
        raise ValueError(f"{path}: a FITS file needs astropy: pip install irtscots-cl[fits]") from None
    image = fits.PrimaryHDU(height_map.heights_mm / UNIT_MM[unit])
    image.header["BUNIT"] = (unit, "unit of the heights")
    for line in height_map.comment:
        image.header.add_comment(line)
    image.header["ROWORDER"] = ("BOTTOM-UP", "first row: smallest y")
    image.header["MAPKIND"] = (height_map.kind.upper(), "a wavefront is twice the surface")
    if height_map.wavelength_nm is not None:
        image.header["WAVELEN"] = (height_map.wavelength_nm, "[nm]")
    if height_map.pitch_mm is not None:
        rows, columns = height_map.heights_mm.shape
        for k, pitch, length, centre in zip(
            (1, 2), height_map.pitch_mm, (columns, rows), height_map.centre_mm, strict=True
        ):
            image.header[f"CUNIT{k}"] = "mm"
            image.header[f"CDELT{k}"] = pitch
            image.header[f"CRPIX{k}"] = (length + 1) / 2
            image.header[f"CRVAL{k}"] = centre
    with replacing(path) as temporary, open(temporary, "wb") as file:
        image.writeto(file)
    return ()
