"""The camera's images of fringes by their manifest: which files they are, and the stack that they make."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from irtscots_cl.formats.images import FrameSource, open_frames
from irtscots_cl.imaging.fringe_manifest import DARK, NAME, WHITE, FringeManifest, image_paths, read_manifest
from irtscots_cl.imaging.fringes import FringeStack
from irtscots_cl.imaging.lab_frames import mean_frame
from irtscots_cl.imaging.orientation import stored_shape
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.model import Scene

SUFFIX = ".toml"
SHOWN = 3  # names in messages


@dataclass(frozen=True)
class FringeImages:
    """frames: as recorded, in the manifest's order."""

    manifest: FringeManifest
    frames: FrameSource = field(repr=False)

    def stack(self, saturation: float | None = None) -> FringeStack:
        """The fringe images, read when they are asked for, and the means of the dark and the white ones.

        saturation: value at which samples are saturated; None: as the files say.
        """
        return FringeStack(
            self.manifest.sets,
            self.frames.part(self.manifest.order),
            self._mean(DARK),
            self._mean(WHITE),
            self.frames.saturation if saturation is None else saturation,
        )

    def _mean(self, shows: str) -> FloatArray | None:
        numbers = self.manifest.numbers(shows)
        return mean_frame(self.frames.part(numbers)).mean if numbers else None

    def name(self, number: int) -> str:
        """An image in messages: its number from 1 and its file."""
        file, page = self.frames.place(number)
        return f"image {number + 1} ({file.path.name}{f' frame {page + 1}' if file.count > 1 else ''})"

    def names_of(self, shows: str) -> str:
        """The images of DARK or WHITE frames in messages."""
        return ", ".join(self.name(k) for k in self.manifest.numbers(shows)[:SHOWN])

    def of_stack(self, number: int) -> int:
        """Number of an image of the stack."""
        return self.manifest.order[number]


def open_fringe_images(
    paths: Sequence[Path], scene: Scene, manifest: Path | None = None, saturation: float | None = None
) -> FringeImages:
    """The images of a manifest, of a folder with one, or of a folder or files with a manifest that lies elsewhere.

    Raises ValueError, with a message of one line, where images, manifest and scene do not fit.
    """
    given = list(paths)
    if manifest is None:
        manifest, given = own_manifest(given)
    found = read_manifest(manifest, scene)
    frames = open_frames(given or image_paths(found), saturation=saturation)
    wanted = len(found.frames)
    where = ", ".join(path.name for path in given[:SHOWN]) if given else str(found.path.parent)
    if frames.count != wanted:
        few = frames.count < wanted
        raise ValueError(
            f"{where}: {frames.count} images; {found.path} has {wanted} frames: "
            + ("images are missing, or lines of frames that were not recorded are left" if few else "too many")
            + (_gap(found, frames) if few else "")
            + f"; the first is {found.frames[0].text}, the last {found.frames[-1].text}"
        )
    detector = scene.camera.detector
    columns, rows = detector.pixels
    shape = stored_shape((rows, columns), detector.orientation)
    if frames.shape != shape:
        raise ValueError(
            f"{where}: images of {frames.shape[1]} x {frames.shape[0]} pixels; scene {scene.name}: "
            f"camera.detector.pixels = {[columns, rows]}, stored as orientation = {detector.orientation!r} says, are "
            f"{shape[1]} x {shape[0]} (columns x rows)"
        )
    return FringeImages(found, frames)


def _gap(manifest: FringeManifest, frames: FrameSource) -> str:
    """The first name that is missing among files which are numbered one by one, in words; "" where none is."""
    names = [frames.place(k)[0].path.name for k in range(frames.count)]
    numbers = [re.fullmatch(r"(.*?)(\d+)(\D*)", name) for name in names]
    for k, (one, other) in enumerate(pairwise(numbers), 1):
        if one is None or other is None or one[1] != other[1]:
            return ""
        if int(other[2]) - int(one[2]) > 1:
            name = f"{one[1]}{int(one[2]) + 1:0{len(one[2])}d}{one[3]}"
            return f"; there is no {name}, which would show {manifest.frames[k].text}"
    return ""


def own_manifest(paths: list[Path]) -> tuple[Path, list[Path]]:
    """The manifest among the paths, or in a folder that they are; and the other paths."""
    first = paths[0]
    if len(paths) == 1 and first.is_dir():
        path = first / NAME
        if path.is_file():
            return path, []
        raise ValueError(
            f"{first}: no {NAME} in it, which says what the images show: `irtscots patterns` writes one with the "
            "pictures; put it there, or name it by --manifest"
        )
    tables = [path for path in paths if path.suffix.lower() == SUFFIX]
    if len(tables) == 1:
        return tables[0], [path for path in paths if path != tables[0]]
    raise ValueError(f"{first}: images of fringes need one manifest, which says what they show; name it by --manifest")


def is_fringe_input(paths: Sequence[Path], suffixes: frozenset[str]) -> bool:
    """Whether paths are those of fringe images or of a manifest, by their names alone."""
    return len(paths) > 1 or paths[0].is_dir() or paths[0].suffix.lower() in {SUFFIX, *suffixes}
