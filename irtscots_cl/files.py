"""Result files: written whole under a temporary name, then renamed, so that no half-written file has the final name."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from irtscots_cl.images import ImageStack, Scan, check_shapes, jackknife_error
from irtscots_cl.memory import check_memory
from irtscots_cl.reconstruction import Reconstruction

BYTES_PER_VALUE = 32  # of images while a mirror is measured from them
MAX_IMAGE_VALUES = 2**28  # of a scan from a stranger's file: 2 GiB in float64


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` to write to; on success it becomes `path`, on an error it goes."""
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with open(temporary, "rb+") as written:
            os.fsync(written.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, data: dict) -> None:
    """Write JSON; NaN becomes null, which every reader of JSON understands."""
    write_text(path, json.dumps(plain(data), indent=2, allow_nan=False) + "\n")


def plain(value):
    """The value in JSON's own types: NumPy scalars unpacked, NaN and infinities as None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def write_result(path: Path, stack: ImageStack, result: Reconstruction, attributes: dict[str, str]) -> None:
    """Write result.h5: images [lines, rows, columns] in W with standard errors, lines, mirror points, mask, centroids,
    slopes and height. attributes: of the file (scene as TOML, seed, device, versions)."""
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        for key, value in attributes.items():
            file.attrs[key] = value
        for scan in (stack.x, stack.y):
            jackknife = scan.jackknife_w()
            _write_images(file, f"images/{scan.axis}", scan, jackknife[0])
            _write_images(file, f"images/{scan.axis}_standard_error", scan, jackknife_error(jackknife))
            _write(file, f"lines/{scan.axis}_mm", scan.positions_mm, "mm")
        for name, values, unit in (
            ("mirror/x_mm", result.x_mm, "mm"),
            ("mirror/y_mm", result.y_mm, "mm"),
            ("mask", result.mask, "1"),
            ("flags", result.flags, "1"),
            ("centroid/x_mm", result.centroid_x_mm, "mm"),
            ("centroid/y_mm", result.centroid_y_mm, "mm"),
            ("slope/x_rad", result.slope_x, "rad"),
            ("slope/y_rad", result.slope_y, "rad"),
            ("height_mm", result.height_mm, "mm"),
            ("deviation_nm", result.deviation_mm * 1e6, "nm"),
            ("height_standard_error_nm", result.height_standard_error_mm() * 1e6, "nm"),
        ):
            _write(file, name, values, unit)


def _write(file: h5py.File, name: str, values: np.ndarray, unit: str) -> None:
    file.create_dataset(name, data=values, compression="gzip", compression_opts=1, shuffle=True)
    file[name].attrs["unit"] = unit


def _write_images(file: h5py.File, name: str, scan: Scan, values: np.ndarray) -> None:
    """Line by line: the whole stack of a large screen never stands in memory."""
    shape = (len(scan.positions_mm), *scan.shape)
    images = file.create_dataset(
        name, shape, np.float64, chunks=(1, *scan.shape), compression="gzip", compression_opts=1, shuffle=True
    )
    images.attrs["unit"] = "W"
    for line in range(shape[0]):
        images[line] = scan.image(line, values)


def read_images(path: Path) -> ImageStack:
    """The image stack of an HDF5 file with /images/x, /images/y and /lines/x_mm, /lines/y_mm as `run` writes them.

    images may also be [exposures, lines, rows, columns]. Raises ValueError, one line, for anything else.
    """
    if not path.is_file():
        raise ValueError(f"{path}: not a readable HDF5 file: there is no file of that name")
    try:
        with h5py.File(path, "r") as file:
            return ImageStack(*(_read_scan(file, path, axis) for axis in ("x", "y")))
    except (OSError, RuntimeError, KeyError) as error:  # h5py tells of broken files and of endless links by any of them
        raise ValueError(f"{path}: not a readable HDF5 file: {str(error.args[0]).splitlines()[0]}") from None


def _read_scan(file: h5py.File, path: Path, axis: str) -> Scan:
    images, lines = (_dataset(file, path, name) for name in (f"images/{axis}", f"lines/{axis}_mm"))
    check_memory(f"{path}: /images/{axis}: {images.size} values", images.size * BYTES_PER_VALUE)
    try:
        check_shapes(axis, lines.shape, images.shape)  # before anything is read
        return Scan.from_images(axis, lines[()], images[()])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _dataset(file: h5py.File, path: Path, name: str) -> h5py.Dataset:
    """A dataset of numbers that lie in this very file; nothing is read yet."""
    links = [file.get(part, getlink=True) for part in (name.split("/")[0], name)]
    elsewhere = any(isinstance(link, h5py.ExternalLink) for link in links)
    data = None if elsewhere else file.get(name)
    if elsewhere or (isinstance(data, h5py.Dataset) and (data.external or data.is_virtual)):
        raise ValueError(f"{path}: /{name}: its values are in another file; must be in this one")
    if not isinstance(data, h5py.Dataset) or data.dtype.kind not in "fiu" or data.shape is None:
        raise ValueError(f"{path}: /{name}: missing or not a numeric dataset; must be as `irtscots run` writes it")
    if data.size > MAX_IMAGE_VALUES:
        raise ValueError(f"{path}: /{name}: {data.size} values; at most {MAX_IMAGE_VALUES} are read")
    return data


def check_output_folder(folder: Path) -> None:
    """Raises ValueError if the folder could not be made or written, without making it."""
    nearest = next(part for part in (folder, *folder.absolute().parents) if part.exists())
    if not nearest.is_dir():
        raise ValueError(f"--out = {str(folder)!r}: {nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise ValueError(f"--out = {str(folder)!r}: no permission to write in {nearest}")
