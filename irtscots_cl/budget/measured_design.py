"""A design's test as a function: from errors of the places that pixels see to errors of the height map.

A place is the point (u, v) of the screen that a pixel's light comes from, as its light curve's centroid or its fringes'
phase tells it. Whatever goes wrong in a test changes places; the measurement makes heights of them. Both are for the
same sample of pixels, at most 160 x 160.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from irtscots_cl.calibration.height_response import HeightResponse
from irtscots_cl.calibration.ray_changes import RayChanges, ray_changes
from irtscots_cl.calibration.seen_pixels import MOST_PER_AXIS, SeenPixels, seen_pixels
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.reconstruction import surface_of
from irtscots_cl.optics.pixel.ray_map import RayMap
from irtscots_cl.optics.setup import Setup

METHOD = "southwell"


@dataclass(frozen=True)
class MeasuredDesign:
    """A design with the n pixels on which it is judged. seen: their grid [rows, columns]."""

    setup: Setup
    seen: SeenPixels = field(repr=False)

    @classmethod
    def of(cls, setup: Setup, most_per_axis: int = MOST_PER_AXIS) -> MeasuredDesign:
        """Of a set-up's design, with so many pixels at most. Raises the errors of seen_pixels."""
        nominal = setup.nominal
        return cls(nominal, seen_pixels(nominal, most_per_axis))

    @property
    def count(self) -> int:
        """Number n of pixels."""
        return int(np.count_nonzero(self.seen.mask))

    @cached_property
    def places_mm(self) -> FloatArray:
        """Places (u, v) [2, n] of the design."""
        _, u, v = self.setup.chief_rays.reverse(*self.seen.pixels)
        return np.stack([u, v])

    @cached_property
    def response(self) -> HeightResponse:
        """The measurement as a linear map, for small changes."""
        return HeightResponse.of(self.setup, self.seen, METHOD)

    @cached_property
    def ray_changes(self) -> RayChanges:
        """Derivatives of the places by camera, screen and mirror."""
        return ray_changes(self.setup.chief_rays, *self.seen.pixels)

    @cached_property
    def light_covariance_mm2(self) -> FloatArray:
        """Covariance [2, 2, n] of the places of the screen's pixels that one pixel of the detector sees.

        Of its light over its footprint and the camera's aperture, by the local map's linear part (a pixel is uniform
        over (-1, 1) in s and t, the aperture a uniform disk), and of the places within one pixel of the screen.
        """
        maps = RayMap.of(self.setup.chief_rays, *self.seen.pixels)
        variance = {"s": 1 / 3, "t": 1 / 3, "a": 1 / 4, "b": 1 / 4}
        slopes = {key: np.stack([maps.term("u", key), maps.term("v", key)]) for key in variance}
        found: FloatArray = sum(
            np.einsum("in,jn->ijn", slopes[key], slopes[key]) * share for key, share in variance.items()
        )  # type: ignore[assignment]
        return found + np.diag(np.square(self.setup.scene.screen.pitch_xy_mm) / 12)[..., None]

    def heights_mm(self, changes_mm: FloatArray) -> FloatArray:
        """Heights [..., n] in mm that the measurement makes of places that differ by changes_mm [..., 2, n].

        As measured: triangulation, integration and the height fed back, without linearisation. Mean 0.
        """
        flat = np.asarray(changes_mm).reshape(-1, 2, self.count)
        design = self.seen.on_grid(self.places_mm)
        u, v = np.moveaxis(self.seen.on_grid(flat + self.places_mm), 1, 0)
        mirror = (self.seen.x_mm, self.seen.y_mm)
        mirror = tuple(np.where(self.seen.mask, values, np.nan) for values in mirror)
        _, _, heights, _ = surface_of(
            self.setup.chief_rays, mirror, (design[0], design[1]), self.seen.mask, (u, v), METHOD, True
        )
        inside = heights[:, self.seen.mask]
        found: FloatArray = inside - inside.mean(-1, keepdims=True)
        return found.reshape(*np.shape(changes_mm)[:-2], self.count)
