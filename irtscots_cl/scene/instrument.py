"""Screen, camera and detector of a scene."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from irtscots_cl.scene.validation import (
    Fraction,
    OffsetMm,
    OptionalMm,
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


def _check_direction(device: Screen | Camera) -> None:
    """Raise SceneError unless the device looks in some direction."""
    if device.position_mm == device.look_at_mm:
        refuse(("position_mm",), device.position_mm, "differ from look_at_mm, for a direction to look in")


def _check_pixels(pixels: tuple[int, int], most: int) -> None:
    if pixels[0] * pixels[1] > most:
        refuse(("pixels",), pixels, f"be at most {most} pixels in all")


@checked("screen")
class Screen:
    """A Lambertian screen; `centre_offset_mm` moves its grid of square pixels in the screen's own x, y.

    response: a screen_response.ScreenResponse, or None for an even and steady screen.
    """

    position_mm: PointMm
    pixels: PixelGrid
    pitch_mm: PositiveMm
    look_at_mm: PointMm = (0.0, 0.0, 0.0)
    radiance: Radiance = 1.0
    emission: Annotated[Literal["lambertian"], Field(description="'lambertian'")] = "lambertian"
    centre_offset_mm: OffsetMm = (0.0, 0.0)
    response: Annotated[Any, Field(description="a table [screen.response]")] = None

    @model_validator(mode="after")
    def _check(self) -> Screen:
        _check_pixels(self.pixels, MAX_SCREEN_PIXELS)
        if self.response is not None:
            self._check_response()
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

    noise: a detector_noise.DetectorNoise, or None for images of the flux, without noise.
    """

    pixels: PixelGrid
    pitch_mm: PositiveMm
    noise: Annotated[Any, Field(description="a table [camera.detector.noise]")] = None

    @model_validator(mode="after")
    def _check(self) -> Detector:
        _check_pixels(self.pixels, MAX_DETECTOR_PIXELS)
        if self.noise is not None and not hasattr(self.noise, "is_nonlinear"):
            refuse(("noise",), self.noise, "be a DetectorNoise of irtscots_cl.scene.detector_noise")
        return self


@checked("camera")
class Camera:
    """An aperture at `position_mm` with a paraxial lens in it, and a detector where `focus_mm` is imaged sharply.

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
        return self
