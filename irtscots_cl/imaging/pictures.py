"""Any pictures on the screen: what a transport map makes of them, without new rays.

pictures = Pictures(scene, read_pictures(["logo.png", "speckle.npy"], scene))
images = irt.trace(scene).images(pictures)  # [pictures, detector rows, detector columns] in W
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from irtscots_cl.imaging.bad_values import check_values
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.model import Scene


@dataclass(frozen=True)
class Pictures:
    """values: [pictures, rows, columns] of the screen, upright: the first row at its -y, the first column at its -x
    edge; from 0 to any finite value, 1 for the full radiance. gamma: of the screen, which emits value^gamma.

    Raises ValueError for pictures of another screen and for values that are not allowed.
    """

    scene: Scene
    values: FloatArray = field(repr=False)
    gamma: float = 1.0

    def __post_init__(self) -> None:
        columns, rows = self.scene.screen.pixels
        shape = np.shape(self.values)
        if len(shape) != 3 or shape[1:] != (rows, columns) or not shape[0]:
            raise ValueError(f"pictures have shape {shape}; must be [pictures, {rows}, {columns}]: the screen's pixels")
        check_values("pictures", np.asarray(self.values))
        if np.min(self.values) < 0:
            raise ValueError(f"pictures: {np.min(self.values):g}: must not be negative")
        if not 0 < self.gamma <= 10:
            raise ValueError(f"pictures: gamma = {self.gamma}: must be above 0, at most 10")

    @property
    def radiance(self) -> FloatArray:
        """Relative radiance [pictures, rows, columns]."""
        values = np.asarray(self.values, float)
        return values if self.gamma == 1 else values**self.gamma


def read_pictures(paths: Sequence[str | Path], scene: Scene) -> FloatArray:
    """Pictures for a scene's screen from files, folders of them too: PNG, TIFF and what else open_frames reads.

    Whole numbers are divided by the greatest of their type, numbers of floating point must be from 0 to 1. A file's
    first row is the screen's +y edge, its first column the +x edge, as `irtscots patterns` writes them; the result is
    upright. Raises ValueError, with a message of one line.
    """
    from irtscots_cl.formats.images import open_frames

    frames = open_frames([Path(path) for path in paths])
    columns, rows = scene.screen.pixels
    if frames.shape != (rows, columns):
        raise ValueError(
            f"{frames.name(0)}: a picture of {frames.shape[1]} x {frames.shape[0]} pixels; the screen of scene "
            f"{scene.name} has {columns} x {rows}: must be equal"
        )
    top = float(np.iinfo(frames.dtype).max) if frames.dtype.kind in "ui" else 1.0
    found = np.empty((frames.count, rows, columns))
    for k in range(frames.count):
        image = np.asarray(frames[k], float) / top
        if not (np.isfinite(image).all() and image.min() >= 0 and image.max() <= 1):
            raise ValueError(
                f"{frames.name(k)}: values from {image.min():g} to {image.max():g}: must be from 0 to 1, or whole "
                "numbers"
            )
        found[k] = image[::-1, ::-1]
    return found
