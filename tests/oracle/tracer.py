"""Independent float64 tracer of a test, slow and plain, written from the physics, without the package.

A scene is any object with the attributes of a scene file. World = the mirror's frame: origin on the surface
at the segment's centre, +Z along the normal there, +X away from the parent's axis. Lengths in mm, points and
directions [..., 3] in world coordinates.

The physics: the mirror is where the implicit equation of the parent conic vanishes, in the parent's own
frame, shifted by the Zernike deviation along z; its normal is that equation's gradient; light reflects by
d - 2 (d . n) n; a plane is met where (p - p0) . n = 0; a lens maps every point of the plane in focus to one
image point, along the line through its own centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


def device_axes(position_mm, look_at_mm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors of a device's frame: z from what it looks at back to it, x = unit(Y x z), y = z x x.

    A device that looks along the world's Y has the world's x.
    """
    z = np.subtract(position_mm, look_at_mm)
    z = z / math.sqrt(z @ z)
    if abs(z[1]) == 1.0:
        x = np.array([1.0, 0.0, 0.0])
        return x, np.cross(z, x), z
    x = np.cross([0.0, 1.0, 0.0], z)
    x = x / math.sqrt(x @ x)
    return x, np.cross(z, x), z


def plane_crossing(points: np.ndarray, directions: np.ndarray, origin: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Where lines cross the plane through origin: p + d ((o - p) . n) / (d . n)."""
    along = ((origin - points) @ normal) / (directions @ normal)
    return points + along[..., None] * directions


# --- Zernike polynomials from their definition -------------------------------------------------------------


def zernike_order(index: int, ordering: str) -> tuple[int, int]:
    """(n, m) of a term, m > 0 cosine and m < 0 sine, by counting through the ordering's own rule."""
    if ordering == "osa":  # ANSI Z80.28: j = (n (n + 2) + m) / 2
        terms = sorted(((n * (n + 2) + m) // 2, n, m) for n in range(41) for m in range(-n, n + 1, 2))
        return terms[index][1:]
    if ordering == "noll":  # Noll 1976: by n, then by |m|; the even index of a pair is the cosine
        number = 0
        for n in range(41):
            for m in range(n % 2, n + 1, 2):
                for sign in ((1, -1) if number % 2 else (-1, 1)) if m else (1,):
                    number += 1
                    if number == index:
                        return n, sign * m
    if ordering == "fringe":  # by (n + |m|) / 2, then by |m| downwards, cosine before sine
        number = 0
        for group in range(41):
            for m in range(group, -1, -1):
                for sign in (1, -1) if m else (1,):
                    number += 1
                    if number == index:
                        return 2 * group - m, sign * m
    raise ValueError(f"no term {index} in {ordering}")


def zernike_polar(n: int, m: int, rho: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Noll-normalised Zernike term and its derivatives by rho and by angle, from the factorial sum."""
    order = abs(m)
    radial, radial_slope = np.zeros_like(rho), np.zeros_like(rho)
    for s in range((n - order) // 2 + 1):
        factor = (
            (-1) ** s
            * math.factorial(n - s)
            / (math.factorial(s) * math.factorial((n + order) // 2 - s) * math.factorial((n - order) // 2 - s))
        )
        power = n - 2 * s
        radial += factor * rho**power
        if power:
            radial_slope += factor * power * rho ** (power - 1)
    norm = math.sqrt(n + 1) * (math.sqrt(2) if m else 1.0)
    wave = np.cos(order * angle) if m >= 0 else np.sin(order * angle)
    wave_slope = -order * np.sin(order * angle) if m >= 0 else order * np.cos(order * angle)
    return norm * radial * wave, norm * radial_slope * wave, norm * radial * wave_slope


# --- aspheric terms from their definition -------------------------------------------------------------------

COMPLEX_STEP = 1e-30  # mm: Im f(r + i h) / h is the derivative without any difference

# Forbes 2007, table of the first Qbfs polynomials: factor, and coefficients of 1, x, x^2, ...
Q_BFS = (
    (1.0, (1,)),
    (1 / math.sqrt(19), (13, -16)),
    (math.sqrt(2 / 95), (29, -100, 76)),
    (math.sqrt(2 / 2545), (207, -1260, 2308, -1280)),
    (1 / (3 * math.sqrt(131831)), (7737, -74448, 236192, -299008, 130304)),
)


def aspheric_height(terms, radius_mm: float, r: np.ndarray) -> np.ndarray:
    """Sum of powers of r, of Qcon and of Qbfs terms at complex r [mm]."""
    height = sum((value * r**n for n, value in (terms.coefficients_mm or {}).items()), np.zeros_like(r))
    if terms.normalisation_radius_mm is None:
        return height
    x = (r / terms.normalisation_radius_mm) ** 2
    for m, value_um in (terms.q_con_um or {}).items():  # the Jacobi polynomial P_m^(0,4)(2 x - 1) as a finite sum
        jacobi = sum(math.comb(m, s) * math.comb(m + 4, s) * (x - 1) ** s * x ** (m - s) for s in range(m + 1))
        height = height + value_um * 1e-3 * x * x * jacobi
    along_normal = np.sqrt(1 - (r / radius_mm) ** 2)
    for m, value_um in (terms.q_bfs_um or {}).items():
        factor, powers = Q_BFS[m]
        polynomial = sum(c * x**k for k, c in enumerate(powers))
        height = height + value_um * 1e-3 * x * (1 - x) * factor * polynomial / along_normal
    return height


# --- mirror ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OracleMirror:
    """The mirror of a scene as the implicit surface g(x, y, z) = 0, g < 0 above it."""

    mirror: object

    def deviation(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Height of the deviation along z [mm] and its slopes dz/dx, dz/dy."""
        height, slope_x, slope_y = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
        r = np.hypot(x, y)
        angle = np.arctan2(y, x)
        r_safe = np.where(r > 0, r, 1.0)
        for terms in self.mirror.zernike:
            for index, value_um in terms.coefficients_um.items():
                w, by_rho, by_angle = zernike_polar(*zernike_order(index, terms.ordering), r / terms.radius_mm, angle)
                by_r, around = by_rho / terms.radius_mm, by_angle / r_safe
                height += value_um * 1e-3 * w
                slope_x += value_um * 1e-3 * (by_r * np.cos(angle) - around * np.sin(angle))
                slope_y += value_um * 1e-3 * (by_r * np.sin(angle) + around * np.cos(angle))
        return height, slope_x, slope_y

    def _segment(self) -> tuple[np.ndarray, np.ndarray]:
        """Segment's centre in the parent's frame (vertex at 0, axis +Z); rotation parent <- segment."""
        radius, k, d = self.mirror.radius_mm, self.mirror.conic, self.mirror.off_axis_mm
        height = d * d / radius / (1 + math.sqrt(1 - (1 + k) * (d / radius) ** 2))  # the conic's sag formula
        height += float(self.aspheric(np.array(d), np.array(0.0))[0])
        normal = -self._parent_gradient(np.array([d, 0.0, height]))
        normal = normal / math.sqrt(normal @ normal)
        y = np.array([0.0, 1.0, 0.0])
        return np.array([d, 0.0, height]), np.stack([np.cross(y, normal), y, normal], axis=1)

    def aspheric(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the parent has above its conic along its axis [mm], and its slopes, at (x, y) of the parent's frame."""
        terms, r = getattr(self.mirror, "asphere", None), np.hypot(x, y)
        if terms is None:
            return np.zeros_like(r), np.zeros_like(r), np.zeros_like(r)
        height = aspheric_height(terms, self.mirror.radius_mm, r + 1j * COMPLEX_STEP)
        by_r, r = height.imag / COMPLEX_STEP, np.where(r > 0, r, 1.0)
        return height.real, by_r * x / r, by_r * y / r

    def _parent(self, point: np.ndarray) -> np.ndarray:
        """X^2 + Y^2 + (1 + k) Z^2 - 2 R Z, over 2 R, at the point lowered by the aspheric terms.

        It is zero on the parent and drops by 1 per mm of height.
        """
        x, y, z = np.moveaxis(point, -1, 0)
        z = z - self.aspheric(x, y)[0]
        return (x * x + y * y + (1 + self.mirror.conic) * z * z) / (2 * self.mirror.radius_mm) - z

    def _parent_gradient(self, point: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(point, -1, 0)
        height, slope_x, slope_y = self.aspheric(x, y)
        down = (1 + self.mirror.conic) * (z - height) / self.mirror.radius_mm - 1
        x, y = x / self.mirror.radius_mm, y / self.mirror.radius_mm
        return np.stack([x - down * slope_x, y - down * slope_y, down], -1)

    def implicit(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """g at world points and its gradient: the parent's equation at the point lowered by the deviation."""
        centre, rotation = self._segment()
        w, slope_x, slope_y = self.deviation(point[..., 0], point[..., 1])
        lowered = point - np.stack([np.zeros_like(w), np.zeros_like(w), w], -1)
        in_parent = centre + lowered @ rotation.T
        gradient = self._parent_gradient(in_parent) @ rotation
        gx, gy, gz = np.moveaxis(gradient, -1, 0)
        return self._parent(in_parent), np.stack([gx - gz * slope_x, gy - gz * slope_y, gz], -1)

    def meet(self, points: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Where lines meet the surface next to the world's origin, by Newton's method on g along the line."""
        t = -points[..., 2] / directions[..., 2]  # start where the line crosses z = 0
        for _ in range(30):
            g, gradient = self.implicit(points + t[..., None] * directions)
            step = g / np.sum(gradient * directions, -1)
            t = t - step
            if np.max(np.abs(step) * np.linalg.norm(directions, axis=-1)) < 1e-11:  # mm: a few ulp of 4 m
                break
        return points + t[..., None] * directions

    def reflect(self, points: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Law of reflection at points of the surface: d - 2 (d . n) n."""
        _, gradient = self.implicit(points)
        normal = gradient / np.linalg.norm(gradient, axis=-1, keepdims=True)
        return directions - 2 * np.sum(directions * normal, -1, keepdims=True) * normal

    def contains(self, points: np.ndarray) -> np.ndarray:
        radius = np.hypot(points[..., 0], points[..., 1])
        return (2 * radius <= self.mirror.diameter_mm) & (2 * radius >= self.mirror.obscuration_mm)


# --- camera ------------------------------------------------------------------------------------------------


def image_distance(camera) -> float:
    """Distance behind the lens at which the plane in focus is sharp: 1/f = 1/object + 1/image."""
    return 1 / (1 / camera.focal_length_mm - 1 / focus_distance(camera))


def focus_distance(camera) -> float:
    if camera.focus_distance_mm is not None:
        return camera.focus_distance_mm
    return math.dist(camera.position_mm, camera.look_at_mm)


def upright_image(camera, point_world: np.ndarray) -> np.ndarray:
    """Upright image (x, y) [..., 2] of points of the plane in focus, by the line through the lens's centre.

    The image stands head down behind the lens; stored upright it is the point's own offset, scaled.
    """
    x, y, _ = device_axes(camera.position_mm, camera.look_at_mm)
    offset = np.stack([(point_world - camera.position_mm) @ x, (point_world - camera.position_mm) @ y], -1)
    return offset * image_distance(camera) / focus_distance(camera)


def focus_point(camera, image_xy: np.ndarray) -> np.ndarray:
    """World point in the plane in focus whose upright image is at image_xy [..., 2]."""
    x, y, z = device_axes(camera.position_mm, camera.look_at_mm)
    offset = image_xy * focus_distance(camera) / image_distance(camera)
    return np.asarray(camera.position_mm) + offset[..., :1] * x + offset[..., 1:] * y - focus_distance(camera) * z


def detector_pixel(camera, image_xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fractional (column, row) of upright image points; whole numbers are pixel centres."""
    columns, rows = camera.detector.pixels
    return (
        image_xy[..., 0] / camera.detector.pitch_mm + (columns - 1) / 2,
        image_xy[..., 1] / camera.detector.pitch_mm + (rows - 1) / 2,
    )


# --- whole paths -------------------------------------------------------------------------------------------


def in_plane(device, points: np.ndarray) -> np.ndarray:
    """Coordinates [..., 2] of points of a device's plane in the device's frame."""
    x, y, _ = device_axes(device.position_mm, device.look_at_mm)
    return np.stack([(points - device.position_mm) @ x, (points - device.position_mm) @ y], -1)


def from_plane(device, xy: np.ndarray) -> np.ndarray:
    """World points of the points xy [..., 2] of a device's plane."""
    x, y, _ = device_axes(device.position_mm, device.look_at_mm)
    return np.asarray(device.position_mm) + xy[..., :1] * x + xy[..., 1:] * y


@dataclass(frozen=True)
class ForwardRays:
    """start, mirror [n, 3]; aperture, slopes, image [n, 2] (camera's frame); on_mirror, through [n]."""

    start: np.ndarray
    mirror: np.ndarray
    aperture: np.ndarray
    slopes: np.ndarray
    image: np.ndarray
    on_mirror: np.ndarray
    through: np.ndarray


def trace_forward(scene, screen_xy: np.ndarray, cosines_lm: np.ndarray) -> ForwardRays:
    """Rays from screen points [n, 2] (mm) along direction cosines [n, 2], both in the screen's frame."""
    x, y, z = device_axes(scene.screen.position_mm, scene.screen.look_at_mm)
    start = from_plane(scene.screen, screen_xy)
    l, m = cosines_lm[:, :1], cosines_lm[:, 1:]
    direction = l * x + m * y - np.sqrt(1 - l * l - m * m) * z  # away from the screen, towards the mirror
    surface, camera = OracleMirror(scene.mirror), scene.camera
    point = surface.meet(start, direction)
    outgoing = surface.reflect(point, direction)
    cx, cy, cz = device_axes(camera.position_mm, camera.look_at_mm)
    crossing = plane_crossing(point, outgoing, np.asarray(camera.position_mm), cz)
    aperture = in_plane(camera, crossing)
    along = outgoing @ cz
    slopes = np.stack([outgoing @ cx / along, outgoing @ cy / along], -1)
    in_focus = plane_crossing(point, outgoing, np.asarray(camera.position_mm) - focus_distance(camera) * cz, cz)
    on_mirror = surface.contains(point)
    through = on_mirror & (along > 0) & (2 * np.hypot(*aperture.T) <= camera.aperture_diameter_mm)
    return ForwardRays(start, point, aperture, slopes, upright_image(camera, in_focus), on_mirror, through)


@dataclass(frozen=True)
class AdjointRays:
    """start, mirror [n, 3]; screen [n, 2] in the screen's frame; cosine4, on_mirror, ahead [n]."""

    start: np.ndarray
    mirror: np.ndarray
    screen: np.ndarray
    cosine4: np.ndarray
    on_mirror: np.ndarray
    ahead: np.ndarray


def trace_adjoint(scene, image_xy: np.ndarray, aperture_xy: np.ndarray) -> AdjointRays:
    """Rays from upright image points [n, 2] backwards through aperture points [n, 2] (camera's frame, mm)."""
    camera, screen = scene.camera, scene.screen
    start = from_plane(camera, aperture_xy)
    direction = focus_point(camera, image_xy) - start
    surface = OracleMirror(scene.mirror)
    point = surface.meet(start, direction)
    outgoing = surface.reflect(point, direction)
    _, _, cz = device_axes(camera.position_mm, camera.look_at_mm)
    cosine = -(direction @ cz) / np.linalg.norm(direction, axis=-1)
    _, _, sz = device_axes(screen.position_mm, screen.look_at_mm)
    landing = in_plane(screen, plane_crossing(point, outgoing, np.asarray(screen.position_mm), sz))
    return AdjointRays(start, point, landing, cosine**4, surface.contains(point), outgoing @ sz > 0)
