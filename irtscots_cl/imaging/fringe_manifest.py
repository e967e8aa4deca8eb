"""The manifest of a fringe measurement: the frames shown on the screen, and where the camera's images are.

    images = "camera"                    # a folder, a file, names with * and ?, or a list of these
    frames = [
      { picture = "00-dark.png", shows = "dark" },
      { picture = "02-x-0.9-0.png", shows = "fringes", axis = "x", periods = 0.9, step_deg = 0.0 },
    ]

The images belong to the frames in their order; or every frame names its own, `image = "IMG_0412.tif"`. Names are of
files in the manifest's folder. docs/fringes.md says what each frame shows.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from irtscots_cl.formats.images import SUFFIXES, natural_order
from irtscots_cl.imaging.camera_files import CameraFiles, camera_files, named
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import nearest, shown_word

NAME = "manifest.toml"
KIND = "fringes on a screen"
CAMERA = "camera"  # folder of the camera's images, beside the manifest
DARK, WHITE, FRINGES = "dark", "white", "fringes"
SHOWS = (DARK, WHITE, FRINGES)
_KEYS = {
    "": ("kind", "version", "scene", "screen_pixels", "bits", "first_row", "first_column", "images", "ends", "reverse",
         "frames", "camera"),
    "frames": ("picture", "shows", "axis", "periods", "step_deg", "image"),
}  # fmt: skip
_OF_FRINGES = ("axis", "periods", "step_deg")
_MAX_BYTES = 2**22


@dataclass(frozen=True)
class ShownFrame:
    """One frame. shows: of SHOWS; axis, periods, step_deg: of fringes only. picture: file for the screen. image: the
    camera's file, "" where the manifest's `images` tells."""

    shows: str
    axis: str = ""
    periods: float = 0.0
    step_deg: float = 0.0
    picture: str = ""
    image: str = ""

    @property
    def text(self) -> str:
        """What the frame shows, in words."""
        if self.shows != FRINGES:
            return self.shows
        return f"{self.axis} fringes of {self.periods:g} periods at {self.step_deg:g} degrees"


@dataclass(frozen=True)
class FringeManifest:
    """Frames in the order in which they are recorded.

    scene: name of the scene that the pictures were made for. screen_pixels: (columns, rows). images: where the camera's
    images are, in the frames' order. bits: of a picture's values, 0 where that is not known. ends: of the fringes,
    reverse: the axes that have it, as in FringeSet. path: of its file.
    """

    scene: str
    screen_pixels: tuple[int, int]
    frames: tuple[ShownFrame, ...]
    images: tuple[str, ...] = ()
    bits: int = 0
    ends: str = "edges"
    reverse: tuple[str, ...] = ()
    path: Path = Path(NAME)
    camera: CameraFiles = field(default_factory=CameraFiles)

    @property
    def levels(self) -> int:
        """Number of equal steps of a picture's values; 0 where that is not known."""
        return 2**self.bits - 1 if self.bits else 0

    @property
    def sets(self) -> tuple[FringeSet, ...]:
        """The fringes by axis, series in the order in which they first appear. Raises ValueError."""
        found: dict[str, dict[float, list[float]]] = {}
        for frame in self.frames:
            if frame.shows == FRINGES:
                steps = found.setdefault(frame.axis, {}).setdefault(frame.periods, [])
                steps.append(math.radians(frame.step_deg))
        return tuple(
            FringeSet(axis, tuple(series), tuple(map(tuple, series.values())), axis in self.reverse, self.ends)
            for axis, series in found.items()
        )

    @property
    def order(self) -> tuple[int, ...]:
        """Numbers of the frames with fringes, in the order of the sets: axis by axis, series by series."""
        keys = {(s.axis, p): (k, j) for k, s in enumerate(self.sets) for j, p in enumerate(s.periods)}
        fringes = self.numbers(FRINGES)
        return tuple(sorted(fringes, key=lambda n: keys[self.frames[n].axis, self.frames[n].periods]))

    def numbers(self, shows: str) -> tuple[int, ...]:
        """Numbers of the frames that show this."""
        return tuple(k for k, frame in enumerate(self.frames) if frame.shows == shows)


