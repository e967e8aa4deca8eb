"""A design's test as a function: from errors of the places that pixels see to errors of the height map.

A place is the point (u, v) of the screen that a pixel's light comes from, as its light curve's centroid or its fringes'
phase tells it. Whatever goes wrong in a test changes places; the measurement makes heights of them. Both are for the
same sample of pixels, at most 160 x 160.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from irtscots_cl.budget.frames import Frames, FringeFrames, LineFrames
from irtscots_cl.budget.light_sample import LightSample
from irtscots_cl.budget.ray_bends import RayBends
from irtscots_cl.calibration.height_response import HeightResponse
from irtscots_cl.calibration.seen_pixels import SeenPixels, seen_pixels
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.surface_heights import surface_of
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.error_sources import Air, Budget

if TYPE_CHECKING:
    from irtscots_cl.imaging.stray_files import StrayMaps
    from irtscots_cl.scene.height_map import MirrorMap

METHOD = "southwell"
NOLLS = tuple(range(1, 16))  # Zernike terms that are stated: to radial order 4


@dataclass(frozen=True)
class MeasuredDesign:
    """A design with the n pixels on which it is judged. seen: their grid [rows, columns].

    fringes: numbers of periods over the screen and steps; None for scans of single lines. air: on the rays' way.
    maps: tables of the mirror's maps, which the design has not. stray: maps of ghosts and scattered light by kind; None
    without a file. derivatives: what sources derive from it, by key: see once.
    """

    setup: Setup
    seen: SeenPixels = field(repr=False)
    fringes: tuple[tuple[float, ...], int] | None = None
    air: Air = field(default_factory=Air)
    maps: tuple[MirrorMap, ...] = field(default=(), repr=False)
    stray: dict[str, StrayMaps] | None = field(default=None, repr=False, compare=False)
    derivatives: dict[str, FloatArray] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(
        cls, setup: Setup, fringes: tuple[tuple[float, ...], int] | None = None, air: Air | None = None
    ) -> MeasuredDesign:
        """Of a set-up's design. Raises the errors of seen_pixels."""
        nominal = setup.nominal
        return cls(nominal, seen_pixels(nominal), fringes, air or Air(), setup.scene.mirror.map)

    @classmethod
    def of_budget(cls, setup: Setup, budget: Budget) -> MeasuredDesign:
        """Of a set-up's design, with the frames, the air and the stray light of a budget.

        Raises SceneError for a file of stray light that is none of this design, and the errors of seen_pixels.
        """
        design = cls.of(setup, budget.fringes, budget.air)
        if budget.stray_light is None:
            return design
        from irtscots_cl.budget.stray_paths import with_stray  # imported late: few budgets have such a file

        return with_stray(design, budget)

    def once(self, key: str, make: Callable[[], FloatArray]) -> FloatArray:
        """What is derived from the design under a key, made when it is first asked for."""
        if key not in self.derivatives:
            self.derivatives[key] = make()
        return self.derivatives[key]

    def on(self, seen: SeenPixels) -> MeasuredDesign:
        """The same on other pixels."""
        return replace(self, seen=seen, derivatives={})

    def coarse(self, most_per_axis: int) -> MeasuredDesign:
        """The same on fewer pixels."""
        return self.on(seen_pixels(self.setup, most_per_axis))

    @property
    def count(self) -> int:
        """Number n of pixels."""
        return int(np.count_nonzero(self.seen.mask))

    @cached_property
    def zernike_basis(self) -> FloatArray:
        """Values [n, terms] of NOLLS at the pixels, on the mirror's disk."""
        seen, radius = self.seen, self.setup.chief_rays.surface.aperture_radius_mm
        x, y = seen.x_mm[seen.mask] / radius, seen.y_mm[seen.mask] / radius
        return np.stack([zernike(noll, x, y) for noll in NOLLS], -1)

    @cached_property
    def zernike_fit(self) -> FloatArray:
        """[terms, n] from heights to NOLLS, fitted together."""
        found: FloatArray = np.ascontiguousarray(np.linalg.pinv(self.zernike_basis))
        return found

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
    def light(self) -> LightSample:
        """What the pixels see of the screen."""
        return LightSample.of(self.setup, self.seen)

    @cached_property
    def bends(self) -> RayBends:
        """What bends of the chief rays on their way do to the places."""
        return RayBends.of(self.setup, self.seen)

    @cached_property
    def frames(self) -> Frames:
        """The frames of line scans, or of the fringes."""
        if self.fringes is None:
            return LineFrames(self.setup.chief_rays, self.light)
        return FringeFrames(self.setup.scene.screen, self.places_mm, *self.fringes)

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
