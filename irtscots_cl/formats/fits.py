"""FITS files of cameras, read by astropy: images and stacks of integers or floating point.

The values are those of the standard: BZERO + BSCALE x stored, NaN for BLANK. This is done here on the values as stored,
since astropy does not look at BLANK in unsigned images. The standard has the picture's bottom row first; a file whose
ROWORDER says TOP-DOWN has its top row first.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.frames import (
    MAX_UNPACKED,
    Frame,
    ImageFile,
    ReadOptions,
    check_size,
    exposure_time,
    native,
    reading,
)

# (BITPIX, BZERO) of whole numbers whose sign is changed: the standard's way to store them.
SIGN_CHANGED = {(8, -128): "i1", (16, 2**15): "u2", (32, 2**31): "u4", (64, 2**63): "u8"}
PLAIN = {8: "u1", 16: "i2", 32: "i4", 64: "i8", -32: "f4", -64: "f8"}
EXPOSURE_KEYS = ("EXPTIME", "EXPOSURE")  # both in seconds
COLOUR_KEYS = ("BAYERPAT", "COLORTYP", "CFA")


def open_fits(path: Path, options: ReadOptions) -> ImageFile:
    """The images of a FITS file: those of its header-data units, a stack [frames, rows, columns] being many frames.

    Raises ValueError, with one line, for what is no grey stack of equal images.
    """
    fits = _library(path)
    places: list[tuple[int, int]] = []  # of the frames: unit, plane
    notes: list[str] = []
    exposures: set[float | None] = set()
    with reading(path, "FITS"), _opened(fits, path) as units:
        first: Any = None
        for number, unit in enumerate(units):
            if not unit.is_image:
                notes.append(f"unit {number + 1} is no image: left out")
                continue
            if not unit.header.get("NAXIS", 0):
                continue
            form = _checked(path, number, unit, options)
            first = first or form
            if form[1:] != first[1:]:
                sizes = [f"{f[1][1]} x {f[1][0]} pixels of {f[2]}" for f in (form, first)]
                raise ValueError(f"{path}: unit {number + 1}: {sizes[0]}; the first has {sizes[1]}: must be equal")
            exposures.add(next((exposure_time(unit.header[key]) for key in EXPOSURE_KEYS if key in unit.header), None))
            places += [(number, plane) for plane in range(form[0])]
        if first is None:
            raise ValueError(f"{path}: no image in it")
        _, shape, dtype, bits, top_first, note = first
    notes += note

    def read(number: int) -> Frame:
        return _read(path, places[number], top_first, dtype)

    exposure = exposures.pop() if len(exposures) == 1 else None
    return ImageFile(path, shape, len(places), dtype, bits, read, tuple(notes), exposure_s=exposure)


def _library(path: Path) -> Any:
    try:
        from astropy.io import fits
    except ImportError:
        raise ValueError(f"{path}: a FITS file needs astropy: pip install irtscots-cl[fits]") from None
    return fits


@contextmanager
def _opened(fits: Any, path: Path) -> Iterator[Any]:
    """The header-data units with their values as stored. astropy leaves a broken file open that it opened itself."""
    with (
        open(path, "rb") as file,
        fits.open(file, do_not_scale_image_data=True, memmap=False, uint=False, ignore_blank=True) as units,
    ):
        yield units


def _checked(
    path: Path, number: int, unit: Any, options: ReadOptions
) -> tuple[int, tuple[int, int], np.dtype[Any], int, bool, tuple[str, ...]]:
    """Of an image unit: frames, shape, dtype, bits, whether the top row comes first, notes."""
    where, header = f"{path}: unit {number + 1}", unit.header
    axes = _axes(header)
    if len(axes) not in (2, 3):
        raise ValueError(f"{where}: {len(axes)} axes: must be 2, or 3 for a stack")
    for key in COLOUR_KEYS:
        if str(header.get(key, "")).strip() not in ("", "F", "False", "MONO"):
            raise ValueError(f"{where}: {key} = {str(header[key])[:20]!r}: colour; must be grey")
    bitpix, count = int(header["BITPIX"]), planes(header)
    if bitpix not in PLAIN:
        raise ValueError(f"{where}: BITPIX = {bitpix}: must be one of {', '.join(map(str, PLAIN))}")
    packed = type(unit).__name__ == "CompImageHDU"
    start = 0 if packed else int(unit.fileinfo()["datLoc"])
    stored = path.stat().st_size - start
    check_size(where, axes[0], axes[1], count, abs(bitpix) / 8, stored, MAX_UNPACKED if packed else 1)
    dtype, bits, notes = _values_of(where, header, bitpix)
    top_first, said = _top_first(where, header, options)
    return count, (axes[1], axes[0]), dtype, bits, top_first, (*notes, said)


def _axes(header: Any) -> list[int]:
    """Lengths of an image's axes, without trailing ones of length 1 beyond the second."""
    axes = [int(header[f"NAXIS{k + 1}"]) for k in range(int(header["NAXIS"]))]
    while len(axes) > 2 and axes[-1] == 1:
        axes.pop()
    return axes


