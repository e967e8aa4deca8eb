"""The camera's images of a line scan by their manifest, as the image stack that every line-scan measure takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from irtscots_cl.imaging.fringe_images import FringeImages
from irtscots_cl.imaging.image_files import BYTES_PER_VALUE
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.lab_frames import is_saturated
from irtscots_cl.imaging.line_pictures import scene_of_lines
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.imaging.shown_frames import DARK, LINE
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.system.memory import check_memory


def line_stack(images: FringeImages, scene: Scene, saturation: float | None = None) -> tuple[Scene, ImageStack]:
    """The scene with the screen and the lines that the manifest tells of, and its upright image stack.

    The mean of the dark images is subtracted; samples at the saturation stay there, where they can be found. Lines of
    the scan without an image are missing samples. saturation: None for that of the files. Raises ValueError for lines
    that are no scan, and for images that do not fit the memory.
    """
    frames = images.manifest.frames
    numbers = images.manifest.numbers(LINE)
    try:
        own, lines = scene_of_lines([frames[k] for k in numbers], scene)
    except ValueError as error:
        raise ValueError(f"{images.manifest.path}: {error}") from None
    limit = images.frames.saturation if saturation is None else saturation
    dark = images.mean(DARK)
    pattern = LineScan(own)
    values = sum(len(pattern.positions_mm(axis)) for axis in "xy") * images.frames.shape[0] * images.frames.shape[1]
    check_memory(f"{images.manifest.path}: line images of {values} values", values * BYTES_PER_VALUE)
    scans = []
    for axis in "xy":
        positions = pattern.positions_mm(axis)
        stack = np.full((len(positions), *images.frames.shape), np.nan)
        own_numbers = [k for k in numbers if frames[k].axis == axis]
        for line, number in zip(lines[axis], own_numbers, strict=True):
            interruption.check()
            stack[line] = _less_dark(images.frames[number], dark, limit)
        whole = upright(stack, scene.camera.detector.orientation)
        scans.append(replace(Scan.from_images(axis, positions, whole, pattern.line_width), unit="DN"))
    return own, ImageStack(scans[0], scans[1]).saturating_at(limit)


def _less_dark(image: np.ndarray, dark: FloatArray | None, saturation: float) -> FloatArray:
    values = np.asarray(image, float)
    return values if dark is None else np.where(is_saturated(image, saturation), saturation, values - dark)
