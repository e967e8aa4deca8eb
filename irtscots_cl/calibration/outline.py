"""The corners of a mirror with straight sides in the camera's picture, to fractions of a pixel."""

from __future__ import annotations

import numpy as np
from skimage.measure import find_contours

from irtscots_cl.maths.arrays import BoolArray, FloatArray

ENDS = 0.1  # of a side at each end: corners may be rounded or hidden
NEAR = 0.2  # of the mean side: points farther from a side are none of its
ROUNDS = 3  # of assigning points to sides
TRIM_ROUNDS, TRIM_PIXELS = 5, 1.0  # of fitting a line: points farther from it are left out
MIN_POINTS = 8  # of a side


def outline(signal: FloatArray, mask: BoolArray) -> FloatArray:
    """The outer edge [n, 2] (row, column) of the mask's region, where the signal [rows, columns] falls to half.

    The signal is bright inside the mask and dark around it; half of its median inside is where half of a pixel sees the
    mirror. Raises ValueError for a mask without an edge in the picture.
    """
    half = float(np.median(signal[mask])) / 2
    known = np.where(np.isfinite(signal), signal, 0.0)
    edges = [edge for edge in find_contours(known, half) if len(edge) > MIN_POINTS]
    if not edges:
        raise ValueError("the mirror's outline: no edge of the bright region lies in the picture")
    longest: FloatArray = max(edges, key=len)
    return longest


def polygon_corners(edge: FloatArray, expected: FloatArray) -> FloatArray:
    """Corners [n, 2] of the polygon that fits an edge [m, 2], near expected ones [n, 2], in their order.

    Each side is a straight line through the edge's points near it. Raises ValueError where a side has too few points.
    """
    corners = np.asarray(expected, float)
    for _ in range(ROUNDS):
        lines = [_side(edge, corners, k) for k in range(len(corners))]
        corners = np.stack([_crossing(lines[k - 1], lines[k]) for k in range(len(corners))])
    return corners


def _side(edge: FloatArray, corners: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
    """A point and the direction of the line through the edge's points between corners k and k + 1."""
    ahead = np.roll(corners, -1, axis=0)
    lengths = np.linalg.norm(ahead - corners, axis=1)
    if not lengths.min() > 0:
        raise ValueError("the mirror's outline: two of its corners lie at one place")
    along = (ahead - corners) / lengths[:, None]
    from_corner = edge[:, None] - corners
    share = np.sum(from_corner * along, -1) / lengths
    away = np.abs(from_corner[..., 0] * along[:, 1] - from_corner[..., 1] * along[:, 0])
    away = np.where((share > 0) & (share < 1), away, np.inf)
    near = away[:, k] < NEAR * lengths.mean()
    mine = near & (np.argmin(away, axis=1) == k) & (share[:, k] > ENDS) & (share[:, k] < 1 - ENDS)
    points = edge[mine]
    for _ in range(TRIM_ROUNDS):
        if len(points) < MIN_POINTS:
            raise ValueError(
                f"the mirror's outline: side {k + 1} of {len(corners)} has {len(points)} points of the edge near it; "
                f"must have {MIN_POINTS}: the facet's corners, its distance or the camera do not fit the picture"
            )
        middle = points.mean(0)
        direction = np.linalg.svd(points - middle, full_matrices=False)[2][0]
        off = np.abs((edge[mine] - middle) @ np.array([-direction[1], direction[0]]))
        points = edge[mine][off < max(TRIM_PIXELS, float(np.median(off)))]
    return middle, direction


def _crossing(one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Where two lines, each a point and a direction, cross."""
    (a, along), (b, across) = one, other
    determinant = along[0] * across[1] - along[1] * across[0]
    if abs(determinant) < 1e-6:
        raise ValueError("the mirror's outline: two neighbouring sides are parallel")
    step = ((b - a)[0] * across[1] - (b - a)[1] * across[0]) / determinant
    crossing: FloatArray = a + step * along
    return crossing
