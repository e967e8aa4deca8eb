"""Screen, camera and detector of a scene."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, model_validator

from irtscots_cl.scene.validation import (
    Degrees,
    Fraction,
    OffsetMm,
    OptionalMm,
    PitchMm,
    PixelGrid,
    PointMm,
    PositiveMm,
    Radiance,
    checked,
    refuse,
)

MAX_SCREEN_PIXELS = 2**26
MAX_DETECTOR_PIXELS = 2**24
MAX_VIEW_RAD = math.radians(89.0)
# How an image lies in a file, seen against the upright one: rows along the camera's +y, columns along its +x.
Orientation = Literal[
    "upright", "rows-reversed", "columns-reversed", "half-turn",
    "transposed", "quarter-turn", "three-quarter-turn", "transposed-half-turn",
]  # fmt: skip
ORIENTATIONS: tuple[str, ...] = get_args(Orientation)


def _check_direction(device: Screen | Camera) -> None:
    """Raise SceneError unless the device looks in some direction."""
    if device.position_mm == device.look_at_mm:
        refuse(("position_mm",), device.position_mm, "differ from look_at_mm, for a direction to look in")


def _check_pixels(pixels: tuple[int, int], most: int) -> None:
    if pixels[0] * pixels[1] > most:
        refuse(("pixels",), pixels, f"be at most {most} pixels in all")


@checked("screen")
class Screen:
    """A Lambertian screen; `centre_offset_mm` moves its grid of pixels in the screen's own x, y.

    pitch_mm: of square pixels, or (x, y). clocking_deg: turn of x and y about the screen's z, from x towards y.
    response: a screen_response.ScreenResponse, or None for an even and steady screen. shape, cover_glass, lines: of
    screen_shape, or None for a flat screen, a bare one, and a scan of every single line.
    """

    position_mm: PointMm
    pixels: PixelGrid
    pitch_mm: PitchMm
    look_at_mm: PointMm = (0.0, 0.0, 0.0)
    radiance: Radiance = 1.0
    emission: Annotated[Literal["lambertian"], Field(description="'lambertian'")] = "lambertian"
    centre_offset_mm: OffsetMm = (0.0, 0.0)
    response: Annotated[Any, Field(description="a table [screen.response]")] = None
    clocking_deg: Degrees = 0.0
    shape: Annotated[Any, Field(description="a table [screen.shape]")] = None
    cover_glass: Annotated[Any, Field(description="a table [screen.cover_glass]")] = None
    lines: Annotated[Any, Field(description="a table [screen.lines]")] = None

    @property
    def pitch_xy_mm(self) -> tuple[float, float]:
        """Pitch along x and along y in mm."""
        return self.pitch_mm if isinstance(self.pitch_mm, tuple) else (self.pitch_mm, self.pitch_mm)

    @property
    def pixel_area_mm2(self) -> float:
        """Area of a pixel on the grid in mm^2."""
        return self.pitch_xy_mm[0] * self.pitch_xy_mm[1]

    def places_mm(self, column: Any, row: Any) -> tuple[Any, Any]:
        """Places (u, v) on the grid in mm of fractional pixel numbers; numbers or arrays."""
        axes = zip((column, row), self.pixels, self.pitch_xy_mm, self.centre_offset_mm, strict=True)
        u, v = ((number - (count - 1) / 2) * pitch + offset for number, count, pitch, offset in axes)
        return u, v

    def pixels_at(self, u_mm: Any, v_mm: Any) -> tuple[Any, Any]:
        """Fractional (column, row) of places on the grid: what places_mm undoes."""
        axes = zip((u_mm, v_mm), self.pixels, self.pitch_xy_mm, self.centre_offset_mm, strict=True)
        column, row = ((place - offset) / pitch + (count - 1) / 2 for place, count, pitch, offset in axes)
        return column, row

    @property
    def is_plain(self) -> bool:
        """Whether the pixels lie in a plane, bare."""
        return self.shape is None and self.cover_glass is None

    @model_validator(mode="after")
    def _check(self) -> Screen:
        _check_pixels(self.pixels, MAX_SCREEN_PIXELS)
        if self.response is not None:
            self._check_response()
        for key, mark in (("shape", "sag_mm"), ("cover_glass", "thickness_mm"), ("lines", "step_px")):
            if getattr(self, key) is not None and not hasattr(getattr(self, key), mark):
                refuse((key,), getattr(self, key), "be of a class in irtscots_cl.scene.screen_shape")
        if self.lines is not None:
            from irtscots_cl.scene.screen_shape import check_lines  # imported late: few scenes have a table of lines

            check_lines(self.lines, self.pixels)
        _check_direction(self)
        return self

    def _check_response(self) -> None:
        if not hasattr(self.response, "needs_map"):
            refuse(("response",), self.response, "be a ScreenResponse of irtscots_cl.scene.screen_response")
        columns, rows = self.pixels
        for key, count in (("dead_columns", columns), ("dead_rows", rows)):
            if max(getattr(self.response, key), default=0) >= count:
                value = max(getattr(self.response, key))
                refuse(("response", key), value, f"be below {count}, the number of the screen's lines")
        for pixel in self.response.dead_pixels:
            if pixel[0] >= columns or pixel[1] >= rows:
                refuse(("response", "dead_pixels"), pixel, f"lie on the screen of {columns} columns, {rows} rows")


@checked("detector")
class Detector:
    """A grid of square pixels behind the lens.

    orientation: how the files of its images lie: what must be undone to have rows grow along the camera's +y and
    columns along its +x; one of ORIENTATIONS. noise: a detector_noise.DetectorNoise, or None for images of the flux,
    without noise.
    """

    pixels: PixelGrid
    pitch_mm: PositiveMm
    noise: Annotated[Any, Field(description="a table [camera.detector.noise]")] = None
    orientation: Annotated[Orientation, Field(description=f"one of {', '.join(ORIENTATIONS)}")] = "upright"

    @model_validator(mode="after")
    def _check(self) -> Detector:
        _check_pixels(self.pixels, MAX_DETECTOR_PIXELS)
        if self.noise is not None and not hasattr(self.noise, "is_nonlinear"):
            refuse(("noise",), self.noise, "be a DetectorNoise of irtscots_cl.scene.detector_noise")
        return self


@checked("camera")
class Camera:
    """An aperture at `position_mm` with a paraxial lens in it, and a detector where `focus_mm` is imaged sharply.

    roll_deg: turn of x and y about the camera's z, from x towards y. aperture_offset_mm: the aperture's centre, which
    is at position_mm, from the lens's axis. intrinsics: a camera_intrinsics.Intrinsics, or None for a lens without
    distortion whose axis meets the middle of the detector.
    lens = "elements": no lens in the aperture; the scene's elements replace it, and focal_length_mm is theirs, for the
    chief rays. detector_distance_mm: distance from the aperture to the detector, if it is not where a paraxial lens
    images `focus_mm`.
    """

    position_mm: PointMm
    aperture_diameter_mm: PositiveMm
    focal_length_mm: PositiveMm
    detector: Annotated[Detector, Field(description="a table [camera.detector]")]
    look_at_mm: PointMm = (0.0, 0.0, 0.0)
    focus_distance_mm: OptionalMm = None
    transmittance: Fraction = 1.0
    lens: Annotated[Literal["paraxial", "elements"], Field(description="paraxial or elements")] = "paraxial"
    detector_distance_mm: OptionalMm = None
    roll_deg: Degrees = 0.0
    aperture_offset_mm: OffsetMm = (0.0, 0.0)
    intrinsics: Annotated[Any, Field(description="a table [camera.intrinsics]")] = None

    @property
    def is_distorted(self) -> bool:
        return self.intrinsics is not None and self.intrinsics.is_distorted

    @property
    def focus_mm(self) -> float:
        """Distance from the lens to the plane in focus, in mm."""
        return self.focus_distance_mm or math.dist(self.position_mm, self.look_at_mm)

    @property
    def image_distance_mm(self) -> float:
        """Distance from a paraxial lens to the sharp image, in mm: 1 / (1 / focal_length_mm - 1 / focus_mm)."""
        return self.focal_length_mm / (1.0 - self.focal_length_mm / self.focus_mm)

    @model_validator(mode="after")
    def _check(self) -> Camera:
        _check_direction(self)
        if not self.focal_length_mm / self.focus_mm < 1.0:
            if self.focus_distance_mm is not None:
                must = f"be above focal_length_mm ({self.focal_length_mm!r})"
                refuse(("focus_distance_mm",), self.focus_distance_mm, must)
            must = f"be below {self.focus_mm:.10g}, the distance to look_at_mm, which is in focus"
            refuse(("focal_length_mm",), self.focal_length_mm, must)
        if self.intrinsics is not None:
            if not hasattr(self.intrinsics, "distortion"):
                refuse(("intrinsics",), self.intrinsics, "be an Intrinsics of irtscots_cl.scene.camera_intrinsics")
            from irtscots_cl.scene.camera_intrinsics import check_intrinsics  # imported late: few scenes have the table

            check_intrinsics(self.intrinsics, self.detector.pixels, self.detector.pitch_mm, self.image_distance_mm)
        return self
