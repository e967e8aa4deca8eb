"""How images lie in files: the eight words of `camera.detector.orientation`, each defined by what undoes it.

The upright grid has rows along the camera's +y and columns along its +x: that of all maps in memory. A camera's
ordinary picture has its first row at the top: "rows-reversed". All functions work on the last two axes, so that they
take one image as well as a stack.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from irtscots_cl.scene.instrument import ORIENTATIONS

# Word: what turns an image as it lies in the file into the upright one. The quarter turns are undone by np.rot90(image,
# k), k = 1, 2, 3: shown with its first row at the top, a "quarter-turn" file is the upright image turned clockwise.
UNDONE_BY: dict[str, Callable[[Any], Any]] = {
    "upright": lambda a: a,
    "rows-reversed": lambda a: a[..., ::-1, :],
    "columns-reversed": lambda a: a[..., ::-1],
    "half-turn": lambda a: a[..., ::-1, ::-1],
    "transposed": lambda a: a.swapaxes(-1, -2),
    "quarter-turn": lambda a: a.swapaxes(-1, -2)[..., ::-1, :],
    "three-quarter-turn": lambda a: a.swapaxes(-1, -2)[..., ::-1],
    "transposed-half-turn": lambda a: a.swapaxes(-1, -2)[..., ::-1, ::-1],
}
# The same as a change of an image, in words.
CHANGES = {
    "upright": "",
    "rows-reversed": "the rows upside down",
    "columns-reversed": "the columns mirrored",
    "half-turn": "the image turned by half a turn",
    "transposed": "rows and columns exchanged",
    "quarter-turn": "the image turned by a quarter",
    "three-quarter-turn": "the image turned by a quarter the other way",
    "transposed-half-turn": "rows and columns exchanged about the other diagonal",
}
TRANSPOSED = ORIENTATIONS[4:]  # those whose files have the grid's columns as rows
_STORED_BY = {word: word for word in ORIENTATIONS} | {
    "quarter-turn": "three-quarter-turn",
    "three-quarter-turn": "quarter-turn",
}


def upright(images: Any, orientation: str) -> Any:
    """Images [..., rows, columns] of a file on the upright grid; a view of them."""
    return UNDONE_BY[orientation](images)


def stored(images: Any, orientation: str) -> Any:
    """Images [..., rows, columns] of the upright grid as they lie in files; a view of them."""
    return UNDONE_BY[_STORED_BY[orientation]](images)


def stored_shape(shape: tuple[int, int], orientation: str) -> tuple[int, int]:
    """(rows, columns) in files of an upright grid of (rows, columns)."""
    return (shape[1], shape[0]) if orientation in TRANSPOSED else shape


def combined(orientation: str, change: str) -> str:
    """The word whose undoing is that of `orientation`, then that of `change`."""
    image = np.arange(4).reshape(2, 2)  # it has no symmetry
    both = upright(upright(image, orientation), change)
    return next(word for word in ORIENTATIONS if np.array_equal(upright(image, word), both))
