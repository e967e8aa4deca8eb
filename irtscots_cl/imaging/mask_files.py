"""Masks of detector pixels from files: pictures, NPY arrays, HDF5 datasets."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from irtscots_cl.imaging.orientation import CHANGES, stored_shape, upright
from irtscots_cl.maths.arrays import BoolArray

PICTURES = (".png", ".tif", ".tiff", ".bmp", ".pgm", ".gif")
HDF5 = (".h5", ".hdf5", ".hdf")
KINDS = f"must be a picture ({', '.join(PICTURES[:3])}), an array (.npy), or an HDF5 file with a dataset `mask`"
DATASET = "mask"
AUTO, DESIGN = "auto", "design"  # in the place of a file: by the images' light, by the design's rim
OFF = 0.2, 0.05  # share of a mask's pixels off the mirror: beyond it as it lies, below it as it should lie
MAX_VALUES = 2**28  # of any array that is read: larger ones are no mask of a detector


def read_mask(path: Path, shape: tuple[int, int], orientation: str = "upright") -> BoolArray:
    """Pixels [rows, columns] of the upright grid that may be used: those where the file is not 0.

    shape: (rows, columns) of the upright grid. orientation: how the mask lies in the file, as the images do. A picture
    with colours counts where any of them is not 0; its opacity counts for nothing. Raises ValueError, with a message of
    one line, for a file that is no mask: another size, more than two values, all 0.
    """
    values = picture_values(path, f"--mask = {str(path)!r}")
    rows, columns = stored_shape(shape, orientation)
    if values.shape != (rows, columns):
        size = " x ".join(map(str, values.shape[::-1])) or "one value"
        lies = "" if orientation == "upright" else f", stored as camera.detector.orientation = {orientation!r} says"
        raise ValueError(
            f"--mask = {str(path)!r}: has {size} pixels; must have the images' "
            f"{columns} x {rows} (columns x rows{lies})"
        )
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise ValueError(f"--mask = {str(path)!r}: has values that are no numbers; must be 0 or another one value")
    levels = np.unique(values)
    if len(levels) > 2 or (len(levels) == 2 and levels[0] != 0):
        told = ", ".join(f"{level:g}" for level in levels[:3]) + (" ..." if len(levels) > 3 else "")
        raise ValueError(
            f"--mask = {str(path)!r}: has {len(levels)} different values ({told}); must be 0 where pixels are not used "
            "and one other value elsewhere"
        )
    if not values.any():
        raise ValueError(f"--mask = {str(path)!r}: is 0 everywhere: no pixel would be used; must be 1 where they are")
    use: BoolArray = np.ascontiguousarray(upright(values != 0, orientation))
    return use


def mask_file(choice: Path | None) -> Path | None:
    """The file of a choice; None for AUTO, DESIGN, and no choice."""
    return None if choice is None or str(choice) in (AUTO, DESIGN) else choice


def check_mask_lies(path: Path, use: BoolArray, mirror: BoolArray) -> None:
    """Raise ValueError, in one line, for a mask that lies otherwise than the images do.

    use: what the file says. mirror: pixels that the mirror may be seen in; both [rows, columns] as the images lie. A
    mask of a round mirror in the middle lies the same in all ways.
    """
    off = {
        word: float(np.count_nonzero(turned & ~mirror) / np.count_nonzero(turned))
        for word in CHANGES
        if (turned := upright(use, word)).shape == mirror.shape
    }
    word = min(off, key=lambda word: off[word])
    if off["upright"] > OFF[0] and off[word] < OFF[1]:
        raise ValueError(
            f"--mask = {str(path)!r}: {off['upright']:.0%} of its pixels are off the mirror, with {CHANGES[word]} "
            f"{off[word]:.0%}: must lie as the images do"
        )


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
