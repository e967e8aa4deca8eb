"""PNG files of cameras: 8 or 16 bits of grey, read by pillow.

Pillow cuts 16-bit colour and 16-bit grey with alpha to 8 bits and stretches 1, 2 and 4 bits to 8, without a word: these
are refused by the file's header. 8-bit colour is read where its channels are equal in every pixel.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.frames import (
    Frame,
    ImageFile,
    ReadOptions,
    check_orientation,
    check_size,
    orientation_note,
    reading,
    upright,
    upright_shape,
)

HEADER = struct.Struct(">8x4x4sIIBB")  # signature, length, "IHDR", width, height, bits, colour type
GREY, RGB, PALETTE, GREY_ALPHA, RGBA = 0, 2, 3, 4, 6
CHANNELS = {GREY: 1, RGB: 3, PALETTE: 1, GREY_ALPHA: 2, RGBA: 4}
DEFLATE_RATIO = 1032.0
ORIENTATION = 274  # of Exif
_NOTES = {
    RGB: "colour with equal channels, read as grey",
    PALETTE: "palette of greys, read as grey",
    GREY_ALPHA: "grey with alpha, all opaque",
    RGBA: "colour with equal channels and alpha, all opaque, read as grey",
}


def open_png(path: Path, options: ReadOptions) -> ImageFile:
    """The image of a PNG file. Raises ValueError, with one line, for what is not grey, here or when it is read."""
    with reading(path, "PNG"):
        with open(path, "rb") as file:
            name, columns, rows, bits, colour = HEADER.unpack(file.read(HEADER.size))
        if name != b"IHDR" or colour not in CHANNELS:
            raise ValueError(f"{path}: not a readable PNG file: no header, or colour type {colour}")
        _check_kind(path, bits, colour)
        depth = bits / 8 if colour == PALETTE else CHANNELS[colour] * bits // 8
        check_size(path, columns, rows, 1, depth, path.stat().st_size, DEFLATE_RATIO)
        with _opened(path) as image:
            turn = check_orientation(path, image.getexif().get(ORIENTATION))
    notes = [_NOTES[colour]] if colour in _NOTES else []
    dtype = np.dtype("u1" if bits <= 8 else "u2")
    shape = upright_shape((rows, columns), turn)
    return ImageFile(
        path, shape, 1, dtype, 8 * dtype.itemsize, lambda _: _read(path, turn), (*notes, *orientation_note(turn))
    )


def _check_kind(path: Path, bits: int, colour: int) -> None:
    if colour == GREY and bits < 8:
        raise ValueError(f"{path}: grey of {bits} bits: must be 8 or 16")
    if colour not in (GREY, PALETTE) and bits == 16:
        raise ValueError(f"{path}: 16-bit colour or alpha: must be one grey channel; store it as 16-bit grey")


def _opened(path: Path) -> Any:
    from PIL import Image

    image = Image.open(path, formats=["PNG"])
    frames = getattr(image, "n_frames", 1)
    if frames != 1:
        image.close()
        raise ValueError(f"{path}: an animation of {frames} frames: must be one image")
    return image


def _read(path: Path, turn: int) -> Frame:
    with reading(path, "PNG"), _opened(path) as image:
        mode = image.mode
        if mode == "P":
            values = np.asarray(image.convert("RGBA"))  # with the transparency of its colours
        else:
            values = np.asarray(image)
    if values.ndim == 2:
        return upright(values.astype(np.uint16 if values.dtype.itemsize > 1 else np.uint8, copy=False), turn)
    if values.shape[-1] in (2, 4) and not (values[..., -1] == 255).all():
        raise ValueError(f"{path}: some pixels are transparent: must be opaque; store it as grey without alpha")
    if values.shape[-1] >= 3 and not (values[..., :3] == values[..., :1]).all():
        raise ValueError(
            f"{path}: colour, with channels that differ: must be grey; record mono, or extract one channel as grey"
        )
    return upright(values[..., 0], turn)
