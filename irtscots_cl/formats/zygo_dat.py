"""Zygo MetroPro's binary .dat: phase in counts of a fringe, with the camera's intensity frames.

A header of 834 bytes (formats 1 and 2) or 4096 (format 3), mostly big endian, then the intensity frames (16 bits) and
the phase (32 bits). Height = counts x S x O x wavelength / R, with the interferometric scale factor S (waves per
fringe), the obliquity factor O and R counts per fringe by the phase resolution code. Rows: from the top of the monitor,
where the camera's frame begins.

Sources: docs/formats.md names those of every statement.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.binary_array import binary_array
from irtscots_cl.formats.frames import check_size, reading
from irtscots_cl.formats.height_map import (
    SURFACE,
    WAVEFRONT,
    CameraPlace,
    Findings,
    HeightMap,
    MapOptions,
    square_pitch,
)
from irtscots_cl.formats.text_numbers import comment_lines
from irtscots_cl.system.atomic_files import replacing

MAGICS = {b"\x88\x1b\x03\x6f": (1, 834), b"\x88\x1b\x03\x70": (2, 834), b"\x88\x1b\x03\x71": (3, 4096)}
COUNTS = {0: 4096, 1: 32768, 2: 131072}  # per fringe, by the phase resolution code
INVALID = 2147483640  # and above
INVALID_INTENSITY = 65412  # and above
DEFAULT_WAVELENGTH_NM = 632.8
COMMENT = slice(80, 162)  # text that ends with a 0
MOST_COMMENT = 81  # characters of it
SCALE_FACTORS = {SURFACE: 0.5, WAVEFRONT: 1.0}
# Where the header's values are, and their types.
_FIELDS = {
    "header_format": (4, ">H"), "header_size": (6, ">I"), "ac": (48, ">HHHHHHI"), "cn": (64, ">HHHHI"),
    "scale_factor": (164, ">f"), "wavelength_m": (168, ">f"), "obliquity": (176, ">f"), "lateral_m": (184, ">f"),
    "phase_res": (218, ">H"), "sign": (232, ">H"), "camera": (234, ">HH"),
}  # fmt: skip


@dataclass(frozen=True)
class _Layout:
    """Sizes and places in the camera's frame (left, top, columns, rows) of intensity and phase, and the frames."""

    header: int
    frames: int
    intensity: tuple[int, int, int, int]
    phase: tuple[int, int, int, int]

    @property
    def phase_at(self) -> int:
        return self.header + 2 * self.frames * self.intensity[2] * self.intensity[3]


