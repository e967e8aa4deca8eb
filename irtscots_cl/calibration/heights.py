"""What a calibration is worth in nm: heights before and after it, and what its covariance leaves in them.

A height map follows from places on the screen by triangulation and integration, as in measurement.reconstruction. It is
linear in small changes, so that maps of the unknowns, of noise and of mirror terms can be added up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.calibration.measured import Measurement
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.maths.integration import integrate
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.surface_heights import surface_of, triangulated
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.model import Scene

MOST_NODES = 40_000  # of a height map: larger images are thinned, since what the unknowns do is smooth
STEP_MM = 1e-3  # on the screen, for derivatives
TERMS = tuple(range(4, 16))  # Noll terms that are stated: up to radial order 4


@dataclass(frozen=True)
class HeightGrid:
    """Every step-th pixel [r, c] of a measurement, in a scene.

    chosen: [m] which of the measurement's pixels. mirror_mm, landing_mm: places (x, y) on the mirror and (u, v)
    [2, r, c] on the scene's screen that its design has for them. mask: those to be used. told_from_mm: [r, c] height of
    the believed design, from which heights are told.
    """

    measurement: Measurement
    chief: ChiefRays
    step: int
    chosen: IntArray = field(repr=False)
    mirror_mm: FloatArray = field(repr=False)
    landing_mm: FloatArray = field(repr=False)
    mask: BoolArray = field(repr=False)
    told_from_mm: FloatArray = field(repr=False)

    @classmethod
    def of(cls, measurement: Measurement, scene: Scene, used: BoolArray) -> HeightGrid:
        """used: [n] of the measurement's pixels. The scene's mirror is the design, without its Zernike terms."""
        chief = ChiefRays(scene.nominal())
        times = max(math.ceil(math.sqrt(used.sum() / MOST_NODES)), 1)
        step, (row, column) = times * measurement.every, measurement.place_of()
        on_grid = [(place // measurement.every) % times == times // 2 for place in (row, column)]
        chosen = np.flatnonzero(on_grid[0] & on_grid[1] & used)
        points, u, v = chief.reverse(row[chosen], column[chosen])
        mirror = np.stack([points[:, 0], points[:, 1]]) + measurement.mirror_offsets_mm[:, chosen]
        landing = np.stack([u, v]) + measurement.offsets_mm[:, chosen]
        good = np.isfinite(mirror).all(0) & np.isfinite(landing).all(0)
        chosen, mirror, landing = chosen[good], mirror[:, good], landing[:, good]
        told_from = ChiefRays(measurement.scene.nominal()).surface.sag(*mirror)
        maps = _on_grid(measurement, step, chosen, np.stack([*mirror, *landing, told_from]))
        return cls(measurement, chief, step, chosen, maps[:2], maps[2:4], np.isfinite(maps[4]), maps[4])

    def maps(self, values: FloatArray) -> FloatArray:
        """Values [..., m] of the chosen pixels as maps [..., r, c]; NaN elsewhere."""
        return _on_grid(self.measurement, self.step, self.chosen, values)

    def heights(self, places_mm: FloatArray) -> FloatArray:
        """Height [..., r, c] in mm, above told_from_mm that explains places [2, ..., r, c] on the believed grid."""
        u, v = self._own_grid(places_mm)
        x, y = self.mirror_mm
        _, _, deviation, _ = surface_of(
            self.chief, (x, y), (self.landing_mm[0], self.landing_mm[1]), self.mask, (u, v), "cubic", True
        )
        found: FloatArray = deviation + (self.chief.surface.sag(x, y) - self.told_from_mm)
        return found

    def slopes(self, places_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Slopes [r, c] beyond the design's that explain places [2, r, c] on the believed grid."""
        x, y = self.mirror_mm
        design = self.chief.surface.sag(x, y)
        there, own = (
            triangulated(self.chief, x, y, design, u, v) for u, v in (self._own_grid(places_mm), self.landing_mm)
        )
        return there[0] - own[0], there[1] - own[1]

    def _own_grid(self, places_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places of the believed screen's grid on that of this scene's, of the same pixels."""
        screen, believed = self.chief.scene.screen, self.measurement.scene.screen
        axes = zip(places_mm, screen.centre_offset_mm, screen.pitch_xy_mm, believed.pitch_xy_mm, strict=True)
        u, v = ((place - middle) * (own / there) + middle for place, middle, own, there in axes)
        return u, v

    def noise_heights(self, noise_mm: FloatArray) -> FloatArray:
        """Heights [draws, r, c] that noise [draws, 2, m] of the chosen pixels' places makes.

        Noise is too small for its height to move the mirror points.
        """
        design, step, (x, y) = self.landing_mm, STEP_MM, self.mirror_mm
        by_place = [
            np.stack([(a - b) / (2 * step) for a, b in zip(self.slopes(design + move), self.slopes(design - move),
                                                           strict=True)])
            for move in (step * np.eye(2)[:, :, None, None])
        ]  # fmt: skip
        u, v = np.moveaxis(self.maps(noise_mm), 1, 0)
        slope_x, slope_y = (np.where(self.mask, by_u * u + by_v * v, 0.0) for by_u, by_v in zip(*by_place, strict=True))
        found: FloatArray = integrate(x, y, slope_x, slope_y, self.mask, "cubic").z_mm
        return found

    def without(self, heights: FloatArray, terms: str) -> FloatArray:
        """Heights [..., r, c] without their least-squares fit of "piston_tilt" or "piston_tilt_power"."""
        x, y = (values[self.mask] / self.chief.surface.aperture_radius_mm for values in self.mirror_mm)
        basis = np.stack([np.ones_like(x), x, y, x * x + y * y], -1)[:, : 3 + terms.endswith("power")]
        basis = np.linalg.qr(basis)[0]
        found = np.full(heights.shape, np.nan)
        inside = heights[..., self.mask]
        found[..., self.mask] = inside - (inside @ basis) @ basis.T
        return found

    def coefficients(self, heights: FloatArray) -> FloatArray:
        """Zernike terms TERMS [..., terms] of heights [..., r, c] in their unit, fitted with piston and tilt."""
        radius = self.chief.surface.aperture_radius_mm
        x, y = (values[self.mask] / radius for values in self.mirror_mm)
        basis = np.stack([zernike(noll, x, y) for noll in (1, 2, 3, *TERMS)], -1)
        flat = heights[..., self.mask].reshape(-1, len(x))
        found = np.asarray(np.linalg.lstsq(basis, flat.T)[0][3:].T, np.float64)
        return found.reshape(*heights.shape[:-2], len(TERMS))


def _on_grid(measurement: Measurement, step: int, chosen: IntArray, values: FloatArray) -> FloatArray:
    row, column = measurement.place_of(chosen)
    rows, columns = (-(-count // step) for count in measurement.shape)
    maps = np.full((*values.shape[:-1], rows, columns), np.nan)
    maps[..., row // step, column // step] = values
    return maps
