"""What each pixel sees of the screen, as a sample of places, and as shares of the lines that a scan lights.

The sample is the pixels' local maps (optics/pixel/ray_map.py) at the points of one Sobol sequence over footprint and
aperture, the same for all pixels, so that neighbours that see the same part of the screen see the same of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, vstack
from scipy.stats import qmc

from irtscots_cl.calibration.seen_pixels import SeenPixels
from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.optics.pixel.ray_map import RayMap
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.instrument import Screen

POINTS = 2**10  # of a pixel: shares of lines to a few per cent, centroids to 1e-3 of the light's width
AT_ONCE = 2**12  # pixels
LINEAR = ("s", "t", "a", "b")
VARIANCES = np.array([1 / 3, 1 / 3, 1 / 4, 1 / 4])  # of them
SQUARES = ("ss", "tt", "aa", "bb", "st", "sa", "sb", "ta", "tb", "ab")


@dataclass(frozen=True)
class LineShares:
    """Light curves of n pixels along one axis of the screen.

    first: [n] the first line of each window, which may lie beyond the screen. share: [n, lines] of the light from the
    screen that a pixel sees, in each line; the sum is 1. away_mm: [n, lines] the lines' places less their centroid.
    on_screen: [n] share of a pixel's light that comes from the screen.
    """

    first: IntArray
    share: FloatArray = field(repr=False)
    away_mm: FloatArray = field(repr=False)
    on_screen: FloatArray = field(repr=False)

    @property
    def lines(self) -> IntArray:
        """Numbers [n, lines] of the lines."""
        return self.first[:, None] + np.arange(self.share.shape[1])


@dataclass(frozen=True)
class LightSample:
    """The light of n pixels."""

    screen: Screen
    maps: RayMap = field(repr=False)

    @classmethod
    def of(cls, setup: Setup, seen: SeenPixels) -> LightSample:
        return cls(setup.scene.screen, RayMap.of(setup.chief_rays, *seen.pixels))

    @cached_property
    def covariance_mm2(self) -> FloatArray:
        """Covariance [2, 2, n] of the places of the screen's pixels that one pixel of the detector sees.

        Of its light over its footprint and the camera's aperture, by the local map's linear part (a pixel is uniform
        over (-1, 1) in s and t, the aperture a uniform disk), and of the places within one pixel of the screen.
        """
        slopes = np.stack([[self.maps.term(output, key) for output in "uv"] for key in LINEAR])
        found: FloatArray = np.einsum("k,kin,kjn->ijn", VARIANCES, slopes, slopes)
        return found + np.diag(np.square(self.screen.pitch_xy_mm) / 12)[..., None]

    @cached_property
    def covariance_with_pixel_mm(self) -> FloatArray:
        """Covariance [2, 2, n] of the places (u, v) with the point (column, row) of the pixel, in pixels, at which
        their light lands: by the local map's linear part."""
        slopes = np.stack([[self.maps.term(output, key) for key in LINEAR[:2]] for output in "uv"])
        found: FloatArray = slopes * VARIANCES[:2, None] / 2  # s and t are in half pixels
        return found

    @cached_property
    def _monomials(self) -> FloatArray:
        """[14, POINTS] of the local maps, at points of footprint and aperture."""
        unit = qmc.Sobol(4, scramble=True, rng=np.random.default_rng(0)).random(POINTS)
        radius, angle = np.sqrt(unit[:, 2]), 2 * np.pi * unit[:, 3]
        at = {
            "s": 2 * unit[:, 0] - 1,
            "t": 2 * unit[:, 1] - 1,
            "a": radius * np.cos(angle),
            "b": radius * np.sin(angle),
        }
        return np.stack([np.prod([at[key] for key in name], axis=0) for name in (*LINEAR, *SQUARES)])

    def places_mm(self, axis: int, chosen: slice = slice(None)) -> FloatArray:
        """Places [k, POINTS] along the screen's x (0) or y (1) of some of the pixels."""
        output = "uv"[axis]
        terms = np.stack([self.maps.term(output, name)[chosen] for name in (*LINEAR, *SQUARES)], -1)
        found: FloatArray = self.maps.term(output)[chosen, None] + terms @ self._monomials
        return found

    def pixels(self, axis: int, chosen: slice = slice(None)) -> IntArray:
        """Columns or rows [k, POINTS] of the screen's pixels at the places, counted on beyond the screen."""
        count, pitch = self.screen.pixels[axis], self.screen.pitch_xy_mm[axis]
        at = (self.places_mm(axis, chosen) - self.screen.centre_offset_mm[axis]) / pitch + count / 2
        found: IntArray = np.floor(at).astype(np.intp)
        return found

    @cached_property
    def of_pixels(self) -> csr_matrix:
        """Shares [n, rows * columns] of the light that each pixel sees, by the screen's pixels; each sum is 1."""
        columns, rows = self.screen.pixels
        count, parts = len(self.maps.row), []
        for first in range(0, count, AT_ONCE):
            part = slice(first, first + AT_ONCE)
            column, row = self.pixels(0, part), self.pixels(1, part)
            on_screen = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
            share = on_screen / np.maximum(on_screen.sum(-1, keepdims=True), 1)
            of = np.broadcast_to(np.arange(len(row))[:, None], row.shape)[on_screen]
            at = (row * columns + column)[on_screen]
            parts.append(coo_matrix((share[on_screen], (of, at)), (len(row), rows * columns)).tocsr())
        return vstack(parts, format="csr")

    @cached_property
    def shares(self) -> tuple[LineShares, LineShares]:
        """Along x and y."""
        return self._shares(0), self._shares(1)

    def _shares(self, axis: int) -> LineShares:
        screen, pixels = self.screen, self.pixels(axis)
        n = len(pixels)
        first = pixels.min(1) - 1  # an empty line on either side
        width = int((pixels.max(1) - first).max()) + 2
        flat = (pixels - first[:, None]) + np.arange(n)[:, None] * width
        lines = first[:, None] + np.arange(width)
        lit = np.bincount(flat.ravel(), minlength=n * width).reshape(n, width)
        lit = np.where((lines >= 0) & (lines < screen.pixels[axis]), lit, 0)
        share = lit / np.maximum(lit.sum(-1, keepdims=True), 1)
        place = (lines + 0.5 - screen.pixels[axis] / 2) * screen.pitch_xy_mm[axis]
        away = place - np.sum(place * share, -1, keepdims=True)
        return LineShares(first, share, away, lit.sum(-1) / POINTS)
