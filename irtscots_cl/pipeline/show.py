"""The pictures that a real screen shows, written with the manifest that tells `reconstruct` what they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.fringe_manifest import CAMERA, NAME, FringeManifest, manifest_text
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.screen_pictures import as_picture, upright_values, usual_periods, write_picture
from irtscots_cl.imaging.shown_frames import PICTURE, ShownFrame
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.output import told_as_incomplete
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import replacing, write_text
from irtscots_cl.system.versions import package_version


def fringe_sets(scene: Scene, periods: Sequence[float] | None = None, steps: int = 4) -> tuple[FringeSet, ...]:
    """Fringes along x and y. periods: over the screen, of both; None: those that suit the scene. Raises ValueError."""
    if periods is not None:
        return tuple(FringeSet.equal(axis, periods, steps) for axis in "xy")
    sets = []
    for k, (axis, shape) in enumerate(zip("xy", usual_light(scene), strict=True)):
        suit = usual_periods(scene.screen.pixels[k], scene.screen.pitch_xy_mm[k], *shape)
        sets.append(FringeSet.equal(axis, suit, steps))
    return tuple(sets)


def usual_light(scene: Scene) -> list[tuple[float, float]]:
    """Of a usual pixel's light on the screen along x and y: half-width of the aperture's image and width of the pixel's
    own in mm, medians over the mirror of the design."""
    chief = Setup(scene.nominal()).chief_rays
    seen = chief.footprint.coverage >= 0.5
    found = []
    for k in (0, 1):
        half_width, along_row, along_column = (np.broadcast_to(v, seen.shape)[seen] for v in chief.light_shape(k))
        found.append((float(np.nanmedian(half_width)), float(np.nanmedian(along_row + along_column))))
    return found


def show_frames(
    scene: Scene,
    folder: Path,
    frames: Sequence[ShownFrame],
    bits: int = 8,
    pictures: Sequence[NDArray[Any]] | NDArray[Any] = (),
) -> FringeManifest:
    """Write the pictures of frames and the manifest into a folder. pictures: upright values from 0 to 1 [rows, columns]
    of the frames that show the user's, in their order.

    The manifest comes last: one that is there has all its pictures. Raises ValueError.
    """
    manifest = FringeManifest(scene.name, scene.screen.pixels, tuple(frames), (CAMERA,), bits, path=folder / NAME)
    own = iter(pictures)
    folder.mkdir(parents=True, exist_ok=True)
    with told_as_incomplete(folder):
        (folder / NAME).unlink(missing_ok=True)
        for frame in manifest.frames:
            interruption.check()
            values = next(own) if frame.shows == PICTURE else upright_values(frame, scene)
            with replacing(folder / frame.picture) as temporary:
                write_picture(temporary, as_picture(values, bits))
        write_text(folder / NAME, manifest_text(manifest, package_version()))
    return manifest
