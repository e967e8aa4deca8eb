"""A mirror from a folder of line images, their manifest and the design of its test: the line-scan measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.fringe_images import open_fringe_images
from irtscots_cl.imaging.line_images import line_stack
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.measurement.methods import BEST
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.lab_camera import recorded_images
from irtscots_cl.pipeline.measure import measure, named, refuse_bad
from irtscots_cl.pipeline.picture import MaskChoice
from irtscots_cl.report.quality import check_facts
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.scene.model import Scene


def measure_lines(
    paths: Sequence[Path],
    scene: Scene,
    folder: Path,
    threshold: float = 0.0,
    how: str = BEST,
    *,
    manifest: Path | None = None,
    strict: bool = False,
    zernike: str = "circular",
    camera: CameraFiles | None = None,
    mask: Path | None = None,
    fiducials: Path | None = None,
    draw: bool = True,
) -> MeasuredFacts:
    """Measure a mirror from images of lines as pipeline.measure.measure does; the lines are those of the manifest.

    paths, manifest, camera, mask, fiducials, draw: as of measure_fringes. Raises as `measure` does.
    """
    nominal = scene.nominal()
    images = open_fringe_images(paths, nominal, manifest, camera)
    source = str(images.manifest.path)
    with named(source):
        recorded = recorded_images(images)
        refuse_bad(recorded.checks, strict)
    own, stack = line_stack(recorded.images, nominal, recorded.limit)
    parts = own.screen.pixels[0] // nominal.screen.pixels[0]
    if parts > 1:
        from irtscots_cl.measurement.grey_lines import sharp_lines  # few scans have lines within pixels

        stack = sharp_lines(stack, Setup(own), parts, BEST)
    orientation = nominal.camera.detector.orientation
    choice = MaskChoice.of(mask, fiducials, nominal, orientation)
    if recorded.bad is not None:
        good = ~upright(recorded.bad, orientation)
        choice = replace(choice, use=good if choice.use is None else choice.use & good)
    facts = measure(
        stack, own, folder, threshold, how, strict=strict, source=source, zernike=zernike, choice=choice, draw=draw
    )  # fmt: skip
    recorded.add_facts(facts)
    facts["checks"] = check_facts(recorded.checks) + facts["checks"]
    return facts
