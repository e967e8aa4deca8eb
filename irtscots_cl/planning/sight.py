"""How the camera sees the mirror and where the mirror sends the camera's rays: a few hundred chief rays of a scene.

Unlike the maps of `ChiefRays` it starts from points of the mirror, so it also tells where light falls that misses the
detector or the screen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.optics.chief_rays import RIM, ChiefRays
from irtscots_cl.scene.model import Scene

RINGS, ANGLES = 12, 36  # of equal area


@dataclass(frozen=True)
class Sight:
    """Chief rays through points [n] of the mirror's aperture, evenly spread over its area.

    x_mm, y_mm: the points. row, column: where the camera images them, fractional pixels, NaN behind the camera.
    screen_row, screen_column: where their reflected rays meet the screen's grid, NaN where they do not. rim_rows,
    rim_columns [n, 8]: the same for rays through the rim of the camera's aperture.
    """

    scene: Scene
    chief: ChiefRays = field(repr=False)
    x_mm: FloatArray = field(repr=False)
    y_mm: FloatArray = field(repr=False)
    row: FloatArray = field(repr=False)
    column: FloatArray = field(repr=False)
    screen_row: FloatArray = field(repr=False)
    screen_column: FloatArray = field(repr=False)
    rim_rows: FloatArray = field(repr=False)
    rim_columns: FloatArray = field(repr=False)

    @classmethod
    def of(cls, scene: Scene) -> Sight:
        """The sight of a scene's design."""
        scene = scene.nominal()
        chief = ChiefRays(scene)
        x, y = mirror_points(scene, chief)
        row, column = chief.pixel(x, y)
        _, u, v = chief.reverse(row, column)
        a, b = (scene.camera.aperture_diameter_mm / 2 * RIM).T
        _, rim_u, rim_v = chief.reverse(row[:, None], column[:, None], a, b)
        columns, rows = scene.screen.pixels_at(u, v)
        rim_columns, rim_rows = scene.screen.pixels_at(rim_u, rim_v)
        return cls(scene, chief, x, y, row, column, rows, columns, rim_rows, rim_columns)

    @property
    def detected(self) -> BoolArray:
        """Points [n] whose images lie on the detector."""
        return _inside(self.column, self.row, self.scene.camera.detector.pixels)

    @property
    def lit(self) -> BoolArray:
        """Points [n] all of whose light, through the whole aperture, meets the screen's grid of pixels."""
        return _inside(self.rim_columns, self.rim_rows, self.scene.screen.pixels).all(-1)

    @property
    def landing(self) -> float:
        """Share of the light, of all points through all of the aperture, that meets the screen's grid of pixels."""
        return float(_inside(self.rim_columns, self.rim_rows, self.scene.screen.pixels).mean())

    @property
    def measured(self) -> float:
        """Share of the mirror's area that is on the detector and fully lit."""
        return float((self.detected & self.lit).mean())

    @property
    def image_px(self) -> tuple[float, float]:
        """Size (columns, rows) of the mirror's image in detector pixels; NaN if it is behind the camera."""
        return _extent(self.column), _extent(self.row)

    @property
    def spot_px(self) -> tuple[float, float]:
        """Size (columns, rows) in screen pixels of all the light, with the aperture's image; NaN if none arrives."""
        return _extent(self.rim_columns), _extent(self.rim_rows)

    @property
    def spot_centre_px(self) -> tuple[float, float]:
        """Middle (column, row) of the light on the screen's grid."""
        return _middle(self.rim_columns), _middle(self.rim_rows)


def mirror_points(scene: Scene, chief: ChiefRays) -> tuple[FloatArray, FloatArray]:
    """Points (x, y) of the mirror's aperture in mm, in rings of equal area; its centre where the outline has none."""
    mirror = scene.mirror
    inner, outer = mirror.obscuration_mm / 2, mirror.diameter_mm / 2
    share = (np.arange(RINGS) + 0.5) / RINGS
    radius = np.sqrt(inner**2 + share * (outer**2 - inner**2))
    turn = (np.arange(ANGLES) + 0.5 * (np.arange(RINGS)[:, None] % 2)) * (2 * math.pi / ANGLES)
    x, y = (radius[:, None] * np.cos(turn)).ravel(), (radius[:, None] * np.sin(turn)).ravel()
    on = chief.surface.contains(x, y)
    return (x[on], y[on]) if on.any() else (np.zeros(1), np.zeros(1))


def _inside(column: FloatArray, row: FloatArray, pixels: tuple[int, int]) -> BoolArray:
    columns, rows = pixels
    return (column >= -0.5) & (column <= columns - 0.5) & (row >= -0.5) & (row <= rows - 0.5)


def _extent(values: FloatArray) -> float:
    return float(np.nanmax(values) - np.nanmin(values)) if np.isfinite(values).any() else math.nan


def _middle(values: FloatArray) -> float:
    return float(np.nanmax(values) + np.nanmin(values)) / 2 if np.isfinite(values).any() else math.nan
