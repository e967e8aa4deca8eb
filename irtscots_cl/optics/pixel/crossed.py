"""Which edges of a mirror with an outline cross which pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.optics.outline import Grid, Outline, Polygon, Ring
from irtscots_cl.optics.pixel.edges import Circle, Edge, Side
from irtscots_cl.optics.pixel.ray_map import RayMap
from irtscots_cl.optics.surface import Surface

CROSSES = 1.05  # of a pixel's radius on the mirror: nearer edges may cross it
ALONE = 1.5  # of the same radius, in which no second edge may lie where one crosses a pixel
ASIDE = 0.25  # of the same radius, to both sides of an edge, where it is asked what it parts


@dataclass(frozen=True)
class Crossed:
    """The edges of a mirror with an outline, and n pixels.

    whole: [n] pixels that no edge crosses and that see the mirror. unclear: [n] those in which several edges lie, or
    one that has no simple form. edges: each edge, whether the mirror lies around it, and the pixels [k] that it cuts.
    """

    whole: BoolArray
    unclear: BoolArray
    edges: tuple[tuple[Edge, bool, np.ndarray], ...]

    @classmethod
    def of(cls, surface: Surface, maps: RayMap) -> Crossed:
        """What the edges of a surface with an outline do to the pixels of a map; NaN of it makes a pixel unclear."""
        assert surface.outline is not None
        zero = np.zeros(len(maps.row))
        x, y = maps.centre("x", zero, zero), maps.centre("y", zero, zero)
        corners = [(zero + s, zero + t) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
        radius = np.max([np.hypot(maps.centre("x", *at) - x, maps.centre("y", *at) - y) for at in corners], axis=0)
        near, crossing, which = np.zeros(len(x), int), np.zeros(len(x), int), np.full(len(x), -1)
        edges = list(_edges(surface))
        with np.errstate(invalid="ignore"):
            for k, (edge, _) in enumerate(edges):
                distance = edge.away(x, y) if isinstance(edge, Side) else np.abs(edge.beyond(x, y)[0])
                close = distance <= ALONE * radius
                near += close
                crossing += distance <= CROSSES * radius
                which[close] = k
            unclear = ((near > 1) & (crossing > 0)) | ~np.isfinite(radius)
            if surface.outline.has_grid:
                unclear |= np.abs(surface.outline.depth(x, y)[0]) <= CROSSES * radius
            whole = surface.contains(x, y) & ~unclear
        cut = []
        for k, (edge, around) in enumerate(edges):
            pixels = np.flatnonzero((which == k) & (crossing > 0) & ~unclear)
            parts = _parts(surface, edge, x[pixels], y[pixels], radius[pixels])
            crossed = pixels[parts]
            if crossed.size:
                whole[crossed] = False
                cut.append((edge, around, crossed))
        return cls(np.asarray(whole), np.asarray(unclear), tuple(cut))


def _edges(surface: Surface) -> Iterator[tuple[Circle | Side, bool]]:
    """The circles and sides of a surface's aperture, and whether the mirror lies around them."""
    outline: Outline | None = surface.outline
    yield Circle(surface.aperture_radius_mm), False
    if surface.obscuration_radius_mm > 0:
        yield Circle(surface.obscuration_radius_mm), True
    for part in () if outline is None else outline.parts:
        if isinstance(part, Ring):
            yield Circle(part.outer_mm, part.x_mm, part.y_mm), False
            if part.inner_mm > 0:
                yield Circle(part.inner_mm, part.x_mm, part.y_mm), True
        elif isinstance(part, Polygon):
            for (x, y), (u, v) in zip(*part.sides, strict=True):
                yield Side(x, y, u, v), False
        else:
            assert isinstance(part, Grid)  # has no edges of a simple form
    for strip in () if outline is None else outline.strips:
        for (x, y), (u, v) in zip(*strip.sides, strict=True):
            yield Side(x + u, y + v, -u, -v), False  # the mirror is outside


def _parts(surface: Surface, edge: Circle | Side, x: FloatArray, y: FloatArray, radius: FloatArray) -> BoolArray:
    """Whether an edge crosses pixels [k], and parts the mirror there from what is not."""
    beyond, to_x, to_y = edge.beyond(x, y)
    sides = []
    for sign in (-1.0, 1.0):
        step = sign * ASIDE * radius - beyond
        sides.append(surface.contains(x + step * to_x, y + step * to_y))
    return np.asarray((np.abs(beyond) <= CROSSES * radius) & (sides[0] != sides[1]))