def frames_of(sets: Iterable[FringeSet]) -> tuple[ShownFrame, ...]:
    """A dark and a white frame, then those of the sets in their order, with names for their pictures."""
    frames = [ShownFrame(DARK), ShownFrame(WHITE)]
    for one in sets:
        for periods, steps in zip(one.periods, one.steps_rad, strict=True):
            frames += [ShownFrame(FRINGES, one.axis, periods, _degrees(step)) for step in steps]
    width = len(str(len(frames) - 1))
    named = []
    for k, frame in enumerate(frames):
        what = frame.shows if frame.shows != FRINGES else f"{frame.axis}-{frame.periods:g}-{frame.step_deg:.6g}"
        named.append(ShownFrame(frame.shows, frame.axis, frame.periods, frame.step_deg, f"{k:0{width}d}-{what}.png"))
    return tuple(named)


def manifest_text(manifest: FringeManifest, version: str) -> str:
    """A manifest as TOML, to be read by people as well. version: of this package."""
    columns, rows = manifest.screen_pixels
    lines = [
        "# Fringes on a screen: the frames in the order in which they are shown and recorded, a line each.",
        "# picture: PNG to show, pixel for pixel. Its first row is the screen's +y edge, its first column the +x edge:",
        "# the top and the left for who stands at the mirror and looks at a screen whose y points up.",
        "# Fringes show 1/2 + 1/2 cos(2 pi periods s - step) of the full range; s grows from 0 at the -x (-y) edge of",
        "# the pixel grid to 1 at its +x (+y) edge.",
        "#",
        "# Put the camera's images into the folder named by `images`, by name in the order of the frames:",
        f"# then `irtscots reconstruct {NAME} --scene SCENE`. Or replace `images` by other names or a list of them,",
        '# * and ? allowed; or add image = "NAME" to every line. Delete the lines of frames that were not recorded.',
        f"kind = {_quoted(KIND)}",
        f"version = {_quoted(version)}",
        f"scene = {_quoted(manifest.scene)}",
        f"screen_pixels = [{columns}, {rows}]  # columns, rows",
        f"bits = {manifest.bits}",
        'first_row = "+y"',
        'first_column = "+x"',
        f"images = {_list(manifest.images)}",
        "frames = [",
        *(f"  {_line(frame)}," for frame in manifest.frames),
        "]",
    ]
    return "\n".join(lines) + "\n"


def _line(frame: ShownFrame) -> str:
    parts = [f"picture = {_quoted(frame.picture)}", f"shows = {_quoted(frame.shows)}"]
    if frame.shows == FRINGES:
        parts += [f'axis = "{frame.axis}"', f"periods = {frame.periods!r}", f"step_deg = {frame.step_deg!r}"]
    if frame.image:
        parts.append(f"image = {_quoted(frame.image)}")
    return "{ " + ", ".join(parts) + " }"


def _list(names: tuple[str, ...]) -> str:
    return _quoted(names[0]) if len(names) == 1 else "[" + ", ".join(map(_quoted, names)) + "]"


def _quoted(text: str) -> str:
    """A string of TOML, which is one of JSON but for characters that JSON cannot hold."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _degrees(step_rad: float) -> float:
    """To the rounding of its last digits, so that a quarter of a turn is 90."""
    return round(math.degrees(step_rad), 11)


def read_manifest(path: Path, scene: Scene | None = None) -> FringeManifest:
    """The manifest of a file. scene: whose screen it must fit. Raises ValueError, with a message of one line."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise ValueError(f"{path}: {path.stat().st_size} bytes: no manifest")
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: not a readable manifest: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: not a readable TOML file: {str(error).splitlines()[0]}") from None
    try:
        return _manifest(table, path, scene)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _manifest(table: dict[str, Any], path: Path, scene: Scene | None) -> FringeManifest:
    _known(table, "", "")
    if table.get("kind") != KIND:
        raise ValueError(f'kind = {_told(table.get("kind"))}: must be "{KIND}"')
    frames = table.get("frames")
    if not isinstance(frames, list) or not frames:
        raise ValueError("frames: must be a list of tables, one for each frame")
    shown = tuple(_frame(f"frames[{k}]", one) for k, one in enumerate(frames))
    named = [k for k, frame in enumerate(shown) if frame.image]
    if named and len(named) < len(shown):
        k = next(k for k, frame in enumerate(shown) if not frame.image)
        raise ValueError(f"frames[{k}].image: missing ({shown[k].text}); must be given for all frames or for none")
    pixels = table.get("screen_pixels")
    if not (isinstance(pixels, list) and len(pixels) == 2 and all(type(n) is int and n > 0 for n in pixels)):
        raise ValueError(f"screen_pixels = {_told(pixels)}: must be [columns, rows]")
    if scene is not None and tuple(pixels) != scene.screen.pixels:
        raise ValueError(
            f"screen_pixels = {pixels}: scene {scene.name} has a screen of {list(scene.screen.pixels)}: must be equal"
        )
    reverse = _strings("reverse", table.get("reverse", []))
    if not set(reverse) <= {"x", "y"}:
        raise ValueError(f'reverse = {list(reverse)}: must be a list of "x", "y" or both')
    name, bits = table.get("scene", ""), table.get("bits", 0)
    if type(bits) is not int or not 0 <= bits <= 16:
        raise ValueError(f"bits = {_told(bits)}: must be a whole number from 1 to 16, or left out if not known")
    ends = table.get("ends", "edges")
    found = FringeManifest(
        str(name),
        (pixels[0], pixels[1]),
        shown,
        _strings("images", table.get("images", [])),
        bits,
        ends,
        reverse,
        path,
        camera_files(table.get("camera", {}), path.parent),
    )
    axes = {one.axis for one in found.sets}  # and checks them
    if axes != {"x", "y"}:
        raise ValueError(f"frames: fringes along {' and '.join(sorted(axes)) or 'no axis'}; must be along x and y")
    return found


