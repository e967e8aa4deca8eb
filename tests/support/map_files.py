"""Files with height maps made byte by byte from the formats' descriptions, independent of the package's writers.

Every function takes values as the file has them: [rows, columns], the file's first row first.
"""

from __future__ import annotations

import io
import struct
import zipfile

import h5py
import numpy as np
from picture_files import letter_f

INVALID = 2147483640
CONVERTER = np.dtype([("Category", "S20"), ("BaseUnit", "S20"), ("Parameters", "<f8", (4,))])


def letter_map_nm():
    """Heights in nm of an F, row 0 at the bottom as in all maps: 200 on the letter, 10 beside it, three invalid pixels,
    a mark at the top left. No turn or mirror image of it is the same."""
    heights = letter_f(10, 200, float)[::-1].copy()
    heights[2, 6] = heights[2, 7] = heights[9, 8] = np.nan
    return heights


def zygo_dat(
    counts,
    *,
    form=1,
    scale=0.5,
    wavelength_m=632.8e-9,
    obliquity=1.0,
    lateral_m=1e-4,
    phase_res=1,
    sign=0,
    origin=(0, 0),
    camera=None,
    frames=None,
    frames_origin=(0, 0),
    buckets=None,
):
    """A MetroPro file. counts: of the phase, top row first. frames: intensity [frames, rows, columns]."""
    rows, columns = counts.shape
    size = 4096 if form == 3 else 834
    head = bytearray(size)

    def put(at, kind, *values):
        struct.pack_into(">" + kind, head, at, *values)

    put(0, "IHI", 0x881B036F + form - 1, form, size)
    if frames is not None:
        put(48, "HHHH", *frames_origin, frames.shape[2], frames.shape[1])
        put(56, "HHI", len(frames) if buckets is None else buckets, 65411, 2 * frames.size)
    put(64, "HHHHI", *origin, columns, rows, 4 * columns * rows)
    put(164, "f", scale)
    put(168, "f", wavelength_m)
    put(176, "f", obliquity)
    put(184, "f", lateral_m)
    put(218, "H", phase_res)
    put(232, "H", sign)
    put(234, "HH", *(camera or (origin[0] + columns, origin[1] + rows)))
    intensity = b"" if frames is None else frames.astype(">u2").tobytes()
    return bytes(head) + intensity + counts.astype(">i4").tobytes()


def zygo_datx(
    values, *, unit=b"NanoMeters", place="Data/Surface/{1}", lateral_m=1e-4, no_data=float(INVALID), **others
):
    """A DATX file. values: top row first."""
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        data = file.create_dataset(place, data=values)
        said = {"Wavelength": 632.8e-9, "Interferometric Scale Factor": 0.5, "Obliquity Factor": 1.0} | others
        for name, value in {**said, "No Data": no_data}.items():
            data.attrs[name] = np.array([value])
        data.attrs["Unit"] = np.array([unit])
        for axis in "XY":
            converter = (b"LateralCat", b"Pixels", (0.0, lateral_m, 0.0, 0.0))
            data.attrs[f"{axis} Converter"] = np.array([converter], CONVERTER)
    return stream.getvalue()


def codev(values, head="SUR WVL 0.6328 SSZ 1000 NDA -32768", *, before="", end="\r\n", per_line=8):
    """A CODE V grid. values: whole numbers, the first line those of the top row."""
    rows, columns = values.shape
    flat = [str(int(value)) for value in values.ravel()]
    lines = [" ".join(flat[k : k + per_line]) for k in range(0, len(flat), per_line)]
    return (before + end.join(["a title", f"GRD {columns} {rows} {head}", *lines]) + end).encode()


def zemax(values, *, delx=0.1, dely=0.1, unit=0, centre="0 0", flags=None, end="\r\n"):
    """A grid sag file. values: z, the line of the -x, +y corner first. flags: no-data flags, or left out."""
    rows, columns = values.shape
    lines = [f"{columns} {rows} {delx!r} {dely!r} {unit} {centre}"]
    for k, z in enumerate(values.ravel()):
        lines.append(f"{float(z)!r} 0.0 0.0 0.0" + ("" if flags is None else f" {int(flags.ravel()[k])}"))
    return (end.join(lines) + end).encode()


def sdf_binary(values, *, kind=7, pitch_m=(1e-4, 1e-4), z_m=1e-9):
    """A binary SDF file. values: the profile of the smallest y first."""
    dtype = {1: "<u2", 3: "<f4", 5: "<i2", 6: "<i4", 7: "<f8"}[kind]
    rows, columns = values.shape
    head = b"bISO-1.0" + b"maker".ljust(10) + b"010120261200" * 2
    head += struct.pack("<HHddddBBB", columns, rows, *pitch_m, z_m, 0.0, 0, kind, 0)
    return head + values.astype(dtype).tobytes()


def sdf_text(values, *, pitch_m=(1e-4, 1e-4), z_m=1e-9):
    """A text SDF file of 64-bit type. values: the profile of the smallest y first; NaN is BAD."""
    rows, columns = values.shape
    said = {"ManufacID": "maker", "NumPoints": columns, "NumProfiles": rows, "Xscale": pitch_m[0]}
    said |= {"Yscale": pitch_m[1], "Zscale": z_m, "Zresolution": 0, "Compression": 0, "DataType": 7, "CheckType": 0}
    lines = ["aISO-1.0", *(f"{key:12} = {value}" for key, value in said.items()), "*"]
    lines += [" ".join("BAD" if np.isnan(v) else repr(float(v)) for v in row) for row in values]
    return ("\r\n".join([*lines, "*", ""])).encode()


def x3p(values, *, kind="D", pitch_m=(1e-4, 1e-4), scale=1.0, offset=0.0, valid=None):
    """An X3P file. values: as stored, the smallest y first. valid: bits of the file of valid points, or none."""
    dtype = {"D": "<f8", "F": "<f4", "I": "<i2", "L": "<i4"}[kind]
    rows, columns = values.shape
    axes = "".join(
        f"<{a}><AxisType>I</AxisType><DataType>L</DataType><Increment>{p!r}</Increment><Offset>0</Offset></{a}>"
        for a, p in zip(("CX", "CY"), pitch_m, strict=True)
    )
    axes += f"<CZ><AxisType>A</AxisType><DataType>{kind}</DataType><Increment>{scale!r}</Increment>"
    axes += f"<Offset>{offset!r}</Offset></CZ>"
    link = "<PointDataLink>bindata/data.bin</PointDataLink>"
    link += "" if valid is None else "<ValidPointsLink>bindata/valid.bin</ValidPointsLink>"
    text = (
        "<?xml version='1.0'?><p:ISO5436_2 xmlns:p='http://www.opengps.eu/2008/ISO5436_2'><Record1>"
        f"<Revision>ISO5436 - 2000</Revision><FeatureType>SUR</FeatureType><Axes>{axes}</Axes></Record1><Record3>"
        f"<MatrixDimension><SizeX>{columns}</SizeX><SizeY>{rows}</SizeY><SizeZ>1</SizeZ></MatrixDimension>"
        f"<DataLink>{link}</DataLink></Record3></p:ISO5436_2>"
    )
    files = {"main.xml": text.encode(), "bindata/data.bin": values.astype(dtype).tobytes()}
    if valid is not None:
        files["bindata/valid.bin"] = np.packbits(valid.ravel(), bitorder="little").tobytes()
    return zipped(files)


def zipped(files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return stream.getvalue()


def npz(**arrays):
    """An NPZ file as NumPy itself writes it."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()
