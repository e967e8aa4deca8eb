"""Zygo Mx's .datx: an HDF5 file with the surface, its units and converters, and the camera's intensity.

The surface is a dataset /Data/Surface/ID or, in files of some programs, /Measurement/Surface; its attributes tell the
unit (Fringes, or a length), the wavelength [m], the interferometric scale factor, the obliquity factor, the value
without data and the converters from pixels to metres. Rows: from the top, as in .dat.

Sources: docs/formats.md names those of every statement.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from irtscots_cl.formats.frames import MAX_UNPACKED, check_size, reading
from irtscots_cl.formats.hdf5 import opened
from irtscots_cl.formats.height_map import UNIT_MM, CameraPlace, Findings, HeightMap, MapOptions, unit_named
from irtscots_cl.formats.text_numbers import comment_lines, short
from irtscots_cl.formats.zygo_dat import INVALID, SCALE_FACTORS, kind_by_scale, writable_wavelength
from irtscots_cl.system.atomic_files import replacing

PLACES = ("Measurement/{0}", "Data/{0}")
IDENTITY = "{11111111-1111-1111-1111-111111111111}"
CONVERTER = np.dtype([("Category", "S32"), ("BaseUnit", "S32"), ("Parameters", "<f8", (4,))])
COORDINATES = np.dtype([("ColumnStart", "<i4"), ("RowStart", "<i4"), ("Width", "<i4"), ("Height", "<i4")])
LINK = np.dtype([("Source", "S64"), ("Link", "S64"), ("Destination", "S128")])
MAX_MAPS = 1000  # of a file
MAX_VALUES = 64  # of an attribute that is read


def read_zygo_datx(path: Path, options: MapOptions) -> HeightMap:
    """The map of a .datx file. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    with reading(path, "DATX"), opened(path) as file:
        surfaces = _datasets(file, "Surface")
        if not surfaces:
            raise ValueError(f"{path}: has no dataset /Measurement/Surface or /Data/Surface/ID, as a DATX file has")
        number = found.chosen(len(surfaces), "surfaces")
        data = surfaces[number]
        check_dataset(path, data)
        stored = np.asarray(data[()], float)
        no_data = _number(data, "No Data", float(INVALID))
        missing = (stored == no_data) | (stored >= (no_data if no_data >= INVALID else np.inf)) | ~np.isfinite(stored)
        values = np.where(missing, np.nan, stored)
        wavelength, scale = _number(data, "Wavelength", 0.0) * 1e9, _number(data, "Interferometric Scale Factor", 0.0)
        unit = _text(data, "Unit")
        if unit.lower() in ("fringes", "fringe"):
            wavelength = found.wavelength_nm(wavelength, needed=True) or 0.0
            unit_mm = wavelength * 1e-6 * _factor(found, "Interferometric Scale Factor", scale)
            unit_mm *= _factor(found, "Obliquity Factor", _number(data, "Obliquity Factor", 1.0))
        else:
            wavelength = found.wavelength_nm(wavelength) or 0.0
            unit_mm = found.unit_mm(_length(found, unit), wavelength or None)
        pitch = tuple(_pitch_mm(found, data, axis) for axis in "XY")
        if not all(pitch):
            pitch = (_general_pitch_mm(file),) * 2
        comment = comment_lines(_text(data, "Comment", 4000).splitlines())
        place, intensity = _place(data), _intensity(path, data, _datasets(file, "Intensity"), number, len(surfaces))
    return found.build(
        values[::-1],
        "Zygo DATX",
        unit_mm,
        pitch_mm=found.pitch_mm((pitch[0], pitch[1])),
        wavelength_nm=wavelength or None,
        kind=kind_by_scale(found, scale),
        intensity=intensity,
        camera=place,
        comment=comment,
    )


def _datasets(file: h5py.File, what: str) -> list[h5py.Dataset]:
    """The datasets of a kind, in this file itself: the one of the measurement, or all of the data."""
    for form in PLACES:
        place = form.format(what)
        parent, name = place.rsplit("/", 1)
        if not isinstance(file.get(parent, getlink=True), h5py.HardLink):
            continue
        if not isinstance(file[parent], h5py.Group):
            continue
        if not isinstance(file[parent].get(name, getlink=True), h5py.HardLink):
            continue
        data = file[parent][name]
        if isinstance(data, h5py.Dataset):
            return [data]
        inside = [data[k] for k in islice(data, MAX_MAPS) if isinstance(data.get(k, getlink=True), h5py.HardLink)]
        found = [one for one in inside if isinstance(one, h5py.Dataset)]
        if found:
            return found
    return []


