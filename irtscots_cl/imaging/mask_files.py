"""Masks of detector pixels from files: pictures, NPY arrays, HDF5 datasets."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from irtscots_cl.formats.mask_values import check_two_values, picture_values
from irtscots_cl.imaging.orientation import CHANGES, stored_shape, upright
from irtscots_cl.maths.arrays import BoolArray

AUTO, DESIGN = "auto", "design"  # in the place of a file: by the images' light, by the design's rim
OFF = 0.2, 0.05  # share of a mask's pixels off the mirror: beyond it as it lies, below it as it should lie


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
    check_two_values(values, f"--mask = {str(path)!r}", "pixels are not used")
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
