"""Quadrature over the part of each detector pixel that sees the mirror.

A whole pixel is a grid of boxes. If the mirror's rim crosses a pixel, its cells are intervals that end on the rim. Seen
through the whole aperture, the rim is not one line: from the aperture point (a, b) it appears shifted, and cells on it
store the shift.

Positions are s (along the column) and t (along the row), in half pixel edges; a and b, in aperture radii.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from irtscots_cl.optics.pixel.edges import Edge
from irtscots_cl.optics.pixel.ray_map import RayMap

NEWTON_STEPS = 6  # for the rim's position in a pixel, where the rim is nearly straight


@dataclass(frozen=True)
class PixelQuadrature:
    """m cells of the n pixels of a RayMap.

    pixel: [m] index into the map, in growing order. s, t: [m] centres. half_s, half_t: [m] half-lengths. weight: [m]
    share of the pixel's area. push: [2, m] growth of that share per unit of a and b, by the shift of the rim.
    """

    pixel: np.ndarray
    s: np.ndarray
    t: np.ndarray
    half_s: np.ndarray
    half_t: np.ndarray
    weight: np.ndarray
    push: np.ndarray

    def part(self, chosen: slice | np.ndarray) -> PixelQuadrature:
        """Some of the cells: a slice, or a mask [m]."""
        return PixelQuadrature(*(getattr(self, name)[..., chosen] for name in self.__dataclass_fields__))

    def in_chunks(self, size: int) -> Iterator[PixelQuadrature]:
        """All cells, size at a time, in at least one chunk: what is computed of a cell needs more memory than it."""
        for first in range(0, max(len(self.pixel), 1), size):
            yield self.part(slice(first, first + size))

    def sum(self, values: np.ndarray, pixels: int) -> np.ndarray:
        """Sums [pixels] over each pixel's cells of values [m]."""
        return np.bincount(self.pixel, values, pixels)


def whole_cells(pixel: np.ndarray, along_s: int, along_t: int) -> PixelQuadrature:
    """Whole pixels [k], each in along_s x along_t equal cells."""
    s, t = ((2 * np.arange(count) + 1) / count - 1 for count in (along_s, along_t))
    s, t = (np.tile(v.ravel(), len(pixel)) for v in np.meshgrid(s, t))
    half = np.ones(len(s))
    index = np.repeat(pixel, along_s * along_t)
    return PixelQuadrature(
        index, s, t, half / along_s, half / along_t, half / (along_s * along_t), np.zeros((2, len(s)))
    )  # fmt: skip


def cut_cells(maps: RayMap, pixel: np.ndarray, edge: Edge, along: tuple[int, int], across: tuple) -> PixelQuadrature:
    """Cells of the parts of pixels [k] whose mirror points lie within an edge, the rim's circle or a straight side.

    Such a cell is an interval along s or t, whichever the rim crosses more steeply, at a Gauss point of the other.
    along: number of intervals from side to rim, along s and along t. across: number of Gauss points, along s and t.
    """
    zero = np.zeros(len(pixel))
    chosen = maps.part(pixel)
    steep_s = np.abs(edge.growth(chosen, "s", zero, zero)) >= np.abs(edge.growth(chosen, "t", zero, zero))
    parts = []
    for k, mask in enumerate((steep_s, ~steep_s)):
        if mask.any():
            parts.append(_cut_along(chosen.part(mask), pixel[mask], "st"[k], edge, along[k], across[1 - k]))
    return join(parts or [whole_cells(pixel, 1, 1)])


def join(parts: list[PixelQuadrature]) -> PixelQuadrature:
    """All cells of the given quadratures, pixel by pixel."""
    order = np.argsort(np.concatenate([p.pixel for p in parts]), kind="stable")
    names = PixelQuadrature.__dataclass_fields__
    return PixelQuadrature(*(np.concatenate([getattr(p, name) for p in parts], -1)[..., order] for name in names))


