"""Slopes and heights of the mirror from the centroids of its light, by triangulation and integration."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.maths.integration import Integration, Islands, integrate
from irtscots_cl.maths.integration.node_graph import RESIDUAL
from irtscots_cl.measurement.slopes import deconvolve_pixel, half_vector_slopes
from irtscots_cl.optics.chief_rays import ChiefRays

Pair = tuple[FloatArray, FloatArray]  # along x and along y
MANY_VALUES = 2**18  # of maps that are computed together
OF_DIFFERENCES = 1e-7  # residual of the integration of differences between replicates, for error bars
HEIGHT_ROUNDS = 2  # slopes, height, slopes, height: a third round changes less than 0.01 nm on a deviation of 1 um


def triangulated(
    chief: ChiefRays, x_mm: FloatArray, y_mm: FloatArray, z_mm: FloatArray, u_mm: FloatArray, v_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Slopes [..., rows, columns] of the mirror at (x, y, z) that send the camera's chief rays to (u, v)."""
    points = np.stack(np.broadcast_arrays(x_mm, y_mm, z_mm), -1)
    screen = chief.screen_model.seen_from(points, u_mm, v_mm)
    return half_vector_slopes(points, screen, chief.camera_frame.position_mm)


@dataclass(frozen=True)
class _Beyond:
    """What the design's slopes are compared with. mirror: (x, y), own: slopes there, told: those that the triangulation
    gives for the design, aside: see _aside; [rows, columns] each."""

    chief: ChiefRays
    mirror: Pair
    mask: BoolArray
    method: str
    pixel_average: bool
    own: Pair
    told: Pair
    aside: Pair

    def slopes(self, deviation: FloatArray, u_mm: FloatArray, v_mm: FloatArray) -> Pair:
        """Slopes [..., rows, columns] beyond the design's of mirrors with a deviation, from centroids (u, v)."""
        surface = self.chief.surface
        x, y = (at + deviation * by for at, by in zip(self.mirror, self.aside, strict=True))
        found = triangulated(self.chief, x, y, surface.sag(x, y) + deviation, u_mm, v_mm)
        there = surface.gradient(x, y)
        extra = [found[k] - self.told[k] - (there[k] - self.own[k]) for k in range(2)]
        if not self.pixel_average:
            extra = [deconvolve_pixel(part, self.mask) for part in extra]
        return extra[0], extra[1]

    def integrated(
        self, extra: Pair, join: bool | Islands, start: FloatArray, residual: float = RESIDUAL
    ) -> Integration:
        (x, y), (p, q) = self.mirror, extra
        return integrate(x, y, p, q, self.mask, self.method, join, start=start, residual=residual)

    def whole(self, centroid: Pair) -> tuple[Pair, Integration, FloatArray]:
        """Slopes and heights of maps [..., rows, columns]; the heights with which the slopes were found."""
        deviation: FloatArray = np.zeros(centroid[0].shape)
        join: bool | Islands = True
        for _ in range(HEIGHT_ROUNDS):
            before, extra = deviation, self.slopes(deviation, *centroid)
            found = self.integrated(extra, join, before)
            deviation, join = found.z_mm, found.islands
        return extra, found, before

    def differing(self, centroid: Pair, first: tuple[Pair, Integration, FloatArray]) -> tuple[Pair, FloatArray]:
        """Slopes and deviations of maps [maps, rows, columns] that differ little from the first [rows, columns]."""
        of_first, found, before = first
        differ: FloatArray = np.zeros(centroid[0].shape)
        for _ in range(HEIGHT_ROUNDS):
            slopes = self.slopes(before + differ, *centroid)
            change = slopes[0] - of_first[0], slopes[1] - of_first[1]
            differ = self.integrated(change, found.islands, differ, residual=OF_DIFFERENCES).z_mm
        return slopes, found.z_mm + differ


def surface_of(
    chief: ChiefRays,
    mirror: Pair,
    landing: Pair,
    mask: BoolArray,
    centroid: Pair,
    method: str,
    pixel_average: bool,
    *,
    alike: bool = False,
) -> tuple[FloatArray, FloatArray, FloatArray, Islands]:
    """Slopes and deviation [..., rows, columns] from centroids (u, v) of the same shape; the islands of the first map.

    mirror: (x, y), landing: (u, v) [rows, columns] of the design. alike: of [maps, rows, columns], those but the first
    differ little from it, as those without one replicate do, and are for error bars: where they are many and large, the
    differences are integrated, and to fewer digits. Only the difference from the slopes that the same triangulation
    gives for the design is integrated. This excludes the zonal method's own error on the design surface (13 nm of power
    on the paper's sphere) and the curvature of the landing point over a footprint (41 nm of tilt on the off-axis
    preset). Eq. 3 contains the height itself, so the computed height is fed back: a pixel sees the deviating mirror
    where its ray meets it, beside (x, y), where the design has another slope.
    """
    design, own = chief.surface.sag(*mirror), chief.surface.gradient(*mirror)
    told, aside = triangulated(chief, *mirror, design, *landing), _aside(chief, mirror, design, own)
    beyond = _Beyond(chief, mirror, mask, method, pixel_average, own, told, aside)
    if not alike or centroid[0].size <= MANY_VALUES:
        extra, found, _ = beyond.whole(centroid)
        return own[0] + extra[0], own[1] + extra[1], found.z_mm, found.islands
    first = beyond.whole((centroid[0][0], centroid[1][0]))
    step = max(1, MANY_VALUES // mask.size)
    parts = [slice(k, k + step) for k in range(1, len(centroid[0]), step)]
    with ThreadPoolExecutor(2) as pool:
        others = list(pool.map(lambda part: beyond.differing((centroid[0][part], centroid[1][part]), first), parts))
    slopes = [np.concatenate([first[0][k][None], *(part[0][k] for part in others)]) for k in range(2)]
    deviation = np.concatenate([first[1].z_mm[None], *(part[1] for part in others)])
    return own[0] + slopes[0], own[1] + slopes[1], deviation, first[1].islands


def _aside(chief: ChiefRays, mirror: Pair, z_mm: FloatArray, gradient: Pair) -> Pair:
    """By how much a pixel's ray meets the mirror beside (x, y), along x and y, for each mm of deviation there."""
    x, y, z = np.moveaxis(np.stack([*mirror, z_mm], -1) - chief.camera_frame.position_mm, -1, 0)
    steepness = z - x * gradient[0] - y * gradient[1]
    return x / steepness, y / steepness
