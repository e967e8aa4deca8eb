"""The manifest of a measurement: the frames shown on the screen, and where the camera's images are.

    images = "camera"                    # a folder, a file, names with * and ?, or a list of these
    frames = [
      { picture = "00-dark.png", shows = "dark" },
      { picture = "02-x-0.9-0.png", shows = "fringes", axis = "x", periods = 0.9, step_deg = 0.0 },
    ]

The images belong to the frames in their order; or every frame names its own, `image = "IMG_0412.tif"`. Names are of
files in the manifest's folder. imaging.shown_frames has the kinds of frames; docs/fringes.md says what each shows.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from irtscots_cl.formats.images import SUFFIXES, natural_order
from irtscots_cl.imaging.camera_files import CameraFiles, camera_files, named
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.gray_code import gray_sets
from irtscots_cl.imaging.sequences import fringe_series, in_order
from irtscots_cl.imaging.shown_frames import (
    DARK,
    DOTS,
    FRINGES,
    GRAY,
    LINE,
    PICTURE,
    WHITE,
    ShownFrame,
    check_known,
    frame_line,
    frame_of,
    quoted,
    told,
)
from irtscots_cl.scene.model import Scene

__all__ = ["DARK", "DOTS", "FRINGES", "GRAY", "LINE", "PICTURE", "WHITE", "ShownFrame"]

NAME = "manifest.toml"
KIND, OTHER_KIND = "fringes on a screen", "patterns on a screen"
CAMERA = "camera"  # folder of the camera's images, beside the manifest
MEASURED = ({FRINGES}, {GRAY}, {GRAY, FRINGES}, {LINE}, {DOTS}, {PICTURE})  # what may be shown beside dark and white
_KEYS = ("kind", "version", "scene", "screen_pixels", "bits", "first_row", "first_column", "images", "ends", "reverse",
         "frames", "camera")  # fmt: skip
_MAX_BYTES = 2**22
_ABOUT = {  # comments of a manifest on what its frames show
    FRINGES: "# Fringes show 1/2 + 1/2 cos(2 pi periods s - step) of the full range; s grows from 0 at the -x (-y)\n"
    "# edge of the pixel grid to 1 at its +x (+y) edge.",
    LINE: "# A line begins first_px pixels from the screen's -x (-y) edge; pixels that it covers in part are grey.",
    GRAY: "# Plane `bit` of a Gray code, 0 the coarsest, of so many cells over the screen, from its -x (-y) edge on.",
    DOTS: "# first_px: centre of the first dot, in pixels from the screen's -x and -y edge.",
}


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
    def content(self) -> set[str]:
        """What the frames show, beside dark and white."""
        return {frame.shows for frame in self.frames} - {DARK, WHITE}

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
    return in_order({one.axis: fringe_series(one) for one in sets})


def manifest_text(manifest: FringeManifest, version: str) -> str:
    """A manifest as TOML, to be read by people as well. version: of this package."""
    columns, rows = manifest.screen_pixels
    lines = [
        "# Patterns on a screen: the frames in the order in which they are shown and recorded, a line each.",
        "# picture: PNG to show, pixel for pixel. Its first row is the screen's +y edge, its first column the +x edge:",
        "# the top and the left for who stands at the mirror and looks at a screen whose y points up.",
        *(_ABOUT[shows] for shows in sorted(manifest.content & set(_ABOUT))),
        "#",
        "# Put the camera's images into the folder named by `images`, by name in the order of the frames:",
        f"# then `irtscots reconstruct {NAME} --scene SCENE`. Or replace `images` by other names or a list of them,",
        '# * and ? allowed; or add image = "NAME" to every line. Delete the lines of frames that were not recorded.',
        f"kind = {quoted(KIND if manifest.content == {FRINGES} else OTHER_KIND)}",
        f"version = {quoted(version)}",
        f"scene = {quoted(manifest.scene)}",
        f"screen_pixels = [{columns}, {rows}]  # columns, rows",
        f"bits = {manifest.bits}",
        'first_row = "+y"',
        'first_column = "+x"',
        f"images = {_list(manifest.images)}",
        "frames = [",
        *(f"  {frame_line(frame)}," for frame in manifest.frames),
        "]",
    ]
    return "\n".join(lines) + "\n"


def _list(names: tuple[str, ...]) -> str:
    return quoted(names[0]) if len(names) == 1 else "[" + ", ".join(map(quoted, names)) + "]"


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
    check_known(table, _KEYS, "")
    if table.get("kind") not in (KIND, OTHER_KIND):
        raise ValueError(f'kind = {told(table.get("kind"))}: must be "{KIND}" or "{OTHER_KIND}"')
    frames = table.get("frames")
    if not isinstance(frames, list) or not frames:
        raise ValueError("frames: must be a list of tables, one for each frame")
    shown = tuple(frame_of(f"frames[{k}]", one) for k, one in enumerate(frames))
    named = [k for k, frame in enumerate(shown) if frame.image]
    if named and len(named) < len(shown):
        k = next(k for k, frame in enumerate(shown) if not frame.image)
        raise ValueError(f"frames[{k}].image: missing ({shown[k].text}); must be given for all frames or for none")
    pixels = table.get("screen_pixels")
    if not (isinstance(pixels, list) and len(pixels) == 2 and all(type(n) is int and n > 0 for n in pixels)):
        raise ValueError(f"screen_pixels = {told(pixels)}: must be [columns, rows]")
    if scene is not None and tuple(pixels) != scene.screen.pixels:
        raise ValueError(
            f"screen_pixels = {pixels}: scene {scene.name} has a screen of {list(scene.screen.pixels)}: must be equal"
        )
    reverse = _strings("reverse", table.get("reverse", []))
    if not set(reverse) <= {"x", "y"}:
        raise ValueError(f'reverse = {list(reverse)}: must be a list of "x", "y" or both')
    name, bits = table.get("scene", ""), table.get("bits", 0)
    if type(bits) is not int or not 0 <= bits <= 16:
        raise ValueError(f"bits = {told(bits)}: must be a whole number from 1 to 16, or left out if not known")
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
    _check_content(found)
    return found


def _check_content(manifest: FringeManifest) -> None:
    """Raise ValueError for frames that make no measurement together."""
    if manifest.content not in MEASURED:
        told_of = " and ".join(sorted(manifest.content)) or "nothing but dark and white"
        raise ValueError(
            f"frames: show {told_of}: must be fringes, lines, a Gray code, a Gray code and fringes, dots, or pictures"
        )
    sets = {one.axis: one for one in manifest.sets}  # which checks them
    for axis, (code, _) in gray_sets(manifest.frames).items():
        if sets and (manifest.reverse or manifest.ends != "edges"):
            raise ValueError('reverse, ends: must be left out with a Gray code: [] and "edges"')
        if axis in sets and (len(sets[axis].periods) > 1 or sets[axis].periods[0] != code.cells):
            shown = ", ".join(f"{p:g}" for p in sets[axis].periods)
            raise ValueError(
                f"frames: {axis} fringes of {shown} periods and a Gray code of "
                f"{code.cells:g} cells: must be one number of periods, equal to that of cells"
            )
    for shows in sorted(manifest.content & {FRINGES, LINE, GRAY}):
        axes = {frame.axis for frame in manifest.frames if frame.shows == shows}
        if axes != {"x", "y"}:
            raise ValueError(f"frames: {shows} along {axes.pop()}; must be along x and y")


def _strings(key: str, value: Any) -> tuple[str, ...]:
    values = [value] if isinstance(value, str) else value
    if not isinstance(values, list) or not all(isinstance(one, str) for one in values):
        raise ValueError(f"{key} = {told(value)}: must be a string or a list of strings")
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
            path for name in manifest.images for path in named(folder, name, f"{manifest.path}: images = {told(name)}")
        ]
    pictures = {frame.picture for frame in manifest.frames}
    beside = [p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file() and p.name not in pictures]
    if not beside:
        raise ValueError(
            f"{manifest.path}: no images of the camera in {folder / CAMERA} nor beside the manifest; put them there, "
            'or say where they are: images = "FOLDER", or image = "NAME" in the line of each frame'
        )
    return natural_order(beside)