def check_dataset(path: Path, data: h5py.Dataset) -> None:
    """Refuse what is no map of numbers in this file, or more than the file can hold, before it is read."""
    where = f"{path}: {short(data.name)}"
    if data.external or data.is_virtual:
        raise ValueError(f"{where}: its values are in another file; must be in this one")
    if data.shape is None or data.ndim != 2 or data.dtype.kind not in "fiu":
        raise ValueError(f"{where}: shape {list(data.shape or ())}, type {data.dtype}: must be numbers [rows, columns]")
    packed = data.chunks is not None and data.id.get_create_plist().get_nfilters() > 0
    stored = min(int(data.id.get_storage_size()), path.stat().st_size)
    check_size(where, data.shape[1], data.shape[0], 1, data.dtype.itemsize, stored, MAX_UNPACKED if packed else 1)


def _attribute(holder: Any, name: str) -> Any:
    """The first value of a short attribute; None where there is none."""
    if name not in holder.attrs:
        return None
    identity = h5py.h5a.open(holder.id, name.encode())
    if int(np.prod(identity.shape or (1,))) > MAX_VALUES or identity.get_storage_size() > 2**16:
        return None
    value = holder.attrs[name]
    flat = np.ravel(value) if isinstance(value, np.ndarray) else [value]
    return flat[0] if len(flat) else None


def _number(holder: Any, name: str, default: float) -> float:
    value = _attribute(holder, name)
    return float(value) if isinstance(value, (int, float, np.number)) else default


def _text(holder: Any, name: str, most: int = 0) -> str:
    """A short text, or one of at most so many characters."""
    value = _attribute(holder, name)
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value or "")
    return text[:most] if most else short(text)


def _factor(found: Findings, name: str, value: float) -> float:
    if not 0 < value <= 100:
        raise ValueError(f"{found.where}: {name} = {value:g}: must be above 0 and at most 100")
    return value


def _length(found: Findings, unit: str) -> str | None:
    name = unit_named(unit)
    if unit and (name is None or name == "wave"):
        raise ValueError(f"{found.where}: Unit = {unit!r}: must be Fringes or a unit of length such as NanoMeters")
    return name


def _pitch_mm(found: Findings, data: h5py.Dataset, axis: str) -> float:
    """The pitch along an axis by its converter; 0 where it is unknown."""
    value = _attribute(data, f"{axis} Converter")
    try:
        category, unit, parameters = value[0], value[1], value[-1]
        if bytes(category) != b"LateralCat" or bytes(unit) != b"Pixels":
            found.warnings.append(f"{axis} Converter is not from pixels: not used")
            return 0.0
        pitch = float(parameters[1]) * 1e3
    except (TypeError, IndexError, ValueError):
        return 0.0
    return pitch


def _general_pitch_mm(file: h5py.File) -> float:
    """The lateral resolution among the general attributes; 0 where there is none."""
    group = file.get("Attributes") if isinstance(file.get("Attributes", getlink=True), h5py.HardLink) else None
    if not isinstance(group, h5py.Group):
        return 0.0
    for name in list(group)[:4]:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            for key in ("Resolution", "Lateral Resolution"):
                pitch = _number(group[name], f"Data Context.Data Attributes.{key}:Value", 0.0)
                if pitch > 0:
                    return pitch * 1e3
    return 0.0


def _place(data: h5py.Dataset) -> CameraPlace | None:
    value = _attribute(data, "Coordinates")
    try:
        left, top, columns, rows = (int(value[k]) for k in range(4))
    except (TypeError, IndexError, ValueError):
        return None
    if (rows, columns) != data.shape or left < 0 or top < 0:
        return None
    return CameraPlace(left + columns, top + rows, left, top)


