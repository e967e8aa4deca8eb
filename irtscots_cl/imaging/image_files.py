"""Image stacks from HDF5 files of a laboratory or of a simulation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from irtscots_cl.formats.sparse_hdf5 import Tile, stored_tiles
from irtscots_cl.imaging.image_stack import ImageStack, Scan, check_shapes
from irtscots_cl.imaging.lit_images import lit_curves
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.system.memory import check_memory

BYTES_PER_VALUE = 32  # of images: memory while a mirror is measured from them
WIDTH_TOLERANCE = 0.1  # of a line's width: a pitch that was calibrated may differ a little
VALUES_AT_ONCE = 2**24
MAX_IMAGE_VALUES = 2**28  # of one scan in an unknown file: 2 GiB in float64


def read_images(path: Path, scene: Scene | None = None) -> ImageStack:
    """The image stack of an HDF5 file with /images/x, /images/y and /lines/x_mm, /lines/y_mm, as `run` writes it.

    images: [lines, rows, columns] or [exposures, lines, rows, columns], which lie in the file as the scene's
    `camera.detector.orientation` says, and show lines as its [screen.lines] does; the stack is upright. None: upright
    images of lines that touch. Raises ValueError, with a message of one line, for a file that cannot be read or does
    not have this form.

    Of images that are stored in part, since most of them are dark, only those parts are read, into short light curves.
    """
    if not path.is_file():
        why = "it is a folder" if path.is_dir() else "there is no file of that name"
        raise ValueError(f"{path}: not a readable HDF5 file: {why}")
    try:
        with h5py.File(path, "r") as file:
            x, y = (_read_scan(file, path, axis, scene) for axis in ("x", "y"))
            return ImageStack(x, y)
    except (OSError, RuntimeError, KeyError) as error:  # h5py raises any of them for broken files and endless links
        raise ValueError(f"{path}: not a readable HDF5 file: {str(error.args[0]).splitlines()[0]}") from None


def _read_scan(file: h5py.File, path: Path, axis: str, scene: Scene | None) -> Scan:
    images, lines = (_dataset(file, path, name) for name in (f"images/{axis}", f"lines/{axis}_mm"))
    try:
        check_shapes(axis, lines.shape, images.shape)  # before reading any values
        is_whole = scene is not None and len(images) == len(LineScan(scene).positions_mm(axis))
        tiles = stored_tiles(images) if is_whole else None
        if scene is not None and tiles is not None:
            return _lit_scan(images, tiles, lines, axis, scene)
        _check_size(images, images.size)
        values = _values(images)
        if scene is None:
            return replace(Scan.from_images(axis, lines[()], values), unit=_unit(images))
        values = upright(values, scene.camera.detector.orientation)
        scan = Scan.from_images(axis, lines[()], values, _line_width(lines, axis, scene))
        return replace(scan, unit=_unit(images))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _check_size(images: h5py.Dataset, count: int) -> None:
    """Refuse, with a ValueError, to read more values than there should be, or than fit the memory."""
    name = f"/{images.name.lstrip('/')}: {count} values"
    if count > MAX_IMAGE_VALUES:
        raise ValueError(f"{name}; at most {MAX_IMAGE_VALUES} are read")
    check_memory(name, count * BYTES_PER_VALUE)


def _lit_scan(images: h5py.Dataset, tiles: list[Tile], lines: h5py.Dataset, axis: str, scene: Scene) -> Scan:
    """The scan of images of which these tiles are stored: all others are dark."""
    rows, columns = images.shape[1:]
    longest = max((tile.end_line - tile.first_line for tile in tiles), default=1)
    _check_size(images, rows * columns * longest)
    first, curves = lit_curves(images, tiles, f"images/{axis}")
    upright_pixels = upright(np.arange(rows * columns).reshape(rows, columns), scene.camera.detector.orientation)
    order = upright_pixels.ravel()
    # the checks of positions are those of whole images
    scan = Scan.from_images(axis, lines[()], np.zeros((len(images), 1, 1)), _line_width(lines, axis, scene))
    return replace(
        scan,
        shape=upright_pixels.shape,
        pixels=np.arange(len(order)),
        first_line=first[order],
        flux_w=curves[None, order],
        hits=np.full(len(order), np.nan),
        unit=_unit(images),
    )


def _unit(images: h5py.Dataset) -> str:
    """ "W" where a simulation's file says so; a camera's counts else."""
    told = images.attrs.get("unit")
    return "W" if told in ("W", b"W") else "DN"


def _line_width(lines: h5py.Dataset, axis: str, scene: Scene) -> float:
    """Width of the scene's lines over their distance. ValueError if the file has a width that is another's."""
    pattern = LineScan(scene)
    own_mm = pattern.line_width * pattern.spacing_mm(axis)
    told = lines.attrs.get("line_width_mm")
    if isinstance(told, (int, float, np.number)) and abs(float(told) - own_mm) > WIDTH_TOLERANCE * own_mm:
        raise ValueError(
            f"/{lines.name.lstrip('/')}: its lines are {float(told):.6g} mm wide, those of scene {scene.name} "
            f"{own_mm:.6g} mm; must agree: width_px of [screen.lines] times the pitch"
        )
    return pattern.line_width


def _values(images: h5py.Dataset) -> np.ndarray:
    """All values, read in parts, so that a signal need not wait for gigabytes."""
    values = np.empty(images.shape, images.dtype)
    chunk = images.chunks[0] if images.chunks else 1  # parts of whole chunks: each is unpacked once
    count = chunk * max(1, VALUES_AT_ONCE * len(images) // (images.size * chunk))
    for first in range(0, len(images), count):
        interruption.check()
        values[first : first + count] = images[first : first + count]
    return values


def _dataset(file: h5py.File, path: Path, name: str) -> h5py.Dataset:
    """A dataset of numbers stored in this file itself. Its values are not read yet."""
    links = [file.get(part, getlink=True) for part in (name.split("/")[0], name)]
    elsewhere = any(isinstance(link, h5py.ExternalLink) for link in links)
    data = None if elsewhere else file.get(name)
    if elsewhere or (isinstance(data, h5py.Dataset) and (data.external or data.is_virtual)):
        raise ValueError(f"{path}: /{name}: its values are in another file; must be in this one")
    must = "must be a dataset of real numbers, as `irtscots run` writes it"
    if not isinstance(data, h5py.Dataset):
        raise ValueError(f"{path}: /{name}: {'missing' if data is None else 'a group'}; {must}")
    if data.dtype.kind not in "fiu" or data.shape is None:
        raise ValueError(f"{path}: /{name}: {'empty' if data.shape is None else f'of type {data.dtype}'}; {must}")
    return data
