"""The edge of a mirror as closed curves, for plots and for finding it in a picture. Frame: the mirror's x, y, in mm."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.surface import Surface

GRID = 512  # points along the diameter where the edge is looked for: corners are cut by a two-thousandth of it
STEPS = 3  # from a curve near the edge to the edge


def edge_curves(surface: Surface, points: int = 2048) -> list[tuple[FloatArray, bool]]:
    """Closed curves [points, 2] along the edge of a surface's aperture, and whether each is a hole's; longest first.

    Points lie at equal steps along a curve, but for what rounding a corner takes. Of a picture they follow its pixels.
    """
    if surface.outline is None:
        radii = [(surface.aperture_radius_mm, False), (surface.obscuration_radius_mm, True)]
        return [(_circle(radius, points), hole) for radius, hole in radii if radius > 0]
    from skimage.measure import find_contours  # imported late: few mirrors are no disks

    reach = 1.01 * surface.aperture_radius_mm
    place = np.linspace(-reach, reach, GRID)
    depth = surface.depth(*np.meshgrid(place, place))[0]
    curves = []
    for contour in find_contours(depth, 0.0):
        at = (contour[:-1, ::-1] / (GRID - 1) * 2 - 1) * reach
        if len(at) > 3:
            curve = _onto_edge(surface, _at_equal_steps(at, points))
            curves.append((curve, _is_hole(surface, curve)))
    return sorted(curves, key=lambda found: -_length(found[0]))


def _circle(radius_mm: float, points: int) -> FloatArray:
    turn = 2 * np.pi * np.arange(points) / points
    return radius_mm * np.stack([np.cos(turn), np.sin(turn)], -1)


def _length(curve: FloatArray) -> float:
    return float(np.linalg.norm(np.roll(curve, -1, axis=0) - curve, axis=1).sum())


def _at_equal_steps(curve: FloatArray, points: int) -> FloatArray:
    closed = np.concatenate([curve, curve[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    place = along[-1] * np.arange(points) / points
    return np.stack([np.interp(place, along, closed[:, k]) for k in range(2)], -1)


def _onto_edge(surface: Surface, curve: FloatArray) -> FloatArray:
    for _ in range(STEPS):
        depth, toward_x, toward_y = surface.depth(*curve.T)
        curve = curve - depth[:, None] * np.stack([toward_x, toward_y], -1)
    return curve


def _is_hole(surface: Surface, curve: FloatArray) -> bool:
    """Whether the mirror lies around a curve: it turns clockwise if the mirror is to its left."""
    (x, y), (x1, y1) = curve.T, np.roll(curve, -1, axis=0).T
    area = (x * y1 - x1 * y).sum()
    ahead = np.roll(curve, -1, axis=0) - curve
    step = 2 * surface.aperture_radius_mm / GRID
    left = np.stack([-ahead[:, 1], ahead[:, 0]], -1)
    left /= np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-300)
    to_left = (curve + ahead / 2 + step * left).T
    return bool((np.mean(surface.contains(*to_left)) > 0.5) != (area > 0))
