"""The light of a detector pixel in closed form: the share below a line, and the centroid.

By a pixel's quadratic map (ray_map.py) the aperture point (a, b) lands at u0 + p a + q b + Q(a, b). The light at
u < t is then that of the aperture disk cut by a straight line, whose area is paper Eq. (2). The quadratic Q bends the
line and the weight cos^4 varies over the disk; both effects are included to first order in closed form. The integral
over the pixel's own area is a sum over cells (quadrature.py).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.chord import MIN_HALF_BOX, chord_integrals
from irtscots_cl.optics.pixel.edges import Circle
from irtscots_cl.optics.pixel.quadrature import PixelQuadrature, cut_cells, join, whole_cells, without
from irtscots_cl.optics.pixel.ray_map import RayMap

if TYPE_CHECKING:
    from irtscots_cl.optics.pixel.crossed import Crossed

MAX_RESIDUAL = 2e-3  # of the aperture image's radius: largest residual of a map's fit
MAX_BEND = 0.02  # of the same radius: beyond it the first order in Q is wrong by more than 4e-4
MAX_PUSH = 0.02  # of a pixel: largest shift of the rim over the aperture, to first order
MAX_DIAGONAL = 1.0  # of a pixel on the mirror, in radii of a rim or hole that crosses it in one direction
CELL_SIZE = 0.2  # of the aperture image's radius: half the largest size of a box's own image
MOST_CELLS = 16  # along a pixel
POINT_STEP = 0.015  # of the same radius, between Gauss points on the rim
CHUNK = 2**12  # cells processed at a time: their data stays in the cache
ROUNDING = 1e-12  # of a pixel: rounding error of a difference that should be zero


@dataclass(frozen=True)
class PixelResponse:
    """The light of a scene's pixels in closed form. pixels: [n] flat numbers of the pixels."""

    chief: ChiefRays
    pixels: np.ndarray
    maps: RayMap
    _cells: dict[str, PixelQuadrature] = field(default_factory=dict, repr=False)  # made on first use
    _means: dict[str, np.ndarray] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, chief: ChiefRays, pixels: np.ndarray | None = None) -> PixelResponse:
        """The light of some pixels (flat numbers), or of all that can see the mirror."""
        pixels = np.flatnonzero(chief.sees_mirror) if pixels is None else pixels
        row, column = np.divmod(pixels, chief.shape[1])
        return cls(chief, pixels, RayMap.of(chief, row, column))

    def spread(self, output: str, monomials: tuple[str, str]) -> np.ndarray:
        return np.hypot(*(self.maps.term(output, m) for m in monomials))

    def cells(self, output: str) -> PixelQuadrature:
        """Cells fine enough for the light along "u" or "v", made once."""
        if output not in self._cells:
            self._cells[output] = self._cut(output)
        return self._cells[output]

    def _cut(self, output: str) -> PixelQuadrature:
        """Cells of all pixels, as many in each; those along the other axis if they are the same.

        What cells leave is then much alike in neighbours, and so no slope. Cells of each pixel's own size leave steps
        between pixels: 0.9 nm on a hyperboloid seen by 64 x 48 pixels.
        """
        for other, cells in list(self._cells.items()):
            if self._counts[other] == self._counts[output]:
                return cells
        cut = self._cut_by_rim if self.chief.surface.outline is None else self._cut_by_outline
        return cut(*self._counts[output])

    @cached_property
    def _counts(self) -> dict[str, tuple[list[int], list[int]]]:
        """Along "u" and "v": numbers, along s and t, of cells in a pixel and of Gauss points on a rim: as many as
        nearly all pixels need."""
        found = {}
        for output, boxes in zip("uv", self._design_boxes, strict=True):
            largest = [float(np.percentile(box[box > 0], 99)) if (box > 0).any() else 0.0 for box in boxes]
            counts = [int(np.clip(np.ceil(box / CELL_SIZE), 1, MOST_CELLS)) for box in largest]
            found[output] = counts, [int(np.clip(np.ceil(box / POINT_STEP), 8, 64)) for box in largest]
        return found

    @cached_property
    def _design_boxes(self) -> np.ndarray:
        """Sizes [2, 2, n] of the pixels' own images along u and v, for s and t, in radii of the aperture's image.

        Of the design, so that a mirror and the models of it have the same cells, and what these leave cancels between
        them. 0 where the design sends no light.
        """
        chief, step = ChiefRays(self.chief.scene.nominal()), np.array([[0.5], [-0.5]])
        radius, none = chief.scene.camera.aperture_diameter_mm / 2, np.zeros((2, 1))
        moves = [(none, step, none, none), (step, none, none, none)]
        moves += [(none, none, 2 * step, none), (none, none, none, 2 * step)]
        found = []
        for row, column, a, b in moves:
            places = chief.reverse(self.maps.row + row, self.maps.column + column, a * radius, b * radius)[1:]
            found.append([np.abs(place[0] - place[1]) for place in places])
        by_s, by_t, by_a, by_b = np.array(found)  # [2, n] each, in mm
        with np.errstate(invalid="ignore", divide="ignore"):
            boxes = np.stack([by_s, by_t], 1) / np.hypot(by_a, by_b)[:, None]
        return np.where(np.isfinite(boxes), boxes, 0.0)

    def _cut_by_rim(self, count: list[int], points: list[int]) -> PixelQuadrature:
        """Cells of the pixels of a mirror that is a disk or a ring."""
        maps, surface = self.maps, self.chief.surface
        farthest = maps.corner_radius.max(1)
        in_hole = farthest <= surface.obscuration_radius_mm
        rim, hole = (self._crossed(radius) for radius in (surface.aperture_radius_mm, surface.obscuration_radius_mm))
        whole = (farthest <= surface.aperture_radius_mm) & ~in_hole
        cells = join([
            whole_cells(np.flatnonzero(whole), *count),
            cut_cells(maps, np.flatnonzero(rim & ~in_hole), Circle(surface.aperture_radius_mm), count, points),
        ])  # fmt: skip
        return without(
            cells, cut_cells(maps, np.flatnonzero(hole), Circle(surface.obscuration_radius_mm), count, points)
        )

    @cached_property
    def _crossed_edges(self) -> Crossed:
        """The edges that cross the pixels, of a mirror with an outline."""
        from irtscots_cl.optics.pixel.crossed import Crossed  # imported late: few mirrors are no disks

        return Crossed.of(self.chief.surface, self.maps)

    def _cut_by_outline(self, count: list[int], points: list[int]) -> PixelQuadrature:
        """Cells of the pixels of a mirror with an outline; none of those in which several edges lie."""
        crossed, maps = self._crossed_edges, self.maps
        edges = crossed.edges
        around = [(edge, pixels) for edge, hole, pixels in edges if hole]
        whole = [np.flatnonzero(crossed.whole), *(pixels for _, pixels in around)]
        inside = [cut_cells(maps, pixels, edge, count, points) for edge, hole, pixels in edges if not hole]
        cells = join([whole_cells(np.concatenate(whole), *count), *inside])
        for edge, pixels in around:
            cells = without(cells, cut_cells(maps, pixels, edge, count, points))
        return cells

    def _crossed(self, radius_mm: float) -> np.ndarray:
        """Pixels [n] that the circle of the rim or the hole may cross; none for a hole of zero size."""
        farthest, nearest = self.maps.corner_radius.max(1), self.maps.corner_radius.min(1)
        return (farthest > radius_mm) & (nearest <= radius_mm + self._diagonal()) & (radius_mm > 0)

    def _diagonal(self) -> np.ndarray:
        return 2 * np.hypot(self.maps.term("x", "s"), self.maps.term("y", "t"))

    def weight(self, s: np.ndarray, t: np.ndarray, pixel: np.ndarray, half_s=0.0, half_t=0.0) -> tuple[np.ndarray, ...]:
        """Mean of the weight over cells (centres, half-lengths), and its relative growth per unit of s, t, a, b.

        The weight is cos^4 times the stretch of the pixel's image: its flux over that of the perfect lens on its axis.
        """
        camera, model = self.chief.scene.camera, self.chief.camera_model
        distance, pitch = camera.image_distance_mm, model.pitch_mm
        row, column = self.maps.row[pixel] + t / 2, self.maps.column[pixel] + s / 2
        x, y = model.image_point(row, column)
        slope_x, slope_y = -x / distance, -y / distance
        cosine2 = 1 / (1 + slope_x**2 + slope_y**2)
        by_x, by_y = -4 * slope_x * cosine2, -4 * slope_y * cosine2
        step_x, step_y = (p / 2 / distance for p in pitch)
        reach = camera.aperture_diameter_mm / 2 / camera.focus_mm
        bend_x, bend_y = (24 * slope**2 * cosine2**2 - 4 * cosine2 for slope in (slope_x, slope_y))
        ratio = step_y / step_x
        mean = 1 + step_x**2 * (bend_x * half_s**2 + ratio**2 * bend_y * half_t**2) / 6
        if model.is_distorted:
            stretch = model.stretch(row, column)
            growth = [self._growth(row, column, *step) for step in ((0.0, 0.5), (0.5, 0.0))]
            return cosine2**2 * stretch * mean, *growth, by_x * reach, by_y * reach
        return cosine2**2 * mean, -by_x * step_x, -by_y * step_y, by_x * reach, by_y * reach

    def _growth(self, row, column, step_row: float, step_column: float) -> np.ndarray:
        """Relative growth of the weight of chief rays along a step from pixels, by differences."""
        model, weights = self.chief.camera_model, []
        for sign in (1.0, -1.0):
            at = row + sign * step_row, column + sign * step_column
            x, y = (v / model.image_distance_mm for v in model.image_point(*at))
            weights.append(model.stretch(*at) * (1 + x**2 + y**2) ** -2)
        return (weights[0] - weights[1]) / (weights[0] + weights[1])

    def valid(self) -> np.ndarray:
        """Whether the closed form gives each pixel's light; false if its map contains NaN."""
        return np.all(list(self.limits().values()), axis=0)

    def limits(self) -> dict[str, np.ndarray]:
        """Whether each pixel [n] is within a limit of the closed form, by the limit's words for messages."""
        maps = self.maps
        footprint = np.hypot(maps.term("x", "s"), maps.term("y", "t"))
        push = np.hypot(self.spread("x", ("a", "b")), self.spread("y", ("a", "b")))
        surface = self.chief.surface
        with np.errstate(invalid="ignore", divide="ignore"):
            sharp = push <= MAX_PUSH * footprint
            small, alone, quadratic, straight = (np.ones_like(sharp) for _ in range(4))
            if surface.outline is None:
                for radius_mm in (surface.aperture_radius_mm, surface.obscuration_radius_mm):
                    small &= ~self._crossed(radius_mm) | (self._diagonal() <= MAX_DIAGONAL * radius_mm)
            else:
                alone = ~self._crossed_edges.unclear
                for edge, _, pixels in self._crossed_edges.edges:
                    if isinstance(edge, Circle):
                        small[pixels] &= self._diagonal()[pixels] <= MAX_DIAGONAL * edge.radius_mm
            for k, output in enumerate("uv"):
                radius = self.spread(output, ("a", "b"))
                bend = np.abs([maps.term(output, m) for m in ("aa", "ab", "bb")]).max(0)
                quadratic &= maps.residual[k] <= MAX_RESIDUAL * radius
                straight &= bend <= MAX_BEND * radius
            blur = np.nanmedian(push / footprint) if np.isfinite(push / footprint).any() else np.nan
        return {
            f"the camera's defocus on the mirror, a blur of {blur:.2g} of a pixel where {MAX_PUSH} is allowed": sharp,
            "the size of a pixel on the mirror, larger than the rim or the hole that crosses it": small,
            "the mirror's outline, of which more than one edge lies in a pixel": alone,
            f"the light of a pixel on the screen, whose map is not quadratic to {MAX_RESIDUAL} of its size": quadratic,
            f"the light of a pixel on the screen, bent by more than {MAX_BEND} of its size": straight,
        }

    def extent(self, output: str) -> tuple[np.ndarray, np.ndarray]:
        """Middle [n] of the pixels' light on the screen and its half-extent, along "u" or "v", in mm.

        Only for the part of a pixel that sees the mirror; NaN or not finite if there is none.
        """
        low, high = np.full(len(self.pixels), np.inf), np.full(len(self.pixels), -np.inf)
        for cells in self.cells(output).in_chunks(CHUNK):
            maps = self.maps.part(cells.pixel)
            half = sum(
                np.abs(maps.gradient(output, along, cells.s, cells.t)) * length
                + np.abs(maps.term(output, 2 * along)) * length**2
                for along, length in (("s", cells.half_s), ("t", cells.half_t))
            )
            centre, first = maps.centre(output, cells.s, cells.t), np.flatnonzero(np.diff(cells.pixel, prepend=-1))
            if first.size:
                pixel = cells.pixel[first]
                low[pixel] = np.minimum(low[pixel], np.minimum.reduceat(centre - half, first))
                high[pixel] = np.maximum(high[pixel], np.maximum.reduceat(centre + half, first))
        with np.errstate(invalid="ignore"):
            return (low + high) / 2, (high - low) / 2 + 1.01 * self.spread(output, ("a", "b"))

    def means(self, outputs: str) -> np.ndarray:
        """Means [outputs, n] in mm over each pixel's light, of "u", "v", "x", "y"; NaN without any.

        u and v are the true centroids; x, y are the mirror point that they belong to.
        """
        missing = [output for output in dict.fromkeys(outputs) if output not in self._means]
        together: dict[int, list[str]] = {}  # of the same cells
        for output in missing:
            together.setdefault(id(self._cells_of(output)), []).append(output)
        for group in together.values():
            self._means.update(zip(group, self._means_of(group), strict=True))
        return np.stack([self._means[output] for output in outputs])

    def _cells_of(self, output: str) -> PixelQuadrature:
        """The cells for an output's mean."""
        return self.cells({"x": "u", "y": "v"}.get(output, output))

    def _means_of(self, outputs: list[str]) -> list[np.ndarray]:
        """The means [n] of outputs with the same cells."""
        cells = self._cells_of(outputs[0])
        flux, *moments = np.concatenate([self._moments(outputs, part) for part in cells.in_chunks(CHUNK)], axis=1)
        total = np.where(self.coverage() > 0, cells.sum(flux, len(self.pixels)), np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):
            return [cells.sum(moment, len(self.pixels)) / total for moment in moments]

    def _moments(self, outputs: list[str], cells: PixelQuadrature) -> np.ndarray:
        """The light [m] of cells, and that times each of their mean outputs, [1 + outputs, m]."""
        s, t, maps = cells.s, cells.t, self.maps.part(cells.pixel)
        weight, by_s, by_t, by_a, by_b = self.weight(s, t, cells.pixel, cells.half_s, cells.half_t)
        found = [weight * cells.weight]
        for output in outputs:
            p, q = maps.gradient(output, "a", s, t), maps.gradient(output, "b", s, t)
            centre = self._centre(output, maps, cells, by_s, by_t)
            centre = centre + (maps.term(output, "aa") + maps.term(output, "bb") + by_a * p + by_b * q) / 4
            pushed = (cells.push[0] * p + cells.push[1] * q) / 4
            found.append(weight * (cells.weight * centre + pushed))
        return np.stack(found)

    def coverage(self) -> np.ndarray:
        """Share [n] of each pixel's footprint that lies on the mirror."""
        cells = self.cells("u")
        share = cells.sum(cells.weight, len(self.pixels))
        if self.chief.surface.outline is not None:  # pixels without cells are told of by rays
            share = np.where(self._crossed_edges.unclear, self.chief.footprint.coverage.flat[self.pixels], share)
        return np.where(share > ROUNDING, share, 0.0)

    def light(self, output: str, edges_mm: np.ndarray) -> np.ndarray:
        """Shares [n, lines] of the pixels' areas, times cos^4, between adjacent edges_mm [n, lines + 1] of u or v."""
        cells = self.cells(output)
        below = np.zeros(edges_mm.shape)
        for part in cells.in_chunks(CHUNK):
            first = np.flatnonzero(np.diff(part.pixel, prepend=-1))  # cells come pixel by pixel
            if first.size:
                below[part.pixel[first]] += np.add.reduceat(self._below(output, part, edges_mm[part.pixel]), first)
        return np.diff(below, axis=1)

    def _below(self, output: str, cells: PixelQuadrature, edges_mm: np.ndarray) -> np.ndarray:
        """Shares [m, edges] of the cells' light that land below the edges [m, edges]."""
        s, t = cells.s, cells.t
        maps = self.maps.part(cells.pixel)
        weight, by_s, by_t, by_a, by_b = self.weight(s, t, cells.pixel, cells.half_s, cells.half_t)
        p, q = maps.gradient(output, "a", s, t), maps.gradient(output, "b", s, t)
        radius = np.hypot(p, q)
        n_a, n_b = p / radius, q / radius
        aa, ab, bb = (maps.term(output, name) for name in ("aa", "ab", "bb"))
        bend_n = (aa * n_a**2 + ab * n_a * n_b + bb * n_b**2) / radius  # Q along the chord's normal, and along it
        bend_t = (aa * n_b**2 - ab * n_a * n_b + bb * n_a**2) / radius
        boxes = []  # a box's image changes over the aperture
        for half, along in ((cells.half_s, "s"), (cells.half_t, "t")):
            turn = maps.term(output, along + "a") * n_a + maps.term(output, along + "b") * n_b
            boxes.append((maps.gradient(output, along, s, t)[:, None], turn[:, None], (half / radius)[:, None]))
        mass = weight * cells.weight
        growth = mass * (by_a * n_a + by_b * n_b) + weight * (cells.push[0] * n_a + cells.push[1] * n_b)
        factors = (mass, -mass * bend_n / np.pi, -(2 / 3) * (mass * bend_t + growth) / np.pi)
        tau = (edges_mm - self._centre(output, maps, cells, by_s, by_t)[:, None]) / radius[:, None]
        reach = 1 + sum(np.maximum((np.abs(slope) + np.abs(turn)) * half, MIN_HALF_BOX) for slope, turn, half in boxes)
        near = np.abs(tau) < reach
        across = _window(near)
        found = _chord_light(np.concatenate([np.take_along_axis(tau, across, 1), reach], 1), boxes, factors)
        below = np.zeros_like(tau)
        np.put_along_axis(below, across, found[:, :-1], 1)
        return np.where(near, below, found[:, -1:] * (tau > 0))  # all of the light beyond it, nothing before

    def _centre(self, output: str, maps: RayMap, cells: PixelQuadrature, by_s, by_t) -> np.ndarray:
        """Centroid [m] of the light of the cells' own images along u or v, in mm.

        Shifted from the image of the cell's centre by the image's curvature over the cell and by the weight's growth.
        """
        centre = maps.centre(output, cells.s, cells.t)
        for half, along, growth in ((cells.half_s, "s", by_s), (cells.half_t, "t", by_t)):
            slope = maps.gradient(output, along, cells.s, cells.t)
            centre = centre + (maps.term(output, 2 * along) + growth * slope) * half**2 / 3
        return centre


