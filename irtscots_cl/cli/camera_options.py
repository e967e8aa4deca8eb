"""Options on a laboratory's camera: calibration frames, repeats, exposures, how files are read."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from irtscots_cl.imaging.camera_files import CameraFiles

_FILES = {
    "--dark": "frames without light at the images' exposure (files or a folder): their mean is taken off",
    "--flat": "frames of evenly lit pixels: their mean, less its own offset, is each pixel's response",
    "--bias": "frames without light at no exposure, for dark frames of another exposure than the images'",
    "--flat-dark": "frames without light at the flat frames' exposure; default: by the dark and bias frames",
}
_NAMES = ("dark", "flat", "bias", "flat_dark", "bad_pixels", "repeats", "exposures_s", "repeat_order",
          "dark_exposure_s", "flat_exposure_s")  # fmt: skip
_READ = ("fits_rows", "ser_byte_order", "array")


def add_camera_files(parser: argparse.ArgumentParser) -> None:
    """What is known about the camera; each is also a key of a manifest's table [camera], which it replaces."""
    group = parser.add_argument_group(
        "camera", "each may also stand in the manifest's table [camera], with _ for -: docs/fringes.md"
    )
    for option, text in _FILES.items():
        group.add_argument(option, type=Path, nargs="+", metavar="PATH", help=text)
    group.add_argument(
        "--bad-pixels",
        type=Path,
        metavar="FILE",
        help="map of bad pixels, of the images' size and lying as they do: a picture, NPY, FITS or HDF5 file that is "
        "not 0 where they are",
    )
    group.add_argument("--repeats", type=int, metavar="N", help="images of equal exposure of each frame, averaged")
    group.add_argument(
        "--exposures-s",
        type=float,
        nargs="+",
        metavar="T",
        help="exposure times [s] of the images of each frame, in their order: merged without those that are saturated",
    )
    group.add_argument(
        "--repeat-order",
        metavar="O",
        help='"together" (the images of a frame follow each other; default) or "in turn" (the whole series is '
        "repeated)",
    )
    for what in ("dark", "flat"):
        group.add_argument(
            f"--{what}-exposure-s",
            type=float,
            metavar="T",
            help=f"exposure time of the {what} frames; default: as their files say",
        )
    group.add_argument(
        "--fits-rows",
        metavar="R",
        help='which row of a FITS file comes first: "bottom-up" or "top-down"; default: as its ROWORDER says, '
        "else bottom-up as in the standard",
    )
    group.add_argument(
        "--ser-byte-order",
        metavar="B",
        help='of 16-bit SER files: "little" or "big"; default: found from the data, since programs disagree on the '
        "flag",
    )
    group.add_argument(
        "--array", metavar="NAME", help="array of an NPZ file, or dataset of an HDF5 file, that has the images"
    )


def given_options(options: argparse.Namespace) -> list[str]:
    """The options of add_camera_files that the user set."""
    return [f"--{name.replace('_', '-')}" for name in (*_NAMES, *_READ) if getattr(options, name) is not None]


def camera_of(options: argparse.Namespace) -> CameraFiles:
    """What the options say. Raises ValueError, which names the option."""
    from irtscots_cl.formats.frames import ReadOptions
    from irtscots_cl.imaging.camera_files import CameraFiles

    values = {name: getattr(options, name) for name in _NAMES if getattr(options, name) is not None}
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    if math.isfinite(options.saturation):
        values["saturation"] = options.saturation
    try:
        read = ReadOptions(options.ser_byte_order, options.fits_rows, options.array)
        return CameraFiles(**values, read=read)
    except ValueError as error:
        key, equals, rest = str(error).partition(" = ")
        raise ValueError(f"--{key.replace('_', '-')}{equals}{rest}") from None
