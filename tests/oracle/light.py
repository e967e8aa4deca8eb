"""The light of one pixel of a real test, independent of the package, by brute-force quadrature.

Flux = radiance x cosine^4 x d(aperture area) x d(x) d(y) of the undistorted image plane, over aperture and pixel. The
rays of the pixel are traced on a coarse grid and joined by polynomials. Over the aperture: chords along the direction
in which the light moves fastest on the screen; where a line's edge cuts a chord is solved for. Over the pixel and
across the chords: Gauss's points, with cuts where an edge passes the end of a chord.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from oracle.rig import Rig

SIDE = 5  # of the polynomials, per coordinate: over a pixel and the aperture the ray map is nearly linear
PIECE = 6  # Gauss's points of a smooth piece


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


@dataclass(frozen=True)
class LightMap:
    """Landing place and flux density of one pixel's light as polynomials of four coordinates, each from -1 to 1.

    landing, density: Legendre coefficients [row, column, a, b]; the pixel is 1 wide, the aperture in its square.
    """

    landing: np.ndarray
    density: np.ndarray

    @classmethod
    def of(cls, rig: Rig, row: int, column: int, axis: int, tolerance: float = 1e-6) -> LightMap:
        """Raises ValueError where the light passes the mirror's rim or the lines' ends, or is no such polynomial.

        tolerance: in mm of landing and of 1 of the density, at the corners, where a polynomial is worst.
        """
        node = legendre.leggauss(SIDE)[0]
        corner = np.array([-1.0, 1.0])
        inside, landing, density = cls._rays(rig, row, column, axis, node)
        fit = np.linalg.inv(legendre.legvander(node, SIDE - 1))
        made = cls(*(np.einsum("ia,jb,kc,ld,abcd", *[fit] * 4, k) for k in (landing, density)))
        _check_inside(rig, inside, axis)
        _, *true = cls._rays(rig, row, column, axis, corner)
        for series, at, scale in zip((made.landing, made.density), true, (1.0, made.density[0, 0, 0, 0]), strict=True):
            ends = [legendre.legvander(corner, SIDE - 1)] * 4
            if not np.max(np.abs(np.einsum("ai,bj,ck,dl,ijkl", *ends, series) - at)) < tolerance * scale:
                raise ValueError("a pixel's light is no polynomial of so low an order")
        return made

    @staticmethod
    def _rays(rig: Rig, row: int, column: int, axis: int, node):
        rows, columns, a, b = np.meshgrid(
            row + node / 2, column + node / 2, *[node * rig.eye.stop / 2] * 2, indexing="ij"
        )
        path = rig.back(rows, columns, a, b)
        return path, (path.u, path.v)[axis], _weights(rig, rows, columns, a, b, path)

    def inner(self, outer, across, along) -> tuple[np.ndarray, np.ndarray]:
        """Legendre coefficients [outer, chords, SIDE, SIDE] of landing and density over a chord and a pixel's side.

        outer: [n] of the pixel's slower side; across: [chords] and along: [chords, SIDE], of the aperture's radius. The
        faster side of the pixel and the chords' direction are those along which the landing changes most.
        """
        turn = math.atan2(self.landing[0, 0, 0, 1], self.landing[0, 0, 1, 0])
        a = along * math.cos(turn) - across[:, None] * math.sin(turn)
        b = along * math.sin(turn) + across[:, None] * math.cos(turn)
        rows_first = abs(self.landing[1, 0, 0, 0]) > abs(self.landing[0, 1, 0, 0])
        fit = np.linalg.inv(legendre.legvander(legendre.leggauss(SIDE)[0], SIDE - 1))
        of_outer, of_a, of_b = (legendre.legvander(k, SIDE - 1) for k in (outer, a, b))
        found = []
        for series in (self.landing, self.density):
            series = series if rows_first else series.swapaxes(0, 1)
            at_outer = np.einsum("oj,ijkl->oikl", of_outer, series)
            found.append(np.einsum("oikl,csk,csl,ms->ocim", at_outer, of_a, of_b, fit, optimize=True))
        return tuple(found)


def line_flux(rig: Rig, row: int, column: int, edges, axis: int, points: int = 8, chords: int = 240) -> np.ndarray:
    """Flux [lines] in W of a pixel of the upright grid, by lines lit between edges [lines, 2] along u or v (axis 0, 1).

    points: Gauss's points along the pixel's slower side. Raises ValueError as LightMap.of.
    """
    outer, of_outer = legendre.leggauss(points)
    node, weight = legendre.leggauss(chords)
    across, half = np.sin(node * np.pi / 2), np.cos(node * np.pi / 2)
    of_chord = weight * np.pi / 2 * half**2 * (rig.eye.stop / 2) ** 2  # d(across) d(along) = half^2 d(angle) d(share)
    along = half[:, None] * legendre.leggauss(SIDE)[0]
    landing, density = LightMap.of(rig, row, column, axis).inner(outer, across, along)
    edges = np.asarray(edges, float)
    reach = np.abs(landing).sum((-1, -2)) - np.abs(landing[..., 0, 0])
    low, high = (landing[..., 0, 0] - reach).min(), (landing[..., 0, 0] + reach).max()
    total = np.zeros(len(edges))
    for k in np.nonzero((edges[:, 1] > low) & (edges[:, 0] < high))[0]:
        below = [_flux_below(landing, density, edge) for edge in edges[k]]
        total[k] = np.einsum("o,c,oc->", of_outer / 2, of_chord, below[1] - below[0])
    return total


def _flux_below(landing, density, edge: float) -> np.ndarray:
    """Integral [...] of the density over what lands below an edge: along a chord, -1 to 1, and over a pixel's side.

    landing, density: Legendre coefficients [..., side, chord]. The pixel's side is cut where the edge meets an end of
    the chord: the integral along the chord is smooth between these places.
    """
    ends = legendre.legvander(np.array([-1.0, 1.0]), SIDE - 1)
    cuts = [_crossing(landing @ end, edge) for end in ends]
    one = np.ones_like(cuts[0])
    stops = [-one, np.minimum(*cuts), np.maximum(*cuts), one]
    node, weight = legendre.leggauss(PIECE)
    whole = legendre.legint(density, lbnd=-1, axis=-1)
    total = np.zeros_like(one)
    for start, stop in itertools.pairwise(stops):
        for at, share in zip(node, weight, strict=True):
            of_side = legendre.legvander((start + stop) / 2 + at * (stop - start) / 2, SIDE - 1)
            chord = np.einsum("...i,...im->...m", of_side, landing)
            place = legendre.legvander(_crossing(chord, edge), SIDE)
            flux = np.einsum("...i,...im,...m->...", of_side, whole, place)
            total += share / 2 * (stop - start) / 2 * flux
    return total


def _crossing(series, value: float) -> np.ndarray:
    """Where monotonic Legendre series [..., SIDE] have the value, or the end of -1 to 1 next to it."""
    slope = legendre.legder(series, axis=-1)
    at = np.clip((value - series[..., 0]) / series[..., 1], -1, 1)
    for _ in range(8):
        found = np.sum(legendre.legvander(at, SIDE - 1) * series, -1)
        by_at = np.sum(legendre.legvander(at, SIDE - 2) * slope, -1)
        at = np.clip(at - (found - value) / by_at, -1, 1)
    return at


def binned_flux(rig: Rig, row: int, column: int, edges, axis: int, rays: int = 50_000) -> np.ndarray:
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
