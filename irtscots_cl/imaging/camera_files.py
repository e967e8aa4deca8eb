"""What a laboratory knows about its camera's images: calibration frames, repeats, exposures, and how files are read.

In a manifest it is the table [camera]; names are of files in the manifest's folder:

    [camera]
    dark = "dark"                 # a folder, a file, names with * and ?, or a list of these; so flat, bias, flat_dark
    bad_pixels = "bad.png"        # not 0 where a pixel is bad
    exposures_s = [0.01, 0.1]     # of the images that make each frame; or repeats = 4 for equal ones
    repeat_order = "together"     # these images follow each other; "in turn": the whole series is repeated
    dark_exposure_s = 0.1
    flat_exposure_s = 0.02
    saturation = 4095
    fits_rows = "top-down"
    ser_byte_order = "little"
    array = "frames"              # of an NPZ or HDF5 file
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.formats.frames import BYTE_ORDERS, ROW_ORDERS, ReadOptions
from irtscots_cl.formats.images import SUFFIXES, FrameSource, is_hidden, natural_order, open_frames
from irtscots_cl.formats.mask_values import HDF5, PICTURES, picture_values
from irtscots_cl.imaging.lab_frames import ORDERS
from irtscots_cl.maths.arrays import BoolArray
from irtscots_cl.scene.validation import nearest, shown_word

SERIES = ("bias", "dark", "flat", "flat_dark")
MAX_REPEATS = 10_000
_READ = {"fits_rows": ROW_ORDERS, "ser_byte_order": BYTE_ORDERS}
_WORDS = {**_READ, "repeat_order": ORDERS}


@dataclass(frozen=True)
class CameraFiles:
    """Nothing is known by default: images are used as they are.

    bias, dark, flat, flat_dark: files or folders of the camera's calibration frames. bad_pixels: file that is not 0
    where a pixel is bad, lying as the images do. saturation: count at which samples are saturated; None: as files and
    images say. repeats: images of equal exposure that make each frame, exposures_s: of unequal ones; repeat_order: as
    the order of LabFrames. dark_exposure_s, flat_exposure_s: of those frames; None: as their files say. read: how files
    are read.

    Raises ValueError for what is not allowed.
    """

    bias: tuple[Path, ...] = ()
    dark: tuple[Path, ...] = ()
    flat: tuple[Path, ...] = ()
    flat_dark: tuple[Path, ...] = ()
    bad_pixels: Path | None = None
    saturation: float | None = None
    repeats: int = 1
    exposures_s: tuple[float, ...] = ()
    repeat_order: str = "together"
    dark_exposure_s: float | None = None
    flat_exposure_s: float | None = None
    read: ReadOptions = field(default_factory=ReadOptions)

    def __post_init__(self) -> None:
        for name in ("saturation", "dark_exposure_s", "flat_exposure_s"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ValueError(f"{name} = {value:g}: must be a number above 0")
        if not 1 <= self.repeats <= MAX_REPEATS:
            raise ValueError(f"repeats = {self.repeats}: must be 1 to {MAX_REPEATS}")
        if not all(0 < time < math.inf for time in self.exposures_s):
            raise ValueError(f"exposures_s = {list(self.exposures_s)}: must be numbers above 0")
        if self.exposures_s and self.repeats not in (1, len(self.exposures_s)):
            raise ValueError(
                f"repeats = {self.repeats}: there are {len(self.exposures_s)} exposures_s; must be as many, or left out"
            )
        if self.repeat_order not in ORDERS:
            raise ValueError(f"repeat_order = {self.repeat_order!r}: must be one of {', '.join(map(repr, ORDERS))}")
        if self.flat_dark and not self.flat:
            raise ValueError("flat_dark: must be left out where there are no flat frames")

    @property
    def images_of_frame(self) -> int:
        """Recorded images that make a frame."""
        return len(self.exposures_s) or self.repeats

    @property
    def changes_frames(self) -> bool:
        """Whether frames are others than the recorded images."""
        return self.images_of_frame > 1 or bool(self.bad_pixels or any(getattr(self, name) for name in SERIES))

    def replaced_by(self, other: CameraFiles) -> CameraFiles:
        """The same, with all that `other` says in place of what this one says: options over a manifest."""
        plain = CameraFiles()
        own = {f.name: getattr(other, f.name) for f in fields(other)}
        said = {name: value for name, value in own.items() if value != getattr(plain, name)}
        if "exposures_s" in said or "repeats" in said:
            said = {"exposures_s": other.exposures_s, "repeats": other.repeats} | said
        if "read" in said:
            options = {f.name: getattr(other.read, f.name) for f in fields(other.read)}
            said["read"] = replace(self.read, **{name: value for name, value in options.items() if value is not None})
        return replace(self, **said)

    def open(self, name: str) -> FrameSource | None:
        """The frames of one of SERIES, None where there are none. Raises ValueError, which names them."""
        paths = getattr(self, name)
        if not paths:
            return None
        try:
            return open_frames(paths, saturation=self.saturation, options=self.read)
        except ValueError as error:
            raise ValueError(f"{name.replace('_', ' ')} frames: {error}") from None

    def bad(self, shape: tuple[int, int]) -> BoolArray | None:
        """The bad pixels [rows, columns] as stored, None where there is no map. Raises ValueError."""
        path = self.bad_pixels
        if path is None:
            return None
        what = f"bad-pixel map {str(path)!r}"
        if path.suffix.lower() in SUFFIXES - {*PICTURES, *HDF5, ".npy"}:
            values = np.asarray(open_frames(path, options=self.read)[0])
        else:
            values = picture_values(path, what)
        if values.shape != shape:
            size = " x ".join(map(str, values.shape[::-1])) or "one value"
            raise ValueError(f"{what}: has {size} pixels; must have the images' {shape[1]} x {shape[0]}")
        levels = np.unique(values)
        if len(levels) > 2:
            raise ValueError(f"{what}: has {len(levels)} different values; must be 0 and, for bad pixels, another one")
        is_bad: BoolArray = values != 0
        if is_bad.mean() > 0.5:
            raise ValueError(f"{what}: marks {is_bad.mean():.0%} of the pixels as bad: must be 0 where they are good")
        return is_bad


def camera_files(table: Any, folder: Path) -> CameraFiles:
    """Of a manifest's table [camera]. folder: that names are in. Raises ValueError, with the key and its value."""
    if not isinstance(table, dict):
        raise ValueError("camera: must be a table")
    read = {f.name for f in fields(ReadOptions)} - {"npz_array"} | {"array"}
    keys = {f.name for f in fields(CameraFiles)} - {"read"} | read
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in keys:
            raise ValueError(f"camera.{shown_word(key)}: unknown key; {nearest(key, sorted(keys))}")
        values[key] = _value(key, value, folder)
    options = {("npz_array" if key == "array" else key): values.pop(key) for key in read & values.keys()}
    try:
        return CameraFiles(**values, read=ReadOptions(**options))
    except ValueError as error:
        raise ValueError(f"camera.{error}") from None


