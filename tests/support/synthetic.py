"""Images without noise and without a device: float64 chief rays through many points of pixel and aperture."""

from __future__ import annotations

import dataclasses
from functools import lru_cache

import numpy as np
from scenes import coarse

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.model import Scene

SUBPIXELS = 8  # per axis
APERTURE_POINTS = 6  # on the circle that halves the aperture's area: exact for the mean of a quadratic


def small_scene(name: str = "sphere-deviated", pixels: int = 41) -> Scene:
    """A preset with fewer and larger detector pixels behind the same optics."""
    return coarse(name, pixels)


@lru_cache
def noise_free_stack(scene: Scene) -> ImageStack:
    """Line-scan images of the scene's true mirror whose centroids are the means of the rays' landing points.

    Each ray gives its light to the two lines nearest to it, in the proportion that keeps its place: sampling
    by lines costs no accuracy. A ray beside the screen loses the share of the lines that are not there.
    Flux in arbitrary units, 1 for a pixel that sees nothing but the mirror.
    """
    chief = ChiefRays(scene)
    rows, columns = chief.shape
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    step = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
    step_row, step_column = (s.ravel() for s in np.meshgrid(step, step, indexing="ij"))
    angle = np.arange(APERTURE_POINTS) * 2 * np.pi / APERTURE_POINTS
    radius = scene.camera.aperture_diameter_mm / 2 / np.sqrt(2.0)
    points, u, v = chief.reverse(
        row[..., None, None] + step_row[:, None],
        column[..., None, None] + step_column[:, None],
        radius * np.cos(angle),
        radius * np.sin(angle),
    )
    on = chief.surface.contains(points[..., 0], points[..., 1])
    weight = (on / (SUBPIXELS**2 * APERTURE_POINTS)).reshape(rows * columns, -1)
    return ImageStack(
        *(_scan(scene, axis, landing.reshape(weight.shape), weight) for axis, landing in (("x", u), ("y", v)))
    )


def _scan(scene: Scene, axis: str, landing_mm: np.ndarray, weight: np.ndarray) -> Scan:
    positions = LineScan(scene).positions_mm(axis)
    place = (landing_mm - positions[0]) / scene.screen.pitch_mm
    below = np.floor(place).astype(int)
    flux = np.zeros((len(weight), len(positions)))
    pixel = np.broadcast_to(np.arange(len(weight))[:, None], weight.shape)
    for line, share in ((below, 1.0 - (place - below)), (below + 1, place - below)):
        kept = (line >= 0) & (line < len(positions)) & (weight > 0)
        np.add.at(flux, (pixel[kept], line[kept]), (weight * share)[kept])
    columns, rows = scene.camera.detector.pixels
    return Scan(
        axis,
        positions,
        (rows, columns),
        np.arange(rows * columns),
        np.zeros(rows * columns, np.int64),
        flux[None],
        np.ones(1),
        np.full(rows * columns, np.nan),
    )


def with_replicates(stack: ImageStack, replicates: int, noise: float, seed: int = 0) -> ImageStack:
    """The stack with Gaussian noise of `noise` x the light of each sample, independent in every replicate."""
    random = np.random.default_rng(seed)
    scans = []
    for scan in (stack.x, stack.y):
        flux = scan.flux_w * (1.0 + noise * random.standard_normal((replicates, *scan.flux_w.shape[1:])))
        scans.append(dataclasses.replace(scan, flux_w=flux, weights=np.ones(replicates)))
    return ImageStack(*scans)
