"""The light of one pixel of a real test, independent of the package, by brute-force quadrature.

Flux = radiance x cosine^4 x d(aperture area) x d(x) d(y) of the undistorted image plane, over aperture and pixel. Over
the pixel: Gauss's points. Over the aperture: chords along the direction in which the light moves fastest on the screen,
Gauss's points across them and along each; where a line's edge cuts a chord is solved for, so edges cost no accuracy.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre
from oracle.rig import Rig

ALONG = 9  # points of a chord: the ray map over a millimetre of aperture is nearly linear


def _weights(rig: Rig, row, column, a, b, path) -> np.ndarray:
    """Flux per area of the aperture and of the upright grid (in pixels)."""
    towards = path.mirror - path.start
    cosine = -(towards @ rig.eye.axes[2]) / np.linalg.norm(towards, axis=-1)
    scale = rig.panel.radiance * rig.eye.transmittance * rig.mirror.mirror.reflectance
    return scale * cosine**4 * rig.eye.picture_area(row, column)


def _check_inside(rig: Rig, path, axis: int) -> None:
    """Raise ValueError unless all light comes by way of the mirror from within the lines' ends."""
    if not rig.mirror.contains(path.mirror).all():
        raise ValueError("the pixel's light passes the mirror's rim")
    other = (path.v, path.u)[axis]
    half = rig.panel.size[1 - axis] * rig.panel.pitch[1 - axis] / 2
    if np.max(np.abs(other - rig.panel.offset[1 - axis])) > half:
        raise ValueError("the pixel's light passes the ends of the lines")


def _steepest(rig: Rig, row: float, column: float, axis: int) -> float:
    """Angle in the aperture's plane along which u (axis 0) or v (axis 1) grows fastest."""
    step = rig.eye.stop / 4
    a, b = np.array([step, -step, 0.0, 0.0]), np.array([0.0, 0.0, step, -step])
    path = rig.back(np.full(4, row), np.full(4, column), a, b)
    place = (path.u, path.v)[axis]
    return math.atan2(place[2] - place[3], place[0] - place[1])


def line_flux(rig: Rig, row: int, column: int, edges, axis: int, points: int = 16, chords: int = 24) -> np.ndarray:
    """Flux [lines] in W of a pixel of the upright grid, by lines lit between edges [lines, 2] along u or v (axis 0, 1).

    points: per side of the pixel. Raises ValueError where the light passes the mirror's rim or the ends of the lines.
    """
    node, weight = legendre.leggauss(points)
    row_at, column_at = (k.ravel() for k in np.meshgrid(row + node / 2, column + node / 2, indexing="ij"))
    of_pixel = np.outer(weight, weight).ravel() / 4
    node, weight = legendre.leggauss(chords)
    radius, angle = rig.eye.stop / 2, node * np.pi / 2
    across, half = radius * np.sin(angle), radius * np.cos(angle)
    of_chord = weight * np.pi / 2 * half  # d(across) = half d(angle)
    place, weight = legendre.leggauss(ALONG)
    turn = _steepest(rig, row, column, axis)
    s, t = half[:, None] * place, np.broadcast_to(across[:, None], (chords, ALONG))
    a, b = s * math.cos(turn) - t * math.sin(turn), s * math.sin(turn) + t * math.cos(turn)
    rows, columns = row_at[:, None, None], column_at[:, None, None]
    path = rig.back(rows, columns, a[None], b[None])
    _check_inside(rig, path, axis)
    flux = _weights(rig, rows, columns, a[None], b[None], path)
    fit = np.linalg.inv(legendre.legvander(place, ALONG - 1)).T  # from values on a chord to a Legendre series
    landing, density = (path.u, path.v)[axis] @ fit, flux @ fit
    below = _flux_below(landing, density, np.asarray(edges, float).ravel()) * (of_pixel[:, None] * of_chord)[..., None]
    total = below.sum((0, 1)).reshape(-1, 2)
    return total[:, 1] - total[:, 0]


def _flux_below(landing, density, edges) -> np.ndarray:
    """Integral of the density over the part of each chord, -1 to 1, that lands below each edge: [..., edges].

    landing, density: Legendre series [..., ALONG]; the landing grows along the chord.
    """
    ends = legendre.legvander(np.array([-1.0, 1.0]), ALONG - 1) @ np.swapaxes(landing, -1, -2)
    low, high = ends[..., 0, :, None], ends[..., 1, :, None]
    s = np.clip(2 * (edges - low) / (high - low) - 1, -1, 1)
    slope = legendre.legder(landing, axis=-1)
    for _ in range(6):
        value = np.sum(legendre.legvander(s, ALONG - 1) * landing[..., None, :], -1)
        by_s = np.sum(legendre.legvander(s, ALONG - 2) * slope[..., None, :], -1)
        s = np.clip(s - (value - edges) / by_s, -1, 1)
    whole = legendre.legint(density, lbnd=-1, axis=-1)
    return np.sum(legendre.legvander(s, ALONG) * whole[..., None, :], -1)


def binned_flux(rig: Rig, row: int, column: int, edges, axis: int, rays: int = 200_000) -> np.ndarray:
    """The same flux from single rays, evenly spread (Kronecker's sequence): the check of the quadrature."""
    root = 1.0
    for _ in range(60):  # the positive root of x^5 = x + 1: of all such sequences in four dimensions a good one
        root = (1 + root) ** 0.2
    k = np.arange(rays)[:, None]
    point = (0.5 + k * (1 / root ** np.arange(1, 5))) % 1
    radius, angle = rig.eye.stop / 2 * np.sqrt(point[:, 2]), 2 * np.pi * point[:, 3]
    a, b = radius * np.cos(angle), radius * np.sin(angle)
    rows, columns = row - 0.5 + point[:, 0], column - 0.5 + point[:, 1]
    path = rig.back(rows, columns, a, b)
    flux = _weights(rig, rows, columns, a, b, path) * np.pi * rig.eye.stop**2 / 4 / rays
    place = (path.u, path.v)[axis]
    return np.array([flux[(low <= place) & (place < high)].sum() for low, high in np.asarray(edges)])