def _value(key: str, value: Any, folder: Path) -> Any:
    shown = repr(value) if len(repr(value)) <= 80 else repr(value)[:77] + "..."
    where = f"camera.{key} = {shown}"
    if key in SERIES or key in ("bad_pixels", "array"):
        names = value if isinstance(value, list) and key in SERIES else [value]
        if not names or not all(isinstance(name, str) and name for name in names):
            raise ValueError(f"{where}: must be a name{' or a list of names' if key in SERIES else ''}")
        if key == "array":
            return value
        return folder / value if key == "bad_pixels" else tuple(p for name in names for p in named(folder, name, where))
    if key in _WORDS:
        if value not in _WORDS[key]:
            raise ValueError(f"{where}: must be one of {', '.join(map(repr, _WORDS[key]))}")
        return value
    if key == "repeats":
        if type(value) is not int:
            raise ValueError(f"{where}: must be a whole number")
        return value
    numbers = value if key == "exposures_s" and isinstance(value, list) else [value]
    if not all(type(number) in (int, float) for number in numbers):
        raise ValueError(f"{where}: must be a {'list of numbers' if key == 'exposures_s' else 'number'}")
    return tuple(map(float, numbers)) if key == "exposures_s" else float(value)


def named(folder: Path, name: str, where: str) -> list[Path]:
    """The files or folders in a folder that a name stands for, with * and ? for any characters. where: key and value,
    for messages. Raises ValueError where there are none."""
    path = folder / name
    if not any(c in name for c in "*?"):
        if not path.exists():
            raise ValueError(f"{where}: there is no file or folder {path}")
        return [path]
    some = path.parent.glob(path.name) if path.parent.is_dir() else ()
    found = natural_order(one for one in some if not is_hidden(one) or path.name.startswith((".", "~")))
    if not found:
        raise ValueError(f"{where}: no file in {path.parent} has such a name")
    return found
