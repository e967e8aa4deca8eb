"""A mirror from a folder of line images, their manifest and the design of its test: the line-scan measurement."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from irtscots_cl.imaging.fringe_images import open_fringe_images
from irtscots_cl.imaging.line_images import line_stack
from irtscots_cl.imaging.mask_files import read_mask
from irtscots_cl.measurement.methods import BEST
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.measure import measure
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
    saturation: float | None = None,
    mask: Path | None = None,
) -> MeasuredFacts:
    """Measure a mirror from images of lines as pipeline.measure.measure does; the lines are those of the manifest.

    paths, manifest: see open_fringe_images. saturation: None for that of the files. mask: file of the pixels that may
    be used, lying as the images do. Raises as `measure` does.
    """
    nominal = scene.nominal()
    images = open_fringe_images(paths, nominal, manifest, saturation)
    own, stack = line_stack(images, nominal, saturation)
    parts = own.screen.pixels[0] // nominal.screen.pixels[0]
    if parts > 1:
        from irtscots_cl.measurement.grey_lines import sharp_lines  # few scans have lines within pixels

        stack = sharp_lines(stack, Setup(own), parts, BEST)
    detector = nominal.camera.detector
    columns, rows = detector.pixels
    use = None if mask is None else read_mask(mask, (rows, columns), detector.orientation)
    source = str(images.manifest.path)
    return measure(stack, own, folder, threshold, how, strict=strict, source=source, zernike=zernike, use=use)
