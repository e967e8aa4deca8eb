"""A camera between its detector's pixels and directions in object space, in float64.

Pixels are those of the upright grid: rows grow along the camera's +y, columns along its +x. An image point (x, y) is in
mm at the image distance, of the perfect lens: a ray through the point (a, b) of the aperture, from its centre, has the
slopes a / focus - x / image distance, b / focus - y / image distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths import lens_distortion
from irtscots_cl.maths.frame import Frame
from irtscots_cl.scene.instrument import Camera
from irtscots_cl.system import interruption

PRECISION = 1e-13  # normalised coordinates, where the inversion of the distortion ends: 1e-10 of a pixel and less
MAX_NEWTON_STEPS = 30


def camera_frame(camera: Camera) -> Frame:
    """The camera's frame: origin at the aperture's centre."""
    return Frame.looking(camera.position_mm, camera.look_at_mm, np.radians(camera.roll_deg))


@dataclass(frozen=True)
class CameraModel:
    """pitch_mm: (x, y) at the image distance: that over the focal lengths in pixels. centre: (row, column) of the
    principal point. shift: (x, y) from the lens's axis to the aperture's centre over the distance in focus. distortion:
    the eight coefficients of maths.lens_distortion for y upwards, or () without any.
    """

    pitch_mm: tuple[float, float]
    centre: tuple[float, float]
    image_distance_mm: float
    shift: tuple[float, float] = (0.0, 0.0)
    distortion: tuple[float, ...] = ()

    @classmethod
    def of(cls, camera: Camera) -> CameraModel:
        columns, rows = camera.detector.pixels
        pitch, distance = camera.detector.pitch_mm, camera.image_distance_mm
        shift = (camera.aperture_offset_mm[0] / camera.focus_mm, camera.aperture_offset_mm[1] / camera.focus_mm)
        centre, given = ((rows - 1) / 2, (columns - 1) / 2), camera.intrinsics
        if given is None:
            return cls((pitch, pitch), centre, distance, shift)
        from irtscots_cl.scene.camera_intrinsics import picture_size  # imported late: few scenes have the table

        binning, size = given.binning, picture_size(given, camera.detector.pixels)
        middle = given.principal_point_px or ((size[0] - 1) / 2, (size[1] - 1) / 2)
        column, row = ((m - roi + 0.5) / b - 0.5 for m, roi, b in zip(middle, given.roi_px, binning, strict=True))
        pitches = tuple(
            distance * b / f if f is not None else pitch for f, b in zip((given.fx, given.fy), binning, strict=True)
        )
        distortion = lens_distortion.flipped(given.distortion) if given.is_distorted else ()
        return cls((pitches[0], pitches[1]), (rows - 1 - row, column), distance, shift, distortion)

    @property
    def is_distorted(self) -> bool:
        return bool(self.distortion)

    @property
    def pixel_area_mm2(self) -> float:
        """Area of a pixel's image by the perfect lens, on its axis."""
        return self.pitch_mm[0] * self.pitch_mm[1]

    def image_point(self, row, column) -> tuple[np.ndarray, np.ndarray]:
        """Image points (x, y) of the perfect lens in mm at fractional pixels, seen from the aperture's centre."""
        x = (np.asarray(column) - self.centre[1]) * self.pitch_mm[0]
        y = (np.asarray(row) - self.centre[0]) * self.pitch_mm[1]
        if self.distortion:
            x, y = (v * self.image_distance_mm for v in self._undistorted(*self._normalised(x, y)))
        if any(self.shift):
            x, y = x - self.shift[0] * self.image_distance_mm, y - self.shift[1] * self.image_distance_mm
        return x, y

    def pixel(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray]:
        """Fractional (row, column) of image points: the inverse of image_point."""
        x, y = (v + s * self.image_distance_mm for v, s in zip((x_mm, y_mm), self.shift, strict=True))
        if self.distortion:
            distorted = lens_distortion.distort(*self._normalised(x, y), self.distortion)
            x, y = (v * self.image_distance_mm for v in distorted)
        return y / self.pitch_mm[1] + self.centre[0], x / self.pitch_mm[0] + self.centre[1]

    def stretch(self, row, column) -> np.ndarray:
        """Area of a pixel's image by the perfect lens over pixel_area_mm2: 1 without distortion."""
        if not self.distortion:
            return np.ones(np.broadcast_shapes(np.shape(row), np.shape(column)))
        x, y = self.image_point(row, column)
        x, y = self._normalised(x, y)
        xx, xy, yy = lens_distortion.distortion_matrix(x + self.shift[0], y + self.shift[1], self.distortion)
        return 1.0 / (xx * yy - xy * xy)

    def _normalised(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        return x / self.image_distance_mm, y / self.image_distance_mm

    def _undistorted(self, goal_x, goal_y) -> tuple[np.ndarray, np.ndarray]:
        """The normalised points that the lens moves to the goals, by Newton's method; NaN where it finds none."""
        goal_x, goal_y = (np.array(v, float) for v in np.broadcast_arrays(goal_x, goal_y))
        x, y = goal_x.copy(), goal_y.copy()
        with np.errstate(all="ignore"):  # far outside the image there may be no such point
            for _ in range(MAX_NEWTON_STEPS):
                interruption.check()
                next_x, next_y, determinant = lens_distortion.towards(x, y, goal_x, goal_y, self.distortion)
                moved = np.abs(next_x - x) + np.abs(next_y - y)
                x, y = next_x, next_y
                if not np.any(moved > PRECISION):
                    break
            # beyond where the image folds another branch may lead to the goal: that is no direction of a real ray
            lost = ~((moved <= PRECISION * 1e3) & (determinant > 0) & (x * goal_x + y * goal_y >= 0))
        return np.where(lost, np.nan, x), np.where(lost, np.nan, y)