def without(outer: PixelQuadrature, hole: PixelQuadrature) -> PixelQuadrature:
    """The outer quadrature minus the hole's, which lies inside it."""
    return join(
        [outer, PixelQuadrature(hole.pixel, hole.s, hole.t, hole.half_s, hole.half_t, -hole.weight, -hole.push)]
    )


def _cut_along(maps: RayMap, pixel: np.ndarray, along: str, edge: Edge, inner: int, outer: int) -> PixelQuadrature:
    """cut_cells where the rim is crossed along one direction, "s" or "t", by all these pixels [k]."""

    def at(inward, across):  # (s, t) of positions measured from the pixel's inner side
        return (side * inward, across) if along == "s" else (across, side * inward)

    zero = np.zeros(len(pixel))
    side = np.sign(edge.growth(maps, along, zero, zero))  # inward is small on the mirror's side of the rim
    breaks = _breaks(lambda inward, across: edge.excess(maps, *at(inward, across)), len(pixel))
    point, weight = np.polynomial.legendre.leggauss(outer)
    start, length = breaks[:, :-1, None], np.diff(breaks, axis=1)[..., None]
    across = (start + length * (point + 1) / 2).reshape(len(pixel), -1)
    share = (length * weight / 4).reshape(len(pixel), -1)
    side = side[:, None]
    end = np.zeros_like(across)
    for _ in range(NEWTON_STEPS):
        s, t = at(end, across)
        slope = side * edge.growth(maps, along, s, t)
        end = np.clip(end - edge.excess(maps, s, t) / slope, -1.0, 1.0)
    s, t = at(end, across)
    on_rim = np.abs(end) < 1.0
    pushed = [-edge.growth(maps, name, s, t) / (side * edge.growth(maps, along, s, t)) for name in "ab"]
    # the inner intervals from -1 to the end, and the rim itself as cells without area
    half = ((end + 1) / 2 / inner)[..., None]
    centre = -1 + half * (2 * np.arange(inner) + 1)
    inward = np.concatenate([centre, end[..., None]], -1)
    halves = np.concatenate([np.broadcast_to(half, centre.shape), np.zeros((*end.shape, 1))], -1)
    area = halves * share[..., None]
    push = np.zeros((2, *area.shape))
    push[..., -1] = np.where(on_rim, np.stack(pushed) * share / 2, 0.0)
    s, t = at(inward.reshape(len(pixel), -1), np.repeat(across, inner + 1, axis=1))
    index = np.repeat(pixel, s.shape[1])
    keep = (area.ravel() > 0) | push.reshape(2, -1).any(0)
    flat = [np.broadcast_to(v, s.shape).ravel()[keep] for v in (s, t)]
    halves, zeros = halves.ravel()[keep], np.zeros(keep.sum())
    lengths = (halves, zeros) if along == "s" else (zeros, halves)
    return PixelQuadrature(index[keep], *flat, *lengths, area.ravel()[keep], push.reshape(2, -1)[:, keep])


def _breaks(excess, count: int) -> np.ndarray:
    """Where the rim leaves pixels through their inner and outer sides: [count, 6], increasing from -1 to 1.

    excess(inward, across): of the edge; nearly quadratic along a side. A side without a crossing
    repeats an end, which gives pieces of zero length.
    """
    found = [np.full(count, -1.0), np.full(count, 1.0)]
    for inward in (-1.0, 1.0):
        edge = np.full(count, inward)
        low, middle, high = (excess(edge, np.full(count, across)) for across in (-1.0, 0.0, 1.0))
        bend, tilt = (low + high) / 2 - middle, (high - low) / 2
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(tilt**2 - 4 * bend * middle)
            larger = -(tilt + np.where(tilt < 0, -root, root)) / 2
            roots = (larger / bend, middle / larger)
        found += [np.clip(np.nan_to_num(r, nan=1.0, posinf=1.0, neginf=-1.0), -1.0, 1.0) for r in roots]
    return np.sort(np.stack(found, 1), axis=1)
