"""The light of a detector pixel by quadrature, for pixels whose light has no closed form (response.py).

Rays are traced in float64 through points of the pixel and of the aperture. Over one pixel the landing point and the
mirror point are polynomials of degree DEGREE in the four positions, which is enough for a mirror of f/1, for an
aperture out of focus and for light that is focused on the screen. The polynomial is integrated numerically: by Gauss
points over the pixel, or by small cells where the mirror's rim crosses it, and by chords over the aperture. A piece of
a chord spreads its light evenly over the interval of the screen that it reaches.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.surface import Surface
from irtscots_cl.system.memory import check_memory

DEGREE = 4
FIT_RAYS = 210  # three for each coefficient
MAX_RESIDUAL = 1e-3  # of the rms width of a pixel's light: largest residual of the fit
NODES = 256  # intervals of a pixel's light that its distribution is stored for
CUT_CELLS = 12  # per axis, of a pixel that the rim crosses
PIECES = 4  # of a chord
LEAST_CHORDS = 8
HELD_BACK = np.array([1e-12, 1e-12, 1e-11, 1e-9, 1e-7])  # of each power, relative to the fit's rays
GOLDEN = (5**0.5 - 1) / 2
MAX_CHORDS, MAX_GAUSS = 28, 9
LATTICE = (233, 144)  # Fibonacci numbers: points over pixels whose light spreads over many lines, and the generator
FLOOR = 1e-4  # of a pixel's light: a piece's shortest interval, which keeps differences of sums exact
CHUNK = 1024  # pixels at a time
MAX_VALUES = 2**21  # points of all pixels at a time: 50 MB
BYTES_PER_PIXEL = 16 * NODES + 200

_POWERS = np.array([p for order in range(DEGREE + 1) for p in product(range(order + 1), repeat=4) if sum(p) == order])


def _monomials(points: np.ndarray) -> np.ndarray:
    """[m, terms] of points [m, 4]: s, t in half pixels, a, b in aperture radii."""
    powers = np.stack([points**k for k in range(DEGREE + 1)])  # [degree + 1, m, 4]
    return np.prod([powers[_POWERS[:, k], :, k] for k in range(4)], axis=0).T


def _term(powers) -> int:
    """The number of the coefficient of powers of s, t, a, b."""
    return int(np.flatnonzero(np.all(np.asarray(powers) == _POWERS, axis=1))[0])


def _linear(axis: int) -> int:
    """The number of the coefficient of s, t, a or b."""
    return _term(np.eye(4, dtype=int)[axis])


def _mean_points() -> tuple[np.ndarray, np.ndarray]:
    """Points [m, 4] and weights [m] of sum 1 for means over whole pixels: exact for the polynomials."""
    points, weights = np.polynomial.legendre.leggauss(4)
    ring, of_ring = np.polynomial.legendre.leggauss(4)
    ring, of_ring = np.sqrt((ring + 1) / 2), of_ring / 2
    angle = np.arange(8) * np.pi / 4
    axes = [points, points, np.arange(4), np.arange(8)]
    s, t, r, k = (v.ravel() for v in np.meshgrid(*axes, indexing="ij"))
    r, k = r.astype(int), k.astype(int)
    share = np.multiply.outer(
        np.multiply.outer(weights / 2, weights / 2), np.multiply.outer(of_ring, np.full(8, 1 / 8))
    )
    return np.stack([s, t, ring[r] * np.cos(angle[k]), ring[r] * np.sin(angle[k])], 1), share.ravel()


def _fit_points() -> np.ndarray:
    """Points [FIT_RAYS, 4] of pixel and aperture: a lattice, denser towards the ends as Chebyshev's points are.

    The lattice is Roberts' generalised golden ratio: x^5 = x + 1.
    """
    golden = 1.1673039782614187
    unit = (0.5 + np.arange(1, FIT_RAYS + 1)[:, None] / golden ** np.arange(1, 5)) % 1.0
    s, t = -np.cos(np.pi * unit[:, :2]).T
    radius, angle = np.sin(np.pi / 2 * unit[:, 2]), 2 * np.pi * unit[:, 3]
    return np.stack([s, t, radius * np.cos(angle), radius * np.sin(angle)], 1)


_POINTS = _fit_points()
_AT_POINTS = _monomials(_POINTS)
_FIT = np.linalg.pinv(_AT_POINTS)
_SQUARES = [_term([2, 0, 0, 0]), _term([0, 2, 0, 0])]
_MEAN_POINTS, _MEAN_SHARES = _mean_points()
_AT_MEAN = _monomials(_MEAN_POINTS)


@dataclass(frozen=True)
class TracedLight:
    """The light of n pixels. pixels: [n] flat numbers of the pixels.

    low, width: [2, n] where the light begins along u and v, and its extent [mm]. below: [2, n, NODES + 1] share of the
    pixel's area, times cos^4, whose light lands below equally spaced places of it. mean: [4, n] of u, v, x, y [mm], NaN
    without light. share: [n] of the pixel's area that sees the mirror. good: [n] the polynomials hold.
    """

    chief: ChiefRays
    pixels: np.ndarray
    low: np.ndarray
    width: np.ndarray
    below: np.ndarray
    mean: np.ndarray
    share: np.ndarray
    good: np.ndarray

    @classmethod
    def of(cls, chief: ChiefRays, pixels: np.ndarray) -> TracedLight:
        """The light of some pixels, [n] flat numbers. Raises ValueError if the memory cannot hold it."""
        count = len(pixels)
        check_memory(f"scene {chief.scene.name}: the light of {count} pixels without a closed form",
                     count * BYTES_PER_PIXEL)  # fmt: skip
        light = cls(chief, pixels, np.full((2, count), np.nan), np.full((2, count), np.nan),
                    np.zeros((2, count, NODES + 1)), np.full((4, count), np.nan), np.zeros(count),
                    np.zeros(count, bool))  # fmt: skip
        for first in range(0, count, CHUNK):
            light._fill(np.arange(first, min(first + CHUNK, count)))
        return light

    def valid(self) -> np.ndarray:
        """Whether the polynomials give each pixel's light [n]."""
        return self.good

    def coverage(self) -> np.ndarray:
        """Share [n] of each pixel's footprint that lies on the mirror."""
        return self.share

    def means(self, outputs: str) -> np.ndarray:
        """Means [outputs, n] in mm over each pixel's light, of "u", "v", "x", "y"; NaN without any."""
        return self.mean[["uvxy".index(output) for output in outputs]]

    def extent(self, output: str) -> tuple[np.ndarray, np.ndarray]:
        """Middle [n] of the pixels' light on the screen and its half-extent, along "u" or "v", in mm; NaN if none."""
        k = "uv".index(output)
        return self.low[k] + self.width[k] / 2, self.width[k] / 2

    def light(self, output: str, edges_mm: np.ndarray) -> np.ndarray:
        """Shares [n, lines] of the pixels' areas, times cos^4, between adjacent edges_mm [n, lines + 1] of u or v."""
        k = "uv".index(output)
        with np.errstate(invalid="ignore"):
            place = np.clip((edges_mm - self.low[k, :, None]) / self.width[k, :, None] * NODES, 0.0, NODES)
        place = np.nan_to_num(place)
        node = np.minimum(place.astype(int), NODES - 1)
        start = np.take_along_axis(self.below[k], node, 1)
        below = start + (place - node) * (np.take_along_axis(self.below[k], node + 1, 1) - start)
        return np.diff(below, axis=1)

    def _fill(self, index: np.ndarray) -> None:
        """Compute the light of the pixels with these indices."""
        row, column = np.divmod(self.pixels[index], self.chief.shape[1])
        values = _traced(self.chief, row, column)
        seen = np.isfinite(values).all((0, 1))
        values = np.where(seen, values, 0.0)
        whole, dark, near = _parted(self.chief.surface, values)
        coefficient = np.tensordot(_FIT, values, 1)  # [terms, outputs, n]
        counts = np.ones(values[:, 0].shape)
        edge = np.flatnonzero(seen & ~whole & ~dark)
        if edge.size:
            # beside the mirror its polynomials may grow fast: only rays on it, and a little beside it, count
            counts[:, edge] = near[:, edge]
            coefficient[:, :2, edge] = _weighted_fit(values[:, :2, edge], counts[:, edge])
        left = (values[:, :2] - np.tensordot(_AT_POINTS, coefficient[:, :2], 1)) * counts[:, None]
        number = counts.sum(0)
        with np.errstate(invalid="ignore", divide="ignore"):
            residual = np.sqrt(np.sum(left**2, 0) / np.maximum(number - len(_POWERS), number / 3))  # [2, n]
            self.good[index] = seen & (residual <= MAX_RESIDUAL * values[:, :2].std(0)).all(0)
        shape = self._shape(coefficient)
        for chosen, cut in ((seen & whole, False), (seen & ~whole & ~dark, True)):
            for turn in range(4):
                for k in range(2):
                    alike = np.flatnonzero(chosen & (shape[k] == turn))
                    if not alike.size:
                        continue
                    points, share = self._quadrature(coefficient[..., alike], k, turn, cut)
                    for part in np.array_split(alike, -(-len(points) * alike.size // MAX_VALUES)):
                        self._integrate(
                            index[part], coefficient[..., part], row[part], column[part], k, points, share, cut
                        )

    def _shape(self, coefficient: np.ndarray) -> np.ndarray:
        """Directions [2, n] of the chords in units of 45 degrees, near the aperture's gradient of u and of v."""
        a, b = coefficient[[_linear(2), _linear(3)]][:, :2]
        return np.rint(np.arctan2(b, a) / (np.pi / 4)).astype(int) % 4

    def _integrate(self, index, coefficient, row, column, k: int, points, share, cut: bool) -> None:
        """Distribution along u (k = 0) or v (k = 1) and means of the pixels index [n]. points, share: _quadrature."""
        steps, chords = 2 * PIECES + 1, share.size
        outputs = coefficient[:, [k, 2, 3]] if cut else coefficient[:, [k]]  # x, y where the rim asks for them
        value = np.tensordot(_monomials(points), outputs, 1).reshape(chords, steps, outputs.shape[1], len(index))
        low, middle, high = value[:, :-1:2], value[:, 1::2], value[:, 2::2]
        centre = (low + 4 * middle + high) / 6  # Simpson: [chords, PIECES, outputs, n]
        halfway = points.reshape(chords, steps, 4)[:, 1::2].reshape(-1, 4)
        weight = self._cos4(halfway, row, column).reshape(chords, PIECES, -1) * (share.reshape(-1, 1, 1) / PIECES)
        if cut:
            inside, moved = self._inside(middle[:, :, 1], middle[:, :, 2], coefficient)
            centre = centre + sum(shift[:, :, None] * step for shift, step in moved(outputs))
            centre = centre + sum(outputs[j] for j in _SQUARES) / (3 * CUT_CELLS**2)  # curvature over a cell
            weight = weight * inside
            covered = (share.reshape(-1, 1, 1) / PIECES * inside).sum((0, 1))
            with np.errstate(invalid="ignore", divide="ignore"):
                means = (weight[:, :, None] * centre).sum((0, 1)) / weight.sum((0, 1))
            place, mirror = centre[:, :, 0], means[1 + k]
        else:
            covered = np.ones(len(index))
            of_ray = _MEAN_SHARES[:, None] * self._cos4(_MEAN_POINTS, row, column)
            exact = np.tensordot(_AT_MEAN, coefficient[:, [k, 2 + k]], 1)
            means = (of_ray[:, None] * exact).sum(0) / of_ray.sum(0)
            place, mirror = centre[:, :, 0], means[1]
            place = place + (means[0] - (weight * place).sum((0, 1)) / weight.sum((0, 1)))
        lit = weight.sum((0, 1)) > 0
        self.mean[k, index], self.mean[2 + k, index] = means[0], mirror
        if k == 0:
            self.share[index] = np.where(lit, covered, 0.0)
        length = np.abs(high - low)[:, :, 0]
        self._tabulate(index[lit], k, place[..., lit], length[..., lit], weight[..., lit])

    def _quadrature(self, coefficient, k: int, turn: int, cut: bool):
        """Points [q, 4], and the share [pixel points, chords] of each chord, for pixels whose chords turn alike."""
        s, t, of_pixel = self._pixel_points(coefficient, k, cut)
        # a few pixel points need as many chords as the waves of the lines over the aperture ask for; many share them
        wanted = int(np.clip(np.ceil(self._reach(coefficient, k, 2, 3) / 2) + 10, 12, MAX_CHORDS))
        lines = max(LEAST_CHORDS, -(-16 * wanted // max(len(s), 16)))
        # equally spaced angles integrate a function of period pi; each point of the pixel has its own offset, so that
        # no place of the screen is where many chords end
        offset = (np.arange(1, len(s) + 1) * GOLDEN) % 1.0
        place = np.pi * ((np.arange(lines) + offset[:, None]) / lines - 0.5)  # [pixel points, chords]
        across, half = np.sin(place)[..., None], np.cos(place)[..., None]
        along = half * np.linspace(-1.0, 1.0, 2 * PIECES + 1)
        angle = np.pi / 4 * turn
        a = along * np.cos(angle) - across * np.sin(angle)
        b = along * np.sin(angle) + across * np.cos(angle)
        places = [np.broadcast_to(v, a.shape).ravel() for v in (s[:, None, None], t[:, None, None], a, b)]
        return np.stack(places, 1), of_pixel[:, None] * half[..., 0] ** 2 * (2 / lines)

    def _pixel_points(self, coefficient, k: int, cut: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points s, t over the pixels and their weights, of sum 1."""
        if cut:
            place = (2 * np.arange(CUT_CELLS) + 1) / CUT_CELLS - 1
            s, t = (v.ravel() for v in np.meshgrid(place, place))
            return s, t, np.full(s.size, 1 / s.size)
        count = [int(np.ceil(self._reach(coefficient, k, axis) / 2)) + 3 for axis in range(2)]
        if max(count) > MAX_GAUSS:
            number = np.arange(LATTICE[0]) + 0.5
            s, t = (2 * ((number * step / LATTICE[0]) % 1.0) - 1 for step in (1, LATTICE[1]))
            return s, t, np.full(s.size, 1 / s.size)
        (s, by_s), (t, by_t) = (np.polynomial.legendre.leggauss(points) for points in count)
        return *(v.ravel() for v in np.meshgrid(s, t)), np.multiply.outer(by_t, by_s).ravel() / 4

    def _reach(self, coefficient, k: int, *axes: int) -> float:
        """Largest phase [rad] of the screen's lines that the pixels' light turns by along half of these axes."""
        slopes = [coefficient[_linear(axis), k] for axis in axes]
        pitch = self.chief.scene.screen.pitch_xy_mm[k]
        return float(2 * np.pi * np.percentile(np.linalg.norm(slopes, axis=0), 95) / pitch)

    def _cos4(self, points: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """cos^4 [q, n] of the rays' angles to the camera's axis, times the image's stretch."""
        camera, model = self.chief.scene.camera, self.chief.camera_model
        s, t, a, b = points.T[:, :, None]
        image_x, image_y = model.image_point(row + t / 2, column + s / 2)
        radius, distance = camera.aperture_diameter_mm / 2, camera.image_distance_mm
        slope_x = a * radius / camera.focus_mm - image_x / distance
        slope_y = b * radius / camera.focus_mm - image_y / distance
        cosine4 = (1 + slope_x**2 + slope_y**2) ** -2
        return cosine4 * model.stretch(row + t / 2, column + s / 2) if model.is_distorted else cosine4

    def _inside(self, x, y, coefficient):
        """Share [chords, pieces, n] of the pixel's cell about each place x, y that lies on the mirror.

        Also how far the middle of that part lies from the cell's: a function from coefficients [terms, outputs, n] to
        pairs of a shift along s or t and the outputs' change [outputs, n] with it.
        """
        surface, radius, cell = self.chief.surface, np.hypot(x, y), 2 / CUT_CELLS
        terms = [_linear(axis) for axis in range(2)]
        if surface.outline is not None:
            depth, toward_x, toward_y = surface.depth(x, y)
            grows = [np.nan_to_num(toward_x * coefficient[k, 2] + toward_y * coefficient[k, 3]) for k in terms]
            size = np.maximum(sum(np.abs(grow) for grow in grows) * cell, 1e-12)
            inside = np.clip(depth / size + 0.5, 0.0, 1.0)
            shifts = [(1 - inside) / 2 * cell * grow * cell / size for grow in grows]
            return inside, lambda values: [(shift, values[k]) for shift, k in zip(shifts, terms, strict=True)]
        with np.errstate(invalid="ignore", divide="ignore"):
            grows = [np.nan_to_num((x * coefficient[k, 2] + y * coefficient[k, 3]) / radius) for k in terms]
        size = np.maximum(sum(np.abs(grow) for grow in grows) * cell, 1e-12)
        inside, outward = np.clip((surface.aperture_radius_mm - radius) / size + 0.5, 0.0, 1.0), 0.0
        outward = outward - (1 - inside)
        if surface.obscuration_radius_mm > 0:
            beyond = np.clip((radius - surface.obscuration_radius_mm) / size + 0.5, 0.0, 1.0)
            inside, outward = inside * beyond, outward + (1 - beyond)
        shifts = [outward / 2 * cell * grow * cell / size for grow in grows]
        return inside, lambda values: [(shift, values[k]) for shift, k in zip(shifts, terms, strict=True)]

    def _tabulate(self, index, k: int, centre, length, weight) -> None:
        """Store the distribution of intervals (centre, length [..., n] in mm, weight) along u or v."""
        count = len(index)
        if not count:
            return
        centre, length, weight = (v.reshape(-1, count) for v in (centre, length, weight))
        lit = weight > 0
        low = np.where(lit, centre - length / 2, np.inf).min(0)
        width = np.where(lit, centre + length / 2, -np.inf).max(0) - low
        pad = np.maximum(FLOOR * width, 1e-9)
        low, width = low - pad, width + 2 * pad
        length = np.maximum(length, 2 * pad * 0.5)
        step = width / NODES
        # a ramp (x - start)+ - (x - end)+ over length for each interval: sums over the ramps that began before a node
        numbers = np.broadcast_to(np.arange(count) * (NODES + 1), centre.shape)
        total, moment = np.zeros((2, count * (NODES + 1)))
        for sign, place in ((1.0, centre - length / 2), (-1.0, centre + length / 2)):
            place = (place - low) / step
            height = sign * np.where(lit, weight / (length / step), 0.0)
            node = numbers + np.clip(np.ceil(place), 0, NODES).astype(int)
            total += np.bincount(node.ravel(), height.ravel(), total.size)
            moment += np.bincount(node.ravel(), (height * place).ravel(), total.size)
        total, moment = (np.cumsum(v.reshape(count, NODES + 1), 1) for v in (total, moment))
        self.below[k, index] = np.arange(NODES + 1) * total - moment
        self.low[k, index], self.width[k, index] = low, width


def _parted(surface: Surface, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which pixels [n] lie wholly on the mirror, which send no light, and which of their rays [FIT_RAYS, n] are on it
    or a little beside it. values: [FIT_RAYS, 4, n], as of _traced."""
    x, y = values[:, 2], values[:, 3]
    with np.errstate(invalid="ignore"):
        if surface.outline is not None:
            margin = 0.1 * np.hypot(np.ptp(x, axis=0), np.ptp(y, axis=0))
            depth = surface.depth(x, y)[0]
            return depth.min(0) >= margin, depth.max(0) < -margin, depth >= -margin / 2
        radius = np.hypot(x, y)
        margin = 0.1 * np.ptp(radius, axis=0)
        whole = radius.max(0) + margin <= surface.aperture_radius_mm
        whole &= (surface.obscuration_radius_mm == 0) | (radius.min(0) - margin >= surface.obscuration_radius_mm)
        # beside the mirror altogether, or wholly in the hole: no light
        dark = radius.min(0) - margin > surface.aperture_radius_mm
        dark |= radius.max(0) + margin < surface.obscuration_radius_mm
        near = radius <= surface.aperture_radius_mm + margin / 2
        near &= radius >= surface.obscuration_radius_mm - margin / 2
    return whole, dark, near


def _weighted_fit(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Coefficients [terms, outputs, n] of polynomials for values [FIT_RAYS, outputs, n] of weight [FIT_RAYS, n].

    Higher powers are held back a little, for pixels with few rays.
    """
    normal = np.einsum("mi,mn,mj->nij", _AT_POINTS, weight, _AT_POINTS, optimize=True)
    normal += np.diag(FIT_RAYS * HELD_BACK[_POWERS.sum(1)])
    wanted = np.einsum("mi,mn,mon->nio", _AT_POINTS, weight, values, optimize=True)
    return np.moveaxis(np.linalg.solve(normal, wanted), 0, -1)


def _traced(chief: ChiefRays, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Landing point u, v and mirror point x, y [FIT_RAYS, 4, n] of the rays that the polynomials are fitted to."""
    radius = chief.scene.camera.aperture_diameter_mm / 2
    s, t, a, b = _POINTS.T[:, :, None]
    points, u, v = chief.reverse(row + t / 2, column + s / 2, a * radius, b * radius)
    return np.stack([u, v, points[..., 0], points[..., 1]], 1)
