"""The camera's images of fringes by their manifest: which files they are, and the stack that they make."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from irtscots_cl.formats.images import FrameSource, open_frames
from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.exposures import check_equal, exposures_of
from irtscots_cl.imaging.frame_count import check_count
from irtscots_cl.imaging.fringe_manifest import DARK, NAME, WHITE, FringeManifest, image_paths, read_manifest
from irtscots_cl.imaging.fringes import FringeStack
from irtscots_cl.imaging.lab_frames import LabFrames, mean_frame
from irtscots_cl.imaging.orientation import TRANSPOSED, stored_shape
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.instrument import ORIENTATIONS
from irtscots_cl.scene.model import Scene

SUFFIX = ".toml"
SHOWN = 3  # names in messages


@dataclass(frozen=True)
class FringeImages:
    """recorded: the camera's images, `camera.images_of_frame` for each frame of the manifest. camera: what is known
    about them. frames: of the manifest, in its order: the recorded images, or what is made of them."""

    manifest: FringeManifest
    recorded: FrameSource = field(repr=False)
    camera: CameraFiles
    frames: FrameSource | LabFrames = field(repr=False)

    def stack(self, saturation: float | None = None) -> FringeStack:
        """The fringe images, read when they are asked for, and the means of the dark and the white ones.

        saturation: value at which samples are saturated; None: as the files say. Calibrated frames have none: their
        saturated samples are no numbers.
        """
        if isinstance(self.frames, LabFrames):
            saturation = math.inf
        elif saturation is None:
            saturation = self.recorded.saturation
        return FringeStack(
            self.manifest.sets,
            self.frames.part(self.manifest.order),
            self.mean(DARK),
            self.mean(WHITE),
            saturation,
        )

    def mean(self, shows: str) -> FloatArray | None:
        """The mean [rows, columns] of the frames that show this, as stored; None without any."""
        numbers = self.manifest.numbers(shows)
        if not numbers:
            return None
        mean = mean_frame(self.frames.part(numbers)).mean
        if isinstance(self.frames, LabFrames):  # a saturated sample is missing, and yet bright
            saturated = np.logical_or.reduce([self.frames.frame(k).saturated for k in numbers])
            mean[saturated] = np.nanmax(mean, initial=0.0) if np.isfinite(mean).any() else 1.0
        return mean

    @property
    def exposures_s(self) -> tuple[float | None, ...]:
        """Of the images that make a frame, None where they are not known. Raises ValueError where the images of a
        series have different ones by their files."""
        order, found = self.manifest.order, exposures_of(self.recorded, self.camera)
        if self.camera.images_of_frame == 1:
            counts = [len(steps) for one in self.manifest.sets for steps in one.steps_rad]
            ends = np.cumsum(counts).tolist()
            series = [order[end - count : end] for end, count in zip(ends, counts, strict=True)]
            check_equal(self.recorded, series, "a series")
        return found

    def name(self, number: int) -> str:
        """An image in messages, by the number of its frame in the manifest: the first recorded one that makes it."""
        first = self.frames.recorded(number)[0] if isinstance(self.frames, LabFrames) else number
        return self.recorded_name(first)

    def recorded_name(self, number: int) -> str:
        """A recorded image in messages: its number from 1 and its file."""
        file, page = self.recorded.place(number)
        return f"image {number + 1} ({file.path.name}{f' frame {page + 1}' if file.count > 1 else ''})"

    def names_of(self, shows: str) -> str:
        """The images of DARK or WHITE frames in messages."""
        return ", ".join(self.name(k) for k in self.manifest.numbers(shows)[:SHOWN])

    def name_in_stack(self, number: int) -> str:
        """An image of the stack in messages."""
        return self.name(self.of_stack(number))

    def of_stack(self, number: int) -> int:
        """Number in the manifest of an image of the stack."""
        return self.manifest.order[number]


def open_fringe_images(
    paths: Sequence[Path],
    scene: Scene,
    manifest: Path | None = None,
    camera: CameraFiles | None = None,
) -> FringeImages:
    """The images of a manifest, of a folder with one, or of a folder or files with a manifest that lies elsewhere.

    camera: what is known about the camera, in place of what the manifest says of it. Raises ValueError, with a message
    of one line, where images, manifest and scene do not fit.
    """
    given = list(paths)
    if manifest is None:
        manifest, given = own_manifest(given)
    found = read_manifest(manifest, scene)
    camera = found.camera if camera is None else found.camera.replaced_by(camera)
    frames = open_frames(given or image_paths(found), saturation=camera.saturation, options=camera.read)
    where = ", ".join(path.name for path in given[:SHOWN]) if given else str(found.path.parent)
    check_count(frames, found, camera.images_of_frame, where)
    detector = scene.camera.detector
    columns, rows = detector.pixels
    shape = stored_shape((rows, columns), detector.orientation)
    if frames.shape != shape:
        raise ValueError(
            f"{where}: images of {frames.shape[1]} x {frames.shape[0]} pixels; scene {scene.name}: "
            f"camera.detector.pixels = {[columns, rows]}, stored as orientation = {detector.orientation!r} says, are "
            f"{shape[1]} x {shape[0]} (columns x rows){_exchanged(frames.shape, shape, detector.orientation)}"
        )
    return FringeImages(found, frames, camera, frames)


def _exchanged(found: tuple[int, int], wanted: tuple[int, int], orientation: str) -> str:
    """The remedy for images whose rows are the other's columns, as the end of a message."""
    if found != wanted[::-1] or found == wanted:
        return ""
    words = [word for word in ORIENTATIONS if (word in TRANSPOSED) != (orientation in TRANSPOSED)]
    return f": rows and columns are exchanged, the orientation is one of {', '.join(words)}"


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
