"""Independent float64 tracer of a test with a real lens: surface after surface, in one order, without the package.

World = the mirror's frame. Lengths in mm, points and directions [n, 3] in world coordinates. A surface is a conic of
revolution, x^2 + y^2 + (1 + k) z^2 = 2 R z in the frame of its vertex, or a plane; light reflects by d - 2 (d . n) n,
and Snell's law holds for the part of a direction along the surface: n1 (d - (d . n) n) = n2 (e - (e . n) n).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Step:
    """A surface that light meets next. axis: unit, of revolution; radius_mm: above 0 where the centre lies along it.

    index_in, index_out: on the side from which light comes, and behind; equal of a mirror, which reflects.
    """

    vertex: np.ndarray
    axis: np.ndarray
    radius_mm: float = math.inf
    conic: float = 0.0
    index_in: float = 1.0
    index_out: float = 1.0
    mirror: bool = False


def unit(vector) -> np.ndarray:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def meet(step: Step, points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Where lines cross the surface next to its vertex.

    With h = p - vertex the equation is h . h + k (h . a)^2 - 2 R h . a = 0, quadratic in the way along the line, told
    from the plane through the vertex.
    """
    along = directions @ step.axis
    points = points + (((step.vertex - points) @ step.axis) / along)[:, None] * directions
    if math.isinf(step.radius_mm):
        return points
    h = points - step.vertex
    second = 1 + step.conic * along**2
    first = np.sum(h * directions, -1) - step.radius_mm * along  # half of it; h . a = 0 here
    least = np.sum(h * h, -1)
    root = np.sqrt(first**2 - second * least)
    way = -least / (first + np.where(first < 0, -root, root))  # the smaller root, without cancellation
    return points + way[:, None] * directions


def normal_at(step: Step, points: np.ndarray) -> np.ndarray:
    """Unit normals: the gradient of the equation."""
    if math.isinf(step.radius_mm):
        return np.broadcast_to(step.axis, points.shape)
    h = points - step.vertex
    return unit(h + (step.conic * (h @ step.axis) - step.radius_mm)[:, None] * step.axis)


def pass_step(step: Step, points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points on the surface, directions after it, and the share of the light that goes on: Fresnel's, unpolarised."""
    points = meet(step, points, directions)
    normal = normal_at(step, points)
    cosine = np.sum(directions * normal, -1, keepdims=True)
    if step.mirror:
        return points, directions - 2 * cosine * normal, np.ones(len(points))
    tangential = (directions - cosine * normal) * (step.index_in / step.index_out)
    behind = np.sign(cosine) * np.sqrt(1 - np.sum(tangential**2, -1, keepdims=True))
    n1, n2, c1, c2 = step.index_in, step.index_out, np.abs(cosine[:, 0]), np.abs(behind[:, 0])
    # transmitted amplitudes: 2 n1 c1 / (n1 c1 + n2 c2) and 2 n1 c1 / (n2 c1 + n1 c2); power goes with n cosine
    ts, tp = 2 * n1 * c1 / (n1 * c1 + n2 * c2), 2 * n1 * c1 / (n2 * c1 + n1 * c2)
    return points, tangential + behind * normal, n2 * c2 / (n1 * c1) * (ts**2 + tp**2) / 2


def lens_of(scene) -> list[Step]:
    """The refractors of a scene, in the order of its file, met from their front."""
    steps = []
    for element in scene.element:
        front = unit(np.subtract(element.facing_mm, element.position_mm))
        radius = math.inf if element.radius_mm is None else element.radius_mm
        steps.append(
            Step(np.array(element.position_mm), front, radius, element.conic, element.index_front, element.index_back)
        )
    return steps


def axes_of(device) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y, z of a device: z from what it looks at to the device, x = unit(Y x z), y = z x x."""
    z = unit(np.subtract(device.position_mm, device.look_at_mm))
    x = unit(np.cross([0.0, 1.0, 0.0], z))
    return x, np.cross(z, x), z


def stop_passes(camera, points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Whether lines go through the camera's aperture [n]."""
    _, _, z = axes_of(camera)
    at = meet(Step(np.array(camera.position_mm), z), points, directions) - camera.position_mm
    return 2 * np.linalg.norm(at, axis=-1) <= camera.aperture_diameter_mm


@dataclass(frozen=True)
class Landed:
    """Light on the detector: flux_w [n] of each ray, place [n, 2] as fractional (column, row); pixel k is at k."""

    flux_w: np.ndarray
    place: np.ndarray


def from_one_pixel(scene, rays: int, random: np.random.Generator) -> Landed:
    """Light of a screen of one pixel by way of an axial mirror, the aperture and the scene's refractors.

    Rays go from points of the pixel to points of a disk under the mirror, evenly; L cos cos' / distance^2 per area of
    both is their flux.
    """
    screen, mirror, camera = scene.screen, scene.mirror, scene.camera
    x, y, z = axes_of(screen)
    u, v = (random.random((2, rays)) - 0.5) * screen.pitch_mm + np.array(screen.centre_offset_mm)[:, None]
    start = np.array(screen.position_mm) + u[:, None] * x + v[:, None] * y
    disk = 0.53 * mirror.diameter_mm  # wider than the mirror's rim, seen through z = 0
    radius, angle = disk * np.sqrt(random.random(rays)), 2 * np.pi * random.random(rays)
    way = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(rays)], -1) - start
    distance2 = np.sum(way * way, -1)
    direction = way / np.sqrt(distance2)[:, None]
    areas = screen.pitch_mm**2 * (np.pi * disk**2 / rays)
    flux = screen.radiance * areas * (direction @ z) * direction[:, 2] / distance2  # both cosines are negative
    surface = Step(np.zeros(3), np.array([0.0, 0.0, 1.0]), mirror.radius_mm, mirror.conic, mirror=True)
    points, direction, _ = pass_step(surface, start, direction)
    kept = 2 * np.hypot(points[:, 0], points[:, 1]) <= mirror.diameter_mm
    kept &= stop_passes(camera, points, direction)
    points, direction, flux = points[kept], direction[kept], flux[kept] * mirror.reflectance
    for step in lens_of(scene):
        points, direction, share = pass_step(step, points, direction)
        flux = flux * share
    return _on_detector(camera, points, direction, flux)


def _on_detector(camera, points: np.ndarray, direction: np.ndarray, flux: np.ndarray) -> Landed:
    """The image behind a lens stands head down; it is stored upright."""
    x, y, z = axes_of(camera)
    centre = np.array(camera.position_mm) + camera.detector_distance_mm * z
    at = meet(Step(centre, z), points, direction) - centre
    detector = camera.detector
    pixels = np.array(detector.pixels)
    place = (pixels - 1) / 2 - np.stack([at @ x, at @ y], -1) / detector.pitch_mm
    inside = ((place > -0.5) & (place < pixels - 0.5)).all(-1)
    return Landed(flux[inside], place[inside])
