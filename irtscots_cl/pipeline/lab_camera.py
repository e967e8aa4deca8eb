"""A laboratory's recorded images with what is known about its camera: calibrated frames, checks, facts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl.formats.images import FrameSource
from irtscots_cl.imaging.camera_files import SERIES, CameraFiles
from irtscots_cl.imaging.exposures import common_exposure
from irtscots_cl.imaging.fringe_images import FringeImages
from irtscots_cl.imaging.lab_frames import CameraCalibration, Frames, LabFrames, MeanFrame, camera_calibration
from irtscots_cl.maths.arrays import BoolArray
from irtscots_cl.measurement.camera_checks import camera_checks
from irtscots_cl.measurement.frame_survey import survey_frames
from irtscots_cl.measurement.fringe_frame_checks import check_frame_values
from irtscots_cl.measurement.quality import Check
from irtscots_cl.report.image_types import CameraFacts, ImageFileFacts
from irtscots_cl.report.types import MeasuredFacts


@dataclass(frozen=True)
class LabCamera:
    """frames: calibrated. checks: of the calibration. facts: for the report."""

    frames: LabFrames = field(repr=False)
    checks: list[Check]
    facts: CameraFacts

    @property
    def bad(self) -> BoolArray | None:
        """Bad pixels [rows, columns] of the images as stored."""
        return self.frames.calibration.bad


def lab_camera(
    recorded: Frames, camera: CameraFiles, saturation: float, exposures_s: Sequence[float | None] = (None,)
) -> LabCamera:
    """Calibrated frames of recorded images.

    saturation: count at which the images' samples are saturated. exposures_s: of the images that make a frame. Raises
    ValueError where the files do not fit the images or each other.
    """
    shape = np.shape(recorded[0])
    series = {name: camera.open(name) for name in SERIES}
    if isinstance(recorded, FrameSource):
        _check_bits(series, recorded)
    for name, frames in series.items():
        if frames is not None and frames.shape != shape:
            raise ValueError(
                f"{_told(name)} frames: {frames.files[0].path}: {frames.shape[1]} x {frames.shape[0]} pixels; the "
                f"images have {shape[1]} x {shape[0]}: must be equal"
            )
    flat = series["flat"]
    if flat is not None:  # whose counts may end where those of the images, in the same files, do not reach
        ceiling = min(saturation, flat.saturation, survey_frames(flat).ceiling)
    else:
        ceiling = saturation
    calibration = camera_calibration(
        **series,
        bad=camera.bad((shape[0], shape[1])),
        dark_exposure_s=camera.dark_exposure_s or common_exposure(series["dark"]),
        flat_exposure_s=camera.flat_exposure_s or common_exposure(flat),
        saturation=ceiling,
    )
    _check_offset(calibration, exposures_s)
    lab = LabFrames(recorded, calibration, saturation, tuple(exposures_s), camera.repeat_order)

    def name_of(kind: str, number: int) -> str:
        frames = series[kind.replace(" ", "_")]
        return kind if frames is None else frames.name(number)

    return LabCamera(lab, camera_checks(lab, name_of), _facts(lab))


def _told(name: str) -> str:
    return name.replace("_", " ")


def _check_bits(series: dict[str, FrameSource | None], recorded: FrameSource) -> None:
    """Refuse calibration frames whose counts are of another scale than the images'. Means in floating point may be."""
    own = recorded.files[0].bits
    for name, frames in series.items():
        bits = frames.files[0].bits if frames is not None else 0
        if frames is not None and bits and own and bits != own:
            raise ValueError(
                f"{_told(name)} frames: {frames.files[0].path}: samples of {bits} bits, the images have {own}: must be "
                "equal, or the counts have different scales"
            )


def _check_offset(known: CameraCalibration, exposures_s: Sequence[float | None]) -> None:
    """Unequal exposures are merged by their counts above the offset, which must be that of each."""
    is_known = known.bias is not None if known.dark is None else known.dark_exposure_s is not None
    if len(set(exposures_s)) > 1 and not is_known:
        raise ValueError(
            f"exposures_s = {list(exposures_s)}: unequal exposures need dark frames of a known exposure "
            "(dark_exposure_s), or bias frames"
        )


def _facts(lab: LabFrames) -> CameraFacts:
    known = lab.calibration
    means = known.means

    def medians(part: str) -> dict[str, float]:
        return {name: _median(one, part) for name, one in means.items()}

    return {
        "images_per_frame": len(lab.exposures_s),
        "exposures_s": [time for time in lab.exposures_s if time is not None],
        "averaged": {name: one.count for name, one in means.items()},
        "counts": medians("mean"),
        "standard_error": medians("error"),
        "bad_pixels": 0 if known.bad is None else int(known.bad.sum()),
        "dead_pixels": 0 if known.dead is None else int(known.dead.sum()),
    }


def _median(one: MeanFrame, part: str) -> float:
    values = getattr(one, part)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else math.nan


def image_facts(frames: FrameSource, saturation: float) -> ImageFileFacts:
    """How the images were read."""
    return {
        "frames": len(frames),
        "files": len(frames.files),
        "bits": frames.files[0].bits,
        "saturation": saturation if math.isfinite(saturation) else None,
        "notes": list(frames.notes),
    }


@dataclass(frozen=True)
class RecordedImages:
    """images: calibrated where something is known about the camera (lab). ceiling: count at which the recorded samples
    are saturated. checks: of the images by their values, and of the camera."""

    images: FringeImages
    ceiling: float
    checks: list[Check]
    lab: LabCamera | None = None

    @property
    def bad(self) -> BoolArray | None:
        """Bad pixels [rows, columns] as stored."""
        return None if self.lab is None else self.lab.bad

    @property
    def limit(self) -> float:
        """From which on samples of images.frames are saturated; in calibrated frames these are no numbers."""
        return self.ceiling if self.lab is None else math.inf

    def add_facts(self, facts: MeasuredFacts) -> None:
        """Add how the images were read, and what was known about the camera."""
        facts["images"] = image_facts(self.images.recorded, self.ceiling)
        if self.lab is not None:
            facts["camera"] = self.lab.facts


def recorded_images(images: FringeImages) -> RecordedImages:
    """Images as they were recorded, surveyed and calibrated. The ceiling is the one that was told, else the least of
    what the files say and what the images show. Raises ValueError."""
    survey = survey_frames(images.recorded)
    checks = check_frame_values(survey, images.recorded_name)
    camera, exposures_s = images.camera, images.exposures_s
    ceiling = min(images.recorded.saturation, survey.ceiling) if camera.saturation is None else camera.saturation
    if not camera.changes_frames:
        return RecordedImages(images, ceiling, checks)
    lab = lab_camera(images.recorded, camera, ceiling, exposures_s)
    return RecordedImages(replace(images, frames=lab.frames), ceiling, checks + lab.checks, lab)
