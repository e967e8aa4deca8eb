"""Rays of detector pixels through the rim of the camera's aperture: how far a pixel's light spreads on mirror and
screen. Only of pixels near the mirror, which are few of a detector that sees past it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

RIM = np.stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)], -1)


@dataclass(frozen=True)
class ApertureRims:
    """Rays from the centres of n pixels through eight points of the aperture's rim.

    shape: (rows, columns) of the detector. pixels: [n] flat numbers, ascending. points: [n, 8, 3] where they meet the
    mirror; u, v: [n, 8] on the screen. Lengths in mm; NaN where a ray misses.
    """

    shape: tuple[int, int]
    pixels: np.ndarray
    points: np.ndarray = field(repr=False)
    u: np.ndarray = field(repr=False)
    v: np.ndarray = field(repr=False)

    def at(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mirror points [k, 8, 3] and places u, v [k, 8] of some pixels (flat numbers); NaN for one far from it."""
        if not self.pixels.size:
            return np.full((len(pixels), 8, 3), np.nan), *np.full((2, len(pixels), 8), np.nan)
        index = np.minimum(np.searchsorted(self.pixels, pixels), self.pixels.size - 1)
        found = tuple(values[index] for values in (self.points, self.u, self.v))
        for values in found:
            values[self.pixels[index] != pixels] = np.nan
        return found[0], found[1], found[2]

    @cached_property
    def blur_mm(self) -> float:
        """Largest distance along x, y or z of a ray's mirror point from the mean of its pixel's."""
        return float(np.nanmax(np.abs(self.points - self.points.mean(-2, keepdims=True)), initial=0.0))

    def half_range(self, k: int) -> np.ndarray:
        """Half of the rays' range along u (k = 0) or v (k = 1), [rows, columns]; NaN for pixels without rays."""
        place = self.u if k == 0 else self.v
        return self._on_grid((place.max(-1) - place.min(-1)) / 2)

    def half_width(self, k: int) -> np.ndarray:
        """Half-width of the aperture's image along u (k = 0) or v (k = 1) by its linear map, as half_range."""
        place = self.u if k == 0 else self.v
        return self._on_grid(np.hypot(place @ RIM[:, 0], place @ RIM[:, 1]) / (len(RIM) / 2))

    def _on_grid(self, values: np.ndarray) -> np.ndarray:
        grid = np.full(self.shape, np.nan)
        grid.flat[self.pixels] = values
        return grid
