"""The numbers of a mask's file: a picture, an NPY array, an HDF5 dataset."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

PICTURES = (".png", ".tif", ".tiff", ".bmp", ".pgm", ".gif")
HDF5 = (".h5", ".hdf5", ".hdf")
KINDS = f"must be a picture ({', '.join(PICTURES[:3])}), an array (.npy), or an HDF5 file with a dataset `mask`"
DATASET = "mask"
MAX_VALUES = 2**28  # of any array that is read: larger ones are no mask of a detector


def picture_values(path: Path, what: str) -> np.ndarray:
    """The numbers [rows, columns] of a file. what: it is, for messages."""
    if not path.is_file():
        why = "it is a folder" if path.is_dir() else "there is no file of that name"
        raise ValueError(f"{what}: not a readable mask: {why}")
    kind = path.suffix.lower()
    try:
        if kind in HDF5:
            values = _of_hdf5(path)
        elif kind == ".npy":
            values = np.lib.format.open_memmap(path, mode="r")  # refuses objects, which could run code
        elif kind in PICTURES:
            values = _of_picture(path)
        else:
            raise ValueError(f"has the ending {kind!r}")
        if values.size > MAX_VALUES:
            raise ValueError(f"has {values.size} values")
        values = np.array(values)
    except (OSError, RuntimeError, KeyError, ValueError, SyntaxError, EOFError) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"{what}: not a readable mask: {why}; {KINDS}") from None
    if values.dtype.kind not in "biuf":
        raise ValueError(f"{what}: has values of type {values.dtype}; {KINDS}")
    return values


def _of_hdf5(path: Path) -> np.ndarray:
    with h5py.File(path, "r") as file:
        if isinstance(file.get(DATASET, getlink=True), h5py.ExternalLink):
            raise ValueError(f"/{DATASET} is in another file")
        data = file.get(DATASET)
        if not isinstance(data, h5py.Dataset) or data.shape is None or data.external or data.is_virtual:
            raise ValueError(f"has no dataset /{DATASET} of its own")
        if data.size > MAX_VALUES:
            raise ValueError(f"/{DATASET} has {data.size} values")
        return np.asarray(data[()])


def _of_picture(path: Path) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as opened:
        if opened.width * opened.height > MAX_VALUES:
            raise ValueError(f"has {opened.width} x {opened.height} pixels")
        # of numbered colours 0 need not be black
        picture: Image.Image = opened.convert("RGB") if opened.mode == "P" else opened
        bands = [band for band in picture.getbands() if band != "A"]
        if len(bands) < len(picture.getbands()) or len(bands) > 1:
            brightest: np.ndarray = np.max([np.asarray(picture.getchannel(band)) for band in bands], axis=0)
            return brightest
        return np.asarray(picture)


def check_two_values(values: np.ndarray, what: str, dark: str) -> None:
    """Raise ValueError, in one line, for values that are not 0 and one other value. dark: where they are 0."""
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise ValueError(f"{what}: has values that are no numbers; must be 0 or another one value")
    levels = np.unique(values)
    if len(levels) > 2 or (len(levels) == 2 and levels[0] != 0):
        told = ", ".join(f"{level:g}" for level in levels[:3]) + (" ..." if len(levels) > 3 else "")
        raise ValueError(
            f"{what}: has {len(levels)} different values ({told}); must be 0 where {dark} and one other value elsewhere"
        )
    if not values.any():
        raise ValueError(f"{what}: is 0 everywhere: no pixel would be used; must be 1 where they are")