def _frame(where: str, table: Any) -> ShownFrame:
    if not isinstance(table, dict):
        raise ValueError(f"{where} = {_told(table)}: must be a table")
    _known(table, "frames", f"{where}.")
    shows = table.get("shows")
    if shows not in SHOWS:
        raise ValueError(f"{where}.shows = {_told(shows)}: must be one of {', '.join(SHOWS)}")
    for key in ("picture", "image"):
        if not isinstance(table.get(key, ""), str):
            raise ValueError(f"{where}.{key} = {_told(table[key])}: must be the name of a file")
    names = {key: table.get(key, "") for key in ("picture", "image")}
    if shows != FRINGES:
        wrong = next((key for key in _OF_FRINGES if key in table), None)
        if wrong:
            raise ValueError(f"{where}.{wrong}: must be left out of a frame that shows {shows}")
        return ShownFrame(shows, **names)
    axis, periods, step = (table.get(key) for key in _OF_FRINGES)
    if axis not in ("x", "y"):
        raise ValueError(f'{where}.axis = {_told(axis)}: must be "x" or "y"')
    return ShownFrame(
        shows, str(axis), _number(f"{where}.periods", periods), _number(f"{where}.step_deg", step), **names
    )


def _number(key: str, value: Any) -> float:
    if type(value) not in (int, float) or not abs(value) < 1e9:
        raise ValueError(f"{key} = {_told(value)}: must be a number below 1e9")
    return float(value)


def _told(value: Any) -> str:
    """A value of the file for a message."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _known(table: dict[str, Any], of: str, where: str) -> None:
    """Raise ValueError for a key that no manifest has."""
    for key in table:
        if key not in _KEYS[of]:
            raise ValueError(f"{where}{shown_word(key)}: unknown key; {nearest(key, _KEYS[of])}")


def _strings(key: str, value: Any) -> tuple[str, ...]:
    values = [value] if isinstance(value, str) else value
    if not isinstance(values, list) or not all(isinstance(one, str) for one in values):
        raise ValueError(f"{key} = {_told(value)}: must be a string or a list of strings")
    return tuple(values)


def image_paths(manifest: FringeManifest) -> list[Path]:
    """The files or folders of the camera's images, in the frames' order. Raises ValueError where there are none.

    Where the manifest names none and there is no folder `camera` beside it, they are the images in its own folder,
    apart from the pictures for the screen.
    """
    folder = manifest.path.parent
    own = [folder / frame.image for frame in manifest.frames if frame.image]
    if own:
        return own
    if manifest.images and not (manifest.images == (CAMERA,) and not (folder / CAMERA).exists()):
        return [
            path for name in manifest.images for path in named(folder, name, f"{manifest.path}: images = {_told(name)}")
        ]
    pictures = {frame.picture for frame in manifest.frames}
    beside = [p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file() and p.name not in pictures]
    if not beside:
        raise ValueError(
            f"{manifest.path}: no images of the camera in {folder / CAMERA} nor beside the manifest; put them there, "
            'or say where they are: images = "FOLDER", or image = "NAME" in the line of each frame'
        )
    return natural_order(beside)
