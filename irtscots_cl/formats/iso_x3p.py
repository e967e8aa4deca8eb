"""ISO 25178-72's .x3p: a zip with main.xml and the heights in binary, in metres.

main.xml has the axes (Record1: increments, offset, type of the values) and the size and place of the values (Record3).
Points follow along x, then y, the first one at the smallest x and y. Invalid points are NaN, or those whose bit is 0 in
the file of valid points.

Sources: docs/formats.md names those of every statement.
"""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from irtscots_cl.formats.frames import check_size, reading
from irtscots_cl.formats.height_map import SURFACE, Findings, HeightMap, MapOptions
from irtscots_cl.formats.npz import DEFLATE_RATIO
from irtscots_cl.formats.text_numbers import number, short, whole_number
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.system.atomic_files import replacing

MAIN = "main.xml"
DATA = "bindata/data.bin"
TYPES = {"I": "<i2", "L": "<i4", "F": "<f4", "D": "<f8"}
MAX_XML = 2**20
NAMESPACE = "http://www.opengps.eu/2008/ISO5436_2"


def read_iso_x3p(path: Path, options: MapOptions) -> HeightMap:
    """The map of an X3P file. Raises ValueError, with one line, for what cannot be read."""
    found = Findings(str(path), options)
    with reading(path, "X3P"), zipfile.ZipFile(path) as archive:
        said = _main(path, archive)
        columns, rows = (
            whole_number(_said(path, said, f"MatrixDimension/{k}"), f"{path}: {k}", 1, 2**24)
            for k in ("SizeX", "SizeY")
        )
        if said.get("MatrixDimension/SizeZ", "1") != "1":
            raise ValueError(f"{path}: SizeZ = {short(said['MatrixDimension/SizeZ'])}: must be 1")
        kind = _said(path, said, "CZ/DataType")
        if kind not in TYPES:
            raise ValueError(f"{path}: CZ/DataType = {short(kind)}: must be one of {', '.join(TYPES)}")
        values = _values(path, archive, _said(path, said, "DataLink/PointDataLink"), (rows, columns), TYPES[kind])
        values = values * _number(path, said, "CZ/Increment", 1.0) + _number(path, said, "CZ/Offset", 0.0)
        link = said.get("DataLink/ValidPointsLink")
        if link:
            values = np.where(_valid(path, archive, link, (rows, columns)), values, np.nan)
        pitch = tuple(_number(path, said, f"{axis}/Increment", 0.0) * 1e3 for axis in ("CX", "CY"))
        for axis in ("CX", "CY"):
            if said.get(f"{axis}/AxisType", "I") != "I":
                raise ValueError(f"{path}: {axis}/AxisType: must be I, even steps")
    return found.build(
        values,
        "X3P",
        1e3,
        pitch_mm=found.pitch_mm((pitch[0], pitch[1])),
        wavelength_nm=options.wavelength_nm,
        kind=found.kind(SURFACE),
    )


def _main(path: Path, archive: zipfile.ZipFile) -> dict[str, str]:
    """Texts of main.xml by the last two names of their place."""
    if MAIN not in archive.namelist():
        raise ValueError(f"{path}: has no {MAIN}")
    with archive.open(MAIN) as stream:
        text = stream.read(MAX_XML + 1)
    if len(text) > MAX_XML or b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise ValueError(f"{path}: {MAIN}: must have at most {MAX_XML} bytes, and no entities of its own")
    said: dict[str, str] = {}
    for parent in ElementTree.fromstring(text).iter():
        for child in parent:
            place = "/".join(element.tag.rsplit("}", 1)[-1] for element in (parent, child))
            said.setdefault(place, (child.text or "").strip())
    return said


def _said(path: Path, said: dict[str, str], place: str) -> str:
    if not said.get(place):
        raise ValueError(f"{path}: {MAIN} has no {place}")
    return said[place]