def read_zygo_dat(path: Path, options: MapOptions) -> HeightMap:
    """The map of a MetroPro file. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    with reading(path, "MetroPro"):
        size = path.stat().st_size
        with open(path, "rb") as file:
            header = file.read(834)
        layout = _layout(found, header, size)
        left, top, columns, rows = layout.phase
        counts = binary_array(path, np.dtype(">i4"), layout.phase_at, rows, columns)
        wavelength = found.wavelength_nm(_get(header, "wavelength_m")[0] * 1e9, needed=True)
        assert wavelength is not None
        heights = np.where(counts >= INVALID, np.nan, counts * _mm_per_count(found, header, wavelength))
        lateral = _get(header, "lateral_m")[0] * 1e3
        frame_columns, frame_rows = _get(header, "camera")
        place = CameraPlace(max(frame_columns, left + columns), max(frame_rows, top + rows), left, top)
        intensity = _intensity(path, layout) if layout.frames else None
    return found.build(
        heights[::-1],
        "Zygo MetroPro",
        pitch_mm=found.pitch_mm((lateral, lateral)),
        wavelength_nm=wavelength,
        kind=_kind(found, header),
        intensity=intensity,
        camera=place,
        comment=comment_lines([header[COMMENT].split(b"\0")[0].decode("ascii", "replace")]),
    )


def _get(header: bytes, name: str) -> tuple[Any, ...]:
    at, form = _FIELDS[name]
    return struct.unpack_from(form, header, at)


def _layout(found: Findings, header: bytes, size: int) -> _Layout:
    where = found.where
    if header[:4] not in MAGICS or len(header) < 834:
        raise ValueError(f"{where}: not a readable MetroPro file: {len(header)} bytes of its header, of at least 834")
    form, length = MAGICS[header[:4]]
    said = (_get(header, "header_format")[0], _get(header, "header_size")[0])
    if said != (form, length):
        raise ValueError(
            f"{where}: header of format {said[0]} and {said[1]} bytes: must be format {form} and {length} by its "
            "first bytes"
        )
    x, y, columns, rows, frames, _, stored = _get(header, "ac")
    if frames == 0 and columns * rows and stored == 2 * columns * rows:
        frames = 1  # some writers leave the number out
    if not columns * rows:
        frames = 0
    if stored != 2 * columns * rows * frames and frames:
        found.warnings.append(
            f"intensity of {columns} x {rows} pixels, {frames} frames, said to have {stored} bytes: the sizes are used"
        )
    left, top, width, height, _ = _get(header, "cn")
    if not width * height:
        raise ValueError(f"{where}: holds no phase: {width} x {height} pixels")
    layout = _Layout(length, frames, (x, y, columns, rows), (left, top, width, height))
    if frames:
        check_size(f"{where}: intensity", columns, rows, frames, 2, max(0, size - length), 1)
        check_size(f"{where}: intensity", width, height, frames, 2, 2 * size, 4)  # cut to the phase's pixels
    check_size(f"{where}: phase", width, height, 1, 4, max(0, size - layout.phase_at), 1)
    rest = size - layout.phase_at - 4 * width * height
    if rest:
        found.warnings.append(f"{rest} bytes after the phase: not read")
    return layout


def _mm_per_count(found: Findings, header: bytes, wavelength_nm: float) -> float:
    code, sign = _get(header, "phase_res")[0], _get(header, "sign")[0]
    if code not in COUNTS:
        raise ValueError(f"{found.where}: phase resolution code {code}: must be 0, 1 or 2")
    if sign not in (0, 1):
        raise ValueError(f"{found.where}: sign word {sign}: must be 0 or 1")
    if sign:
        found.warnings.append("sign word 1 (inverted): heights are turned over; some readers leave them as stored")
    scale, obliquity = _get(header, "scale_factor")[0], _get(header, "obliquity")[0]
    if not 0 < scale <= 100:
        raise ValueError(f"{found.where}: interferometric scale factor {scale:g}: must be above 0 and at most 100")
    if obliquity == 0:
        found.warnings.append("obliquity factor 0: taken as 1")
        obliquity = 1.0
    if not 0 < obliquity <= 100:
        raise ValueError(f"{found.where}: obliquity factor {obliquity:g}: must be above 0 and at most 100")
    return float((-1 if sign else 1) * scale * obliquity * wavelength_nm * 1e-6 / COUNTS[code])


def _kind(found: Findings, header: bytes) -> str:
    """By the scale factor, where nothing else is told: half a wave per fringe is a surface seen once in reflection."""
    return kind_by_scale(found, _get(header, "scale_factor")[0])


def kind_by_scale(found: Findings, scale: float) -> str:
    """Surface or wavefront by an interferometric scale factor: 0.5 or 1 wave per fringe."""
    if found.told.kind:
        return found.told.kind
    for kind, factor in SCALE_FACTORS.items():
        if abs(scale - factor) < 1e-6:
            return kind
    found.warnings.append(f"interferometric scale factor {scale:g}, neither 0.5 nor 1: taken as a surface")
    return SURFACE


def _intensity(path: Path, layout: _Layout) -> NDArray[np.float32]:
    """Intensity [frames, rows, columns] of the phase's pixels, in the map's row order; NaN outside its own frame."""
    x, y, columns, rows = layout.intensity
    left, top, width, height = layout.phase
    out = np.full((layout.frames, height, width), np.nan, np.float32)
    first_x, first_y = max(x, left), max(y, top)
    last_x, last_y = min(x + columns, left + width), min(y + rows, top + height)
    for frame in range(layout.frames):
        at = layout.header + 2 * frame * columns * rows
        counts = binary_array(path, np.dtype(">u2"), at, rows, columns)
        if first_x < last_x and first_y < last_y:
            part = counts[first_y - y : last_y - y, first_x - x : last_x - x]
            values = np.where(part >= INVALID_INTENSITY, np.nan, part).astype(np.float32)
            out[frame, first_y - top : last_y - top, first_x - left : last_x - left] = values
    return np.ascontiguousarray(out[:, ::-1])


def write_zygo_dat(path: Path, height_map: HeightMap) -> tuple[str, ...]:
    """Write a MetroPro file of format 1. Returns notes on what it does not hold.

    Heights are rounded to counts of 1/32768 of a fringe, which all readers know, or of 1/4096 where they would
    overflow. Raises ValueError for pixels that are not square, and heights out of the range.
    """
    lateral = square_pitch(str(path), height_map, "a MetroPro file") or 0.0
    wavelength, notes = writable_wavelength(height_map)
    rows, columns = height_map.heights_mm.shape
    if max(rows, columns) > 65535:
        raise ValueError(f"{path}: {columns} x {rows} pixels: a MetroPro file holds at most 65535 each way")
    scale = SCALE_FACTORS[height_map.kind]
    stored_wavelength = float(np.float32(wavelength * 1e-9))
    waves = height_map.heights_mm[::-1] * 1e-3 / stored_wavelength / scale
    code = next((c for c in (1, 0) if not np.nanmax(np.abs(waves)) * COUNTS[c] >= INVALID - 1), None)
    if code is None:
        raise ValueError(
            f"{path}: heights up to {np.nanmax(np.abs(height_map.heights_mm)):g} mm: a MetroPro file holds at most "
            f"{INVALID / COUNTS[0] * scale * wavelength * 1e-6:g} mm"
        )
    counts = np.where(np.isfinite(waves), np.rint(waves * COUNTS[code]), INVALID).astype(">i4")
    place = height_map.camera or CameraPlace(columns, rows, 0, 0)
    intensity = b""
    ac = (0, 0, 0, 0, 0, 0, 0)
    if height_map.intensity is not None:
        frames = height_map.intensity[:, ::-1]
        known = np.isfinite(frames)
        clipped = np.where(known, np.clip(np.rint(np.where(known, frames, 0)), 0, INVALID_INTENSITY - 1), 65535)
        intensity = clipped.astype(">u2").tobytes()
        ac = (place.left, place.top, columns, rows, len(frames), INVALID_INTENSITY - 1, len(intensity))
    header = bytearray(834)
    header[:4] = next(iter(MAGICS))
    for name, values in {
        "header_format": (1,), "header_size": (834,), "ac": ac,
        "cn": (place.left, place.top, columns, rows, counts.nbytes), "scale_factor": (scale,),
        "wavelength_m": (stored_wavelength,), "obliquity": (1.0,), "lateral_m": (lateral * 1e-3,),
        "phase_res": (code,), "sign": (0,), "camera": (place.columns, place.rows),
    }.items():  # fmt: skip
        struct.pack_into(_FIELDS[name][1], header, _FIELDS[name][0], *values)
    comment = "; ".join(height_map.comment or ("irtscots-cl",)).encode("ascii", "replace")
    if len(comment) > MOST_COMMENT:
        notes = (*notes, f"the map's comment is cut to {MOST_COMMENT} characters")
    header[COMMENT] = comment[:MOST_COMMENT].ljust(MOST_COMMENT + 1, b"\0")
    with replacing(path) as temporary:
        temporary.write_bytes(bytes(header) + intensity + counts.tobytes())
    quantum = scale * wavelength / COUNTS[code]
    return (*notes, f"heights are rounded to {quantum:.3g} nm")


def writable_wavelength(height_map: HeightMap) -> tuple[float, tuple[str, ...]]:
    """The wavelength for a format that counts in waves, with a note where the map has none."""
    if height_map.wavelength_nm is not None:
        return height_map.wavelength_nm, ()
    return DEFAULT_WAVELENGTH_NM, (f"the map has no wavelength: {DEFAULT_WAVELENGTH_NM} nm is written as its unit",)