def _window(near: np.ndarray) -> np.ndarray:
    """Columns [m, columns] of windows, as wide as the widest needs, around the true entries of each row of near."""
    count = near.shape[1]
    first = near.argmax(1)
    last = np.where(near.any(1), count - 1 - near[:, ::-1].argmax(1), first)
    width = int((last - first).max(initial=0)) + 1
    columns: np.ndarray = np.minimum(first, count - width)[:, None] + np.arange(width)
    return columns


def _chord_light(tau: np.ndarray, boxes: list[tuple[np.ndarray, ...]], factors: tuple[np.ndarray, ...]) -> np.ndarray:
    """Light [m, edges] of cells below tau [m, edges], in radii of their aperture's image from its centre.

    boxes: along s and t the slope of the landing point, its change over the aperture and the half-length in radii,
    [m, 1] each. factors: [m] of the chord's three integrals.
    """
    inside = np.clip(tau, -1.0, 1.0)
    half_s, half_t = (np.maximum(np.abs(slope + turn * inside) * half, MIN_HALF_BOX) for slope, turn, half in boxes)
    below = np.zeros_like(tau)
    for sign, shift in ((1, half_s + half_t), (-1, half_s - half_t), (-1, half_t - half_s), (1, -half_s - half_t)):
        parts = chord_integrals(tau + shift)
        below += sign * sum(f[:, None] * part for f, part in zip(factors, parts, strict=True))
    return below / (4 * half_s * half_t)