def _number(path: Path, said: dict[str, str], place: str, default: float) -> float:
    value = number(said[place], f"{path}: {place}") if said.get(place) else default
    if not np.isfinite(value):
        raise ValueError(f"{path}: {place} = {value:g}: must be finite")
    return value


def _member(path: Path, archive: zipfile.ZipFile, name: str, needed: int) -> bytes:
    """The bytes of a file of the archive, of which so many are needed."""
    try:
        info = archive.getinfo(name)
    except KeyError:
        raise ValueError(f"{path}: has no {short(name)!r}, which {MAIN} names") from None
    if info.file_size < needed:
        raise ValueError(f"{path}: {short(name)}: {info.file_size} bytes, of {needed}: cut off or broken")
    with archive.open(info) as stream:
        data = stream.read(needed)
    if len(data) < needed:
        raise ValueError(f"{path}: {short(name)}: {len(data)} bytes, of {needed}: cut off or broken")
    return data


def _values(path: Path, archive: zipfile.ZipFile, name: str, shape: tuple[int, int], kind: str) -> FloatArray:
    rows, columns = shape
    dtype = np.dtype(kind)
    check_size(path, columns, rows, 1, dtype.itemsize, path.stat().st_size, DEFLATE_RATIO)
    data = _member(path, archive, name, rows * columns * dtype.itemsize)
    return np.frombuffer(data, dtype).reshape(shape).astype(float)


def _valid(path: Path, archive: zipfile.ZipFile, name: str, shape: tuple[int, int]) -> np.ndarray:
    count = shape[0] * shape[1]
    data = _member(path, archive, name, (count + 7) // 8)
    return np.unpackbits(np.frombuffer(data, np.uint8), count=count, bitorder="little").astype(bool).reshape(shape)


def write_iso_x3p(path: Path, height_map: HeightMap) -> tuple[str, ...]:
    """Write an X3P file of 64-bit heights in metres, NaN where invalid. Returns notes.

    A wavefront is written as the surface that makes it. Raises ValueError for a map without a lateral scale.
    """
    surface = height_map.as_kind(SURFACE)
    if surface.pitch_mm is None:
        raise ValueError(f"{path}: an X3P file needs a lateral scale, which the map does not have: give --pitch-mm")
    data = (surface.heights_mm * 1e-3).astype("<f8").tobytes()
    rows, columns = surface.heights_mm.shape
    axes = "".join(
        f"<{name}><AxisType>I</AxisType><DataType>D</DataType><Increment>{pitch * 1e-3!r}</Increment>"
        f"<Offset>0</Offset></{name}>"
        for name, pitch in zip(("CX", "CY"), surface.pitch_mm, strict=True)
    )
    digest = hashlib.md5(data, usedforsecurity=False).hexdigest().upper()
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<p:ISO5436_2 xmlns:p="{NAMESPACE}"><Record1>'
        f"<Revision>ISO5436 - 2000</Revision><FeatureType>SUR</FeatureType><Axes>{axes}"
        "<CZ><AxisType>A</AxisType><DataType>D</DataType></CZ></Axes></Record1><Record3><MatrixDimension>"
        f"<SizeX>{columns}</SizeX><SizeY>{rows}</SizeY><SizeZ>1</SizeZ></MatrixDimension><DataLink>"
        f"<PointDataLink>{DATA}</PointDataLink><MD5ChecksumPointData>{digest}</MD5ChecksumPointData></DataLink>"
        "</Record3><Record4><ChecksumFile>md5checksum.hex</ChecksumFile></Record4></p:ISO5436_2>\n"
    ).encode()
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(MAIN, text)
        archive.writestr(DATA, data)
        archive.writestr("md5checksum.hex", f"{hashlib.md5(text, usedforsecurity=False).hexdigest()} *{MAIN}\n")
    notes = ("an X3P file holds no wavelength",)
    return notes if height_map.kind == SURFACE else (*notes, "the wavefront is written as a surface of half its height")
