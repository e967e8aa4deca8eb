"""A test's rays at 50 digits, from the physics: the conic's implicit equation, the law of reflection, planes.

Arrays hold mpmath numbers (dtype object), one per ray; vectors are lists of three such arrays. Lengths in mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np

from irtscots_cl.maths.frame import ALONG_Y
from irtscots_cl.maths.zernike.indices import index_to_nm

DIGITS = 50  # the factorial sums of radial order 40 lose 15 digits, roots close to a tangent 10 more
NEWTON_STEPS = 5  # from the design to the deviated surface: each doubles the number of digits; a ray needs 25


def _context():
    try:
        import mpmath
    except ImportError:
        raise ValueError("irtscots stability needs mpmath: pip install 'irtscots-cl[stability]'") from None
    context = mpmath.mp.clone()  # the global context may belong to another program
    context.dps = DIGITS
    return context


class _Numbers:
    """mpmath on arrays. The context is made on first use, so that the package starts without mpmath."""

    @cached_property
    def context(self):
        return _context()

    def exact(self, values) -> np.ndarray:
        """Floats as exact numbers with the same binary value."""
        of_float = np.frompyfunc(lambda v: self.context.mpf(float(v)), 1, 1)
        return np.asarray(of_float(np.asarray(values)), dtype=object)

    def sqrt(self, values) -> np.ndarray:
        """Square roots; NaN of negative numbers."""
        root = np.frompyfunc(lambda v: self.context.sqrt(v) if v >= 0 else self.context.nan, 1, 1)
        return np.asarray(root(values), dtype=object)


NUMBERS = _Numbers()


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def error(device_values, exact_values) -> np.ndarray:
    """Device values minus exact ones, computed exactly, as float64 of the same shape."""
    return np.asarray(NUMBERS.exact(device_values) - exact_values).astype(float)


def unit(v):
    length = NUMBERS.sqrt(dot(v, v))
    return [c / length for c in v]


@dataclass(frozen=True)
class ExactMet:
    """Where lines met the mirror: point, unit normal towards +Z, on_mirror [n]; direction: of the reflected light."""

    point: list
    normal: list
    direction: list
    cosine: np.ndarray  # of the angle of incidence, float64
    on_mirror: np.ndarray

    def point_error(self, points: np.ndarray) -> np.ndarray:
        """Distance [n] in mm of points [3, n] from the exact ones, across the ray."""
        gaps = np.stack([error(p, q) for p, q in zip(points, self.point, strict=True)])
        return np.linalg.norm(gaps, axis=0) * self.cosine

    def normal_error(self, normals: np.ndarray) -> np.ndarray:
        """Angle [n] in rad between normals [3, n] of any length and the exact ones."""
        found = unit([NUMBERS.exact(c) for c in normals])
        return np.linalg.norm(
            np.stack([(a - b).astype(float) for a, b in zip(found, self.normal, strict=True)]), axis=0
        )


class ExactMirror:
    """A scene's mirror: parent conic c (X^2 + Y^2 + (1 + k) Z^2) = 2 Z, the segment's frame, the deviation along z.

    c: curvature 1 / radius_mm, below 0 if convex, 0 if flat.
    """

    def __init__(self, mirror):
        one = NUMBERS.exact
        self.mirror, self._curvature = mirror, 1 / one(mirror.radius_mm)[()]
        self._curved = one(1.0)[()] + mirror.conic
        d, c = one(mirror.off_axis_mm)[()], self._curvature
        root = NUMBERS.sqrt(1 - self._curved * (d * c) ** 2)[()]
        self._centre = [d, 0, c * d * d / (1 + root)]
        slope = c * d / root  # of the parent at the segment's centre
        length = NUMBERS.sqrt(1 + slope * slope)[()]
        self._x, self._z = [1 / length, 0, slope / length], [-slope / length, 0, 1 / length]

    def _in_parent(self, v):
        return [self._x[0] * v[0] + self._z[0] * v[2], v[1], self._x[2] * v[0] + self._z[2] * v[2]]

    def _design(self, start, direction):
        """Height z where lines cross the parent from its front, nearest the vertex; NaN for lines that do not.

        Along a line F = c (X^2 + Y^2 + (1 + k) Z^2) - 2 Z is a quadratic in z; light that comes down from the front,
        where F < 0, meets the parent at the root where F falls with z.
        """
        a, d = self._in_parent(start), self._in_parent(direction)
        a = [c + v for c, v in zip(self._centre, a, strict=True)]
        c = self._curvature
        square = c * (d[0] * d[0] + d[1] * d[1] + self._curved * d[2] * d[2])
        half = c * (a[0] * d[0] + a[1] * d[1] + self._curved * a[2] * d[2]) - d[2]
        constant = c * (a[0] * a[0] + a[1] * a[1] + self._curved * a[2] * a[2]) - 2 * a[2]
        below = NUMBERS.sqrt(half * half - square * constant) - half
        safe = np.where(below == 0, 1, below)
        return np.where(below == 0, NUMBERS.context.nan, constant / safe)

    def _normal(self, point):
        """Upward gradient of the parent [3][n] at points of the segment's frame, in that frame, and its part along the
        parent's axis."""
        p = [c + v for c, v in zip(self._centre, self._in_parent(point), strict=True)]
        g = [-p[0] * self._curvature, -p[1] * self._curvature, 1 - self._curved * p[2] * self._curvature]
        return [dot(self._x, g), g[1], dot(self._z, g)], g[2]

    def deviation(self, x, y):
        """Height and slopes of the deviation at points [n], from the factorial sums of the radial polynomials."""
        height, slope_x, slope_y = x * 0, x * 0, x * 0
        for terms in self.mirror.zernike:
            scale = 1 / NUMBERS.exact(terms.radius_mm)[()]
            for index, value_um in terms.coefficients_um.items():
                factor = NUMBERS.exact(value_um)[()] / 1000
                w, w_x, w_y = zernike_exact(*index_to_nm(index, terms.ordering), x * scale, y * scale)
                height, slope_x, slope_y = (
                    height + factor * w,
                    slope_x + factor * scale * w_x,
                    slope_y + factor * scale * w_y,
                )
        return height, slope_x, slope_y

    def meet(self, lines) -> ExactMet:
        """Follow lines [4, n] (x0, y0, p, q), given as floats, down to the surface as made."""
        return self.meet_exact([NUMBERS.exact(c) for c in lines])

    def meet_exact(self, lines) -> ExactMet:
        """Follow lines [4][n], given as exact numbers, with points (x0 + p z, y0 + q z, z), to the surface as made."""
        x0, y0, p, q = lines
        start, direction = [x0, y0, p * 0], [p, q, p * 0 + 1]
        z = self._design(start, direction)
        point = [s + z * d for s, d in zip(start, direction, strict=True)]
        normal, parent_down = self._normal(point)
        # the segment's half of the parent: its own sheet, below the widest circle
        met = np.array([bool(n > 0 and down > 0) for n, down in zip(normal[2], parent_down, strict=True)])
        if self.mirror.zernike:
            point, normal = self._deviated(start, direction, z)
        normal = unit(normal)
        towards = unit(direction)
        along = dot(towards, normal)
        outgoing = [2 * along * n - t for n, t in zip(normal, towards, strict=True)]
        return ExactMet(point, normal, outgoing, np.abs(along.astype(float)), met & self._contains(point))

    def _deviated(self, start, direction, z):
        """Newton's method along the lines on design(point minus deviation) = 0."""
        for _ in range(NEWTON_STEPS):
            point = [s + z * d for s, d in zip(start, direction, strict=True)]
            height, slope_x, slope_y = self.deviation(point[0], point[1])
            lowered = [point[0], point[1], point[2] - height]
            normal, _ = self._normal(lowered)
            normal = [normal[0] - normal[2] * slope_x, normal[1] - normal[2] * slope_y, normal[2]]
            p = [c + v for c, v in zip(self._centre, self._in_parent(lowered), strict=True)]
            up = p[2] - (p[0] * p[0] + p[1] * p[1] + self._curved * p[2] * p[2]) * self._curvature / 2
            z = z - up / dot(normal, direction)
        return [s + z * d for s, d in zip(start, direction, strict=True)], normal

    def _contains(self, point):
        rim, hole = (NUMBERS.exact(v)[()] ** 2 / 4 for v in (self.mirror.diameter_mm, self.mirror.obscuration_mm))
        square = point[0] * point[0] + point[1] * point[1]
        return np.array([bool(hole <= s <= rim) for s in square])