def planes(header: Any) -> int:
    """Images [rows, columns] in a header's stack of 2 or 3 axes."""
    axes = _axes(header)
    return axes[2] if len(axes) == 3 else 1


def _scale(header: Any) -> tuple[float, float]:
    return float(header.get("BZERO", 0.0)), float(header.get("BSCALE", 1.0))


def _values_of(where: str, header: Any, bitpix: int) -> tuple[np.dtype[Any], int, tuple[str, ...]]:
    """dtype and bits of the values that the header makes of the stored ones."""
    zero, scale = _scale(header)
    if not (np.isfinite(zero) and np.isfinite(scale) and scale != 0):
        raise ValueError(f"{where}: BZERO = {zero:g}, BSCALE = {scale:g}: must be finite, the scale not 0")
    if bitpix < 0 or scale != 1 or (zero and (bitpix, int(zero)) not in SIGN_CHANGED):
        note = (f"scaled by BZERO = {zero:g}, BSCALE = {scale:g}: the saturation is not known",)
        is_scaled = (zero, scale) != (0, 1)
        return np.dtype("f8" if is_scaled else PLAIN[bitpix]), 0, note if is_scaled else ()
    dtype = np.dtype(SIGN_CHANGED[bitpix, int(zero)] if zero else PLAIN[bitpix])
    bits = 8 * dtype.itemsize - (dtype.kind == "i")
    if "BLANK" not in header:
        return dtype, bits, ()
    return np.dtype("f4" if bits <= 16 else "f8"), bits, (f"BLANK = {header['BLANK']}: these samples are missing",)


def _top_first(where: str, header: Any, options: ReadOptions) -> tuple[bool, str]:
    """Whether the top row comes first, and how that is known."""
    said = str(header.get("ROWORDER", "")).strip().lower()
    if options.fits_rows is not None:
        return options.fits_rows == "top-down", f"rows are {options.fits_rows}, as told"
    if said in ("top-down", "bottom-up"):
        return said == "top-down", f"rows are {said}, as its ROWORDER says"
    if said:
        raise ValueError(f"{where}: ROWORDER = {said[:20]!r}: must be TOP-DOWN or BOTTOM-UP")
    return False, "rows are bottom-up, by the standard; it has no ROWORDER"


def _read(path: Path, place: tuple[int, int], top_first: bool, dtype: np.dtype[Any]) -> Frame:
    fits = _library(path)
    with reading(path, "FITS"), _opened(fits, path) as units:
        unit = units[place[0]]
        header, axes = unit.header.copy(), int(unit.header["NAXIS"])
        if axes == 2:
            stored = unit.section[:, :]
        else:
            stored = unit.section[(*(0 for _ in range(axes - 3)), place[1])]
        values = _physical(native(np.asarray(stored)), header, dtype)
    return np.ascontiguousarray(values if top_first else values[::-1])


def _physical(stored: Frame, header: Any, dtype: np.dtype[Any]) -> Frame:
    """BZERO + BSCALE x stored, and NaN for BLANK."""
    zero, scale = _scale(header)
    blank = stored == int(header["BLANK"]) if stored.dtype.kind != "f" and "BLANK" in header else None
    if scale == 1 and (8 * stored.itemsize, int(zero)) in SIGN_CHANGED and stored.dtype.kind != "f":
        whole = np.dtype(SIGN_CHANGED[8 * stored.itemsize, int(zero)])
        values: Frame = stored.view(whole) ^ whole.type(1 << (8 * whole.itemsize - 1) if whole.kind == "u" else -128)
    elif (zero, scale) != (0, 1):
        values = zero + scale * stored.astype(float)
    else:
        values = stored
    values = values.astype(dtype, copy=False)
    if blank is not None and blank.any():
        values = np.where(blank, np.asarray(np.nan, dtype), values)
    return values
