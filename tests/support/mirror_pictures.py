"""Pictures of mirrors with soft edges, whose outline and marks are known to a fraction of a pixel."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from irtscots_cl.measurement.rim_curve import RimCurve

PARTS = 8  # of a pixel, each way


def share(shape, inside) -> np.ndarray:
    """Share [rows, columns] of each pixel where inside(row, column) holds."""
    step = (np.arange(PARTS) + 0.5) / PARTS - 0.5
    row, column = np.mgrid[: shape[0], : shape[1]].astype(float)
    return np.mean([inside(row + down, column + right) for down in step for right in step], axis=0)


def disk(shape, centre, radius, hole=0.0, hole_centre=None) -> np.ndarray:
    """Share of each pixel on a disk with a hole; lengths in pixels."""
    at = centre if hole_centre is None else hole_centre

    def inside(row, column):
        outer = np.hypot(row - centre[0], column - centre[1]) <= radius
        return outer & (np.hypot(row - at[0], column - at[1]) >= hole)

    return share(shape, inside)


def circle(centre, radius, hole=False) -> RimCurve:
    turn = 2 * np.pi * np.arange(2048) / 2048
    return RimCurve(np.stack([centre[0] + radius * np.sin(turn), centre[1] + radius * np.cos(turn)], -1), hole)


def picture(on_mirror, noise=1.0, seed=0, *, blur=0.5, light=100.0, dark=10.0, gradient=0.3, photons=0.0):
    """Counts of a picture with that share of mirror in each pixel.

    gradient: share by which the light falls from left to right, half as much from bottom to top. photons: variance of
    the noise per count, beside noise^2.
    """
    rows, columns = on_mirror.shape
    row, column = np.mgrid[:rows, :columns]
    clean = dark + light * on_mirror * (1 - gradient * column / columns) * (1 - gradient / 2 * row / rows)
    clean = gaussian_filter(clean, blur) if blur else clean
    return clean + np.sqrt(noise**2 + photons * clean) * np.random.default_rng(seed).standard_normal(clean.shape)