def zernike_exact(n: int, m: int, x, y):
    """Noll-normalised Zernike term and its derivatives by x and y at exact points [n] of the unit disk."""
    order = abs(m)
    s, radial, radial_ds = x * x + y * y, x * 0, x * 0
    for j in range((n - order) // 2 + 1):  # Horner's rule in s, highest power first
        # (-1)^j (n - j)! / (j! ((n + |m|)/2 - j)! ((n - |m|)/2 - j)!)
        coefficient = (-1) ** j * comb(n - j, j) * comb(n - 2 * j, (n - order) // 2 - j)
        radial_ds = radial_ds * s + radial
        radial = radial * s + coefficient
    lower, power = (x * 0, y * 0), (x * 0 + 1, y * 0)  # (x + i y)^(order - 1), (x + i y)^order
    for _ in range(order):
        lower, power = power, (power[0] * x - power[1] * y, power[0] * y + power[1] * x)
    sine = m < 0
    wave = power[sine]
    wave_x, wave_y = (order * lower[1], order * lower[0]) if sine else (order * lower[0], -order * lower[1])
    norm = NUMBERS.sqrt(NUMBERS.exact((n + 1) * (2 if m else 1)))[()]
    slopes = (
        norm * (radial * wave_x + 2 * x * radial_ds * wave),
        norm * (radial * wave_y + 2 * y * radial_ds * wave),
    )
    return norm * radial * wave, *slopes


class ExactFrame:
    """A screen's or camera's frame: +z away from the point it looks at, x = unit(Y x z), y = z x x.

    A device that looks within ALONG_Y of the world's Y looks along it, with the world's X as x.
    """

    def __init__(self, position_mm, look_at_mm):
        self.position = [NUMBERS.exact(c)[()] for c in position_mm]
        z = unit([c - NUMBERS.exact(v)[()] for c, v in zip(self.position, look_at_mm, strict=True)])
        if z[0] * z[0] + z[2] * z[2] <= ALONG_Y**2:
            z = [z[0] * 0, z[0] * 0 + (1 if z[1] > 0 else -1), z[0] * 0]
            x = [z[0] + 1, z[0], z[0]]
        else:
            x = unit([z[2], z[0] * 0, -z[0]])
        self.axes = [x, [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]], z]

    def arrive(self, point, direction):
        """Where rays cross the plane z = 0: (u, v) [n], and whether they run towards it."""
        away = [p - c for p, c in zip(point, self.position, strict=True)]
        along = dot(self.axes[2], direction)
        step = -dot(self.axes[2], away) / along
        hit = [a + step * d for a, d in zip(away, direction, strict=True)]
        return dot(self.axes[0], hit), dot(self.axes[1], hit), np.array([bool(c > 0) for c in along])

    def depart(self, u, v, direction_u, direction_v):
        """World point (u, v, 0) and world direction of (direction_u, direction_v, -1): away from the device."""
        x, y, z = self.axes
        start = [p + u * a + v * b for p, a, b in zip(self.position, x, y, strict=True)]
        return start, [direction_u * a + direction_v * b - c for a, b, c in zip(x, y, z, strict=True)]


def adjoint_landing(scene, image, aperture) -> tuple[list, ExactMet, np.ndarray]:
    """Rays from image points through aperture points, both [2][n] exact in the camera's frame, to the screen.

    Returns the landing points [2][n] in the screen's frame, the points where the rays met the mirror, and whether they
    run towards the screen. The lens images the upright point X from X focus / image distance of the plane in focus.
    """
    camera, one = scene.camera, NUMBERS.exact
    frame = ExactFrame(camera.position_mm, camera.look_at_mm)
    focal = one(camera.focal_length_mm)[()]
    if camera.focus_distance_mm is None:
        gap = [one(a)[()] - one(b)[()] for a, b in zip(camera.position_mm, camera.look_at_mm, strict=True)]
        focus = NUMBERS.sqrt(dot(gap, gap))[()]
    else:
        focus = one(camera.focus_distance_mm)[()]
    image_distance = 1 / (1 / focal - 1 / focus)
    slopes = [x / image_distance - a / focus for x, a in zip(image, aperture, strict=True)]
    start, direction = frame.depart(*aperture, *slopes)
    p, q = direction[0] / direction[2], direction[1] / direction[2]
    met = ExactMirror(scene.mirror).meet_exact([start[0] - start[2] * p, start[1] - start[2] * q, p, q])
    u, v, ahead = ExactFrame(scene.screen.position_mm, scene.screen.look_at_mm).arrive(met.point, met.direction)
    return [u, v], met, ahead
