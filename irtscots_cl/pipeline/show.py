"""The pictures that a real screen shows, written with the manifest that tells `reconstruct` what they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from irtscots_cl.imaging.fringe_manifest import CAMERA, NAME, FringeManifest, frames_of, manifest_text
from irtscots_cl.imaging.fringes import FringeSet
from irtscots_cl.imaging.screen_pictures import picture, usual_periods, write_picture
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
    chief = Setup(scene.nominal()).chief_rays
    seen = chief.footprint.coverage >= 0.5
    sets = []
    for k, axis in enumerate("xy"):
        half_width, along_row, along_column = (np.broadcast_to(v, seen.shape)[seen] for v in chief.light_shape(k))
        shape = float(np.nanmedian(half_width)), float(np.nanmedian(along_row + along_column))
        suit = usual_periods(scene.screen.pixels[k], scene.screen.pitch_xy_mm[k], *shape)
        sets.append(FringeSet.equal(axis, suit, steps))
    return tuple(sets)


def show(scene: Scene, folder: Path, sets: Sequence[FringeSet], bits: int = 8) -> FringeManifest:
    """Write the pictures of the sets, of a dark and of a white screen, and the manifest into a folder.

    The manifest comes last: one that is there has all its pictures. Raises ValueError.
    """
    manifest = FringeManifest(scene.name, scene.screen.pixels, frames_of(sets), (CAMERA,), bits, path=folder / NAME)
    folder.mkdir(parents=True, exist_ok=True)
    with told_as_incomplete(folder):
        (folder / NAME).unlink(missing_ok=True)
        for frame in manifest.frames:
            interruption.check()
            with replacing(folder / frame.picture) as temporary:
                write_picture(temporary, picture(frame, scene, bits))
        write_text(folder / NAME, manifest_text(manifest, package_version()))
    return manifest
