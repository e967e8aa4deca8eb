"""A surface with a map of fine structure on top of its Zernike terms, as the camera's pixels sampled it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from irtscots_cl.maths.bicubic import BicubicSpline
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.departure import Departure, ZernikeDeparture
from irtscots_cl.optics.surface import Surface

TABLE_PIXELS = 2**16  # of a detector: with more, long Zernike series are read from a table
TABLE_TERMS = 60  # of a series: shorter ones are as fast without
TABLE_NODES = 800  # along each axis
TABLE_RADIUS = 1.03  # of the series' disk: rays need it to BEYOND of optics/surface.py
STEP = 0.05  # pixels, of the differences that give the slopes


@dataclass(frozen=True, eq=False)
class PixelMap:
    """Heights in mm on the detector's grid [rows, columns], as a cubic spline of the mirror's x, y.

    design: the chief rays of the design, which give the pixel that sees a point of the mirror.
    """

    design: ChiefRays
    coefficients: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, design: ChiefRays, height_mm: np.ndarray) -> PixelMap:
        """A map through the finite values of height_mm [rows, columns]; beyond them the nearest one counts."""
        from scipy import ndimage  # imported late: few surfaces have a map

        _, nearest = ndimage.distance_transform_edt(~np.isfinite(height_mm), return_indices=True)
        return cls(design, ndimage.spline_filter(height_mm[tuple(nearest)], order=3, mode="mirror"))

    def height(self, x_mm, y_mm) -> np.ndarray:
        """Heights in mm at points of the mirror."""
        return self._at(*self._pixel(x_mm, y_mm))

    def gradient(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray]:
        """Slopes dz/dx, dz/dy at points of the mirror."""
        row, column = self._pixel(x_mm, y_mm)
        by_row = (self._at(row + STEP, column) - self._at(row - STEP, column)) / (2 * STEP)
        by_column = (self._at(row, column + STEP) - self._at(row, column - STEP)) / (2 * STEP)
        slopes = []
        for move_x, move_y in ((1.0, 0.0), (0.0, 1.0)):  # in mm: the pixel is a smooth function of the point
            after, before = (self._pixel(x_mm + k * move_x, y_mm + k * move_y) for k in (0.5, -0.5))
            slopes.append(by_row * (after[0] - before[0]) + by_column * (after[1] - before[1]))
        return slopes[0], slopes[1]

    def _pixel(self, x_mm, y_mm) -> tuple[np.ndarray, np.ndarray]:
        """Fractional row and column of the pixel whose chief ray meets the design at a point."""
        return self.design.pixel(x_mm, y_mm)

    def _at(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        from scipy import ndimage

        place = np.nan_to_num(np.stack([row, column]))
        return ndimage.map_coordinates(self.coefficients, place, order=3, mode="nearest", prefilter=False)


@dataclass(frozen=True)
class MappedSurface(Surface):
    """A surface with a map on top. Only its slopes count for rays: its nanometres move no ray."""

    extra: PixelMap | None = None

    def _gradient(self, x_mm, y_mm, slope_x, slope_y) -> tuple[np.ndarray, np.ndarray]:
        slopes = super()._gradient(x_mm, y_mm, slope_x, slope_y)
        added = self.extra.gradient(x_mm, y_mm) if self.extra is not None else (0.0, 0.0)
        return slopes[0] + added[0], slopes[1] + added[1]


@dataclass(frozen=True)
class MappedChiefRays(ChiefRays):
    """The chief rays of a scene whose mirror has a map on top."""

    extra: PixelMap | None = None

    @cached_property
    def surface(self) -> MappedSurface:
        own = Surface.of(self.scene.mirror)
        if self.shape[0] * self.shape[1] > TABLE_PIXELS:
            own = dataclasses.replace(own, deviation=tuple(tabulated(part) for part in own.deviation))
        return MappedSurface(*(getattr(own, f.name) for f in fields(own)), self.extra)


def tabulated(departure: Departure) -> Departure:
    """A long Zernike series as a cubic spline on an even grid, which is many times faster; others as they are.

    The spline is a surface of its own, near the series to 1e-4 of its highest terms: a simulation on it lacks nothing.
    """
    if not isinstance(departure, ZernikeDeparture) or int(departure.series.count.sum()) < TABLE_TERMS:
        return departure
    from irtscots_cl.optics.height_map import MapDeparture, PlacedMap  # imported late: few detectors are that large

    reach = TABLE_RADIUS * departure.radius_mm
    axis = np.linspace(-reach, reach, TABLE_NODES)
    x, y = np.meshgrid(axis, axis)
    inward = np.minimum(1.0, reach / np.maximum(np.hypot(x, y), 1e-300))  # beyond its disk a series grows fast
    spline = BicubicSpline.through(departure.at(x * inward, y * inward)[0])
    per_mm, middle = 1.0 / (axis[1] - axis[0]), (TABLE_NODES - 1) / 2
    placed = PlacedMap(spline, ((per_mm, 0.0), (0.0, per_mm)), (middle, middle))
    return MapDeparture((placed,), departure.radius_mm)
