"""Line scans with what is known about their camera: dark, bias and flat frames, bad pixels, exposures."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.maths.arrays import BoolArray
from irtscots_cl.measurement.quality import Check
from irtscots_cl.measurement.saturation import find_ceiling
from irtscots_cl.pipeline.lab_camera import lab_camera
from irtscots_cl.report.image_types import CameraFacts


@dataclass(frozen=True)
class CalibratedLines:
    """stack: calibrated. checks: of the camera. facts: for the report. bad: pixels [rows, columns] upright; None: none
    is known."""

    stack: ImageStack
    checks: list[Check]
    facts: CameraFacts
    bad: BoolArray | None

    def usable(self, use: BoolArray | None) -> BoolArray | None:
        """Those of the pixels [rows, columns] that are not bad; None: all."""
        if self.bad is None:
            return use
        return ~self.bad if use is None else use & ~self.bad


def calibrated_lines(stack: ImageStack, camera: CameraFiles, orientation: str) -> CalibratedLines:
    """A stack of whole upright images with the camera's own counts taken out.

    orientation: how the calibration frames lie in their files, as the images did. The exposures of the images
    [exposures, lines, rows, columns] are merged where their times are told (camera.exposures_s), else kept as repeats.
    Raises ValueError where the files do not fit the images.
    """
    times = camera.exposures_s or (None,)
    scans = (stack.x.of_all_lines(), stack.y.of_all_lines())
    for scan in scans:
        if camera.images_of_frame > 1 and len(scan.weights) != camera.images_of_frame:
            raise ValueError(
                f"the {scan.axis} scan has {len(scan.weights)} exposures, the camera's table tells of "
                f"{camera.images_of_frame} (repeats, exposures_s): must be equal"
            )
    saturation = min(find_ceiling(stack), *(scan.saturation_w for scan in scans))
    together = [image for scan in scans for image in _images(scan, orientation, merged=len(times) > 1)]
    lab = lab_camera(together, replace(camera, repeat_order="together"), saturation, times)
    first, made = 0, []
    for scan in scans:
        lines = len(scan.positions_mm)
        count = lines if len(times) > 1 else lines * len(scan.weights)
        frames = np.stack([lab.frames[k] for k in range(first, first + count)])
        images = upright(frames.reshape(-1, lines, *frames.shape[1:]), orientation)
        whole = Scan.from_images(scan.axis, scan.positions_mm, images, scan.line_width)
        weights = scan.weights if len(whole.weights) == len(scan.weights) else whole.weights
        made.append(replace(whole, weights=weights, unit=scan.unit))
        first += count
    bad = None if lab.bad is None else np.ascontiguousarray(upright(lab.bad, orientation))
    return CalibratedLines(ImageStack(made[0], made[1], stack.use), lab.checks, lab.facts, bad)


def _images(scan: Scan, orientation: str, merged: bool) -> list[NDArray[np.float64]]:
    """The images as stored, exposure by exposure; merged: line by line, the exposures of each following each other."""
    values = scan.flux_w.transpose(0, 2, 1).reshape(len(scan.weights), len(scan.positions_mm), *scan.shape)
    values = stored(values, orientation)
    values = values.swapaxes(0, 1) if merged else values
    return list(values.reshape(-1, *values.shape[-2:]))