def _intensity(
    path: Path, surface: h5py.Dataset, frames: list[h5py.Dataset], number: int, surfaces: int
) -> NDArray[np.float32] | None:
    """Intensity [1, rows, columns] of the surface's pixels; None where the file has none of them, or it is not clear
    which of the frames belongs to which of the surfaces."""
    paired = len(frames) == surfaces or (frames and surfaces == 1)
    data = frames[number] if paired else None
    place, own = _place(surface), None if data is None else _place(data)
    if data is None:
        return None
    check_dataset(path, data)
    counts = np.asarray(data[()], np.float32)[::-1]
    if counts.shape == surface.shape and (
        place is None or own is None or (place.left, place.top) == (own.left, own.top)
    ):
        return np.ascontiguousarray(counts)[None]
    if place is None or own is None:
        return None
    rows, columns = surface.shape
    wide = np.full((max(own.rows, place.rows), max(own.columns, place.columns)), np.nan, np.float32)
    if wide.size > 16 * (counts.size + rows * columns):
        return None
    wide[own.top : own.rows, own.left : own.columns] = counts[::-1]
    return np.ascontiguousarray(wide[place.top : place.rows, place.left : place.columns][::-1])[None]


def write_zygo_datx(path: Path, height_map: HeightMap) -> tuple[str, ...]:
    """Write a .datx file: the surface in nanometres, float64, and its converters. Returns notes.

    The parts are those that public readers look for: /MetaData, /Data/Surface/ID, /Attributes/ID.
    """
    wavelength, notes = writable_wavelength(height_map)
    rows, columns = height_map.heights_mm.shape
    place = height_map.camera or CameraPlace(columns, rows, 0, 0)
    heights = height_map.heights_mm[::-1] / UNIT_MM["nm"]
    values = np.where(np.isfinite(heights), heights, float(INVALID))
    if not np.nanmax(heights) < INVALID:
        raise ValueError(f"{path}: heights up to {np.nanmax(heights) * 1e-6:g} mm: DATX holds at most 2147 mm")
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        surface = file.create_dataset(f"Data/Surface/{IDENTITY}", data=values)
        coordinates = np.array([(place.left, place.top, columns, rows)], COORDINATES)
        surface.attrs["Unit"] = np.array([b"NanoMeters"])
        if height_map.comment:
            surface.attrs["Comment"] = np.array(["\n".join(height_map.comment).encode()])
        for name, value in {
            "No Data": float(INVALID), "Wavelength": wavelength * 1e-9, "Obliquity Factor": 1.0,
            "Interferometric Scale Factor": SCALE_FACTORS[height_map.kind],
        }.items():  # fmt: skip
            surface.attrs[name] = np.array([value])
        for axis, pitch in zip("XY", height_map.pitch_mm or (0.0, 0.0), strict=True):
            parameters = (0.0, pitch * 1e-3, 0.0, 0.0)
            surface.attrs[f"{axis} Converter"] = np.array([(b"LateralCat", b"Pixels", parameters)], CONVERTER)
        heights_in = np.array([(b"HeightCat", b"NanoMeters", (0.0, 1.0, 0.0, 0.0))], CONVERTER)
        surface.attrs["Z Converter"] = heights_in
        surface.attrs["Coordinates"] = coordinates
        if height_map.intensity is not None:
            frame = np.nan_to_num(height_map.intensity[0, ::-1], nan=0.0)
            intensity = file.create_dataset(f"Data/Intensity/{IDENTITY}", data=np.clip(np.rint(frame), 0, 65535))
            intensity.attrs["Coordinates"] = coordinates
        general = file.create_group(f"Attributes/{IDENTITY}").attrs
        lateral = (height_map.pitch_mm or (0.0, 0.0))[0] * 1e-3
        general["Data Context.Data Attributes.Resolution:Value"] = np.array([lateral])
        links = [
            (b"Root", b"Measurement", b"{m}"),
            (b"Root", b"Attributes", b"{a}"),
            (b"{a}", b"Path", f"/Attributes/{IDENTITY}".encode()),
            (b"{m}", b"Surface", b"{s}"),
            (b"{s}", b"Path", f"/Data/Surface/{IDENTITY}".encode()),
        ]
        file.create_dataset("MetaData", data=np.array(links, LINK))
    if height_map.intensity is not None and len(height_map.intensity) > 1:
        notes += (f"of {len(height_map.intensity)} intensity frames the first is written",)
    return notes
