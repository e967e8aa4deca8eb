"""Directions in which the non-sequential estimator sends light from the screen.

The cone that covers the mirror is enough for a bare test. Elements can bring light from elsewhere: a wedge bends light
from beside the cone onto the mirror, a white panel beside the mirror scatters it into the camera. Then rays go into
several cones, the last of which is the whole half space before the screen. A ray's weight is the inverse of the
density of all cones together at its direction (the balance heuristic: E. Veach, L. J. Guibas, SIGGRAPH 95, 419). So no
direction counts twice and none is missed, wherever the other cones lie: they only say where rays are worth most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from irtscots_cl.optics.aim import Aim, covering_ellipses
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.walk import distance_to, walk
from irtscots_cl.optics.screen_facets import ScreenFacets, pixel_centres

FIRST_RING, RING_GROWTH = 2e-4, 1.5  # relative distance beyond the mirror's cone, of rings of directions
RINGS, SPOKES = 30, 24
INNER = (0.2, 0.5, 0.8, 0.98)  # relative radii in an element's aperture, of points that directions lead to
GRAZING = 0.9999  # largest square of a direction's sine that is looked at
MAX_STEPS = 12
VARIANTS = 3  # the intended way, and others on which refractors reflect half of the rays
HALF_SPACE, ELEMENTS = 1 / 16, 1 / 4  # shares of the rays into the half space, and into cones to elements
WIDE = 0.3  # of the half space: cones beyond it are left to it
OF_MIRROR = 1 / 3  # of the rest into the mirror's own cone, where there is a wider one
FIELD = 2.0  # in half diagonals of the detector: slope at the camera up to which light counts


@dataclass(frozen=True)
class Emission:
    """Cones, each as ellipses of all screen pixels, and the shares of the rays that go into them [cones].

    The first is the mirror's. With more than one, the last is the half space: all light of the screen is then traced.
    """

    cones: tuple[Aim, ...]
    shares: np.ndarray


def plan_emission(
    chief: ChiefRays, components: tuple[Component, ...], measuring: tuple[str, ...], aim: Aim
) -> Emission:
    """The cones that a scene's light needs. aim: the mirror's cone. measuring: names of elements that measure light."""
    seen = _Outside(chief, components, measuring, aim)
    first, widest = seen.found()
    if not first:
        return Emission((aim,), np.ones(1))
    cones = [aim] if widest <= 1 else [aim, _within(Aim(aim.centre, aim.root * widest, aim.share))]
    found = {number: _to_element(chief, components[number]) for number in sorted(first)}
    to_elements = [cone for cone in found.values() if cone is not None]
    # light that scatters close to the screen comes from all directions
    wide = any(cone is None and number in seen.ends for number, cone in found.items())
    half_space = ELEMENTS if wide else HALF_SPACE
    rest = 1 - half_space - (ELEMENTS if to_elements else 0.0)
    shares = [rest] if len(cones) == 1 else [rest * OF_MIRROR, rest * (1 - OF_MIRROR)]
    shares += [ELEMENTS / max(len(to_elements), 1)] * len(to_elements) + [half_space]
    count = len(aim.centre)
    everywhere = Aim(np.zeros((count, 2)), np.tile(np.eye(2), (count, 1, 1)), 1.0)
    return Emission((*cones, *to_elements, everywhere), np.array(shares))


class _Outside:
    """Rays from some screen pixels in directions outside the mirror's cone, and what they come by."""

    def __init__(self, chief: ChiefRays, components: tuple[Component, ...], measuring: tuple[str, ...], aim: Aim):
        self.chief, self.components, self.aim = chief, components, aim
        self.stop = next(k for k, component in enumerate(components) if component.name == "stop")
        self.ends = {0} | {k for k, component in enumerate(components)
                           if component.scatter is not None or component.name in measuring}  # fmt: skip
        columns, rows = chief.scene.screen.pixels
        corners = [0, columns - 1, (rows // 2) * columns + columns // 2, (rows - 1) * columns, rows * columns - 1]
        self.pixels = np.unique(corners)
        self.starts = chief.screen_frame.to_world(*(c[self.pixels] for c in pixel_centres(chief)))

    def found(self) -> tuple[set[int], float]:
        """Elements that light outside the cone meets first and goes on from to where it counts: none, if the cone is
        enough. And how much wider a cone must be to hold the light that elements bend onto the mirror: 1, if there is
        none.
        """
        first, widest = self._by_elements() if self._further() else (set(), 1.0)
        return (first | {self.stop} if self._sees_screen() else first), widest

    def _further(self) -> list[int]:
        return [k for k, component in enumerate(self.components)
                if component.name not in ("mirror", "stop", "lens", "detector")]  # fmt: skip

    def _by_elements(self) -> tuple[set[int], float]:
        pixel, ring, ways = self._directions()
        random = np.random.default_rng(0)
        first, widest = set(), 1.0
        for variant in range(VARIANTS):
            met, counts, on_mirror = self._follow(pixel, ways, None if variant == 0 else random)
            first |= set(met[counts].tolist())
            if variant == 0:
                reached = np.unique(ring[on_mirror & (ring >= 0)])
                # without gaps from the cone on: light that comes by the mirror from elsewhere needs no wider cone
                unbroken = int(np.sum(reached == np.arange(len(reached))))
                widest = 1 + FIRST_RING * RING_GROWTH**unbroken if unbroken else 1.0
        return first - {self.stop}, widest

    def _directions(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places in pixels [n], rings about the cone (-1: towards an element) [n], unit directions [n, 3]."""
        radius = 1 + FIRST_RING * RING_GROWTH ** np.arange(RINGS)
        angle = np.arange(SPOKES) * (2 * np.pi / SPOKES)
        disk = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], -1).reshape(-1, 2)
        pixels, rings, cosines = [], [], []
        for k, pixel in enumerate(self.pixels):
            around = self.aim.centre[pixel] + disk @ self.aim.root[pixel].T
            points = np.concatenate([_points_of(self.components[n]) for n in self._further()])
            to = (points - self.starts[k]) @ self.chief.screen_frame.axes.T
            to = to[to[:, 2] < 0]
            towards = to[:, :2] / np.linalg.norm(to, axis=-1, keepdims=True)
            towards = towards[~self.aim.holds(np.full(len(towards), pixel), towards)]
            cosines.append(np.concatenate([around, towards]))
            rings.append(np.concatenate([np.repeat(np.arange(RINGS), SPOKES), np.full(len(towards), -1)]))
            pixels.append(np.full(len(cosines[-1]), k))
        pixel, ring, (l, m) = np.concatenate(pixels), np.concatenate(rings), np.concatenate(cosines).T
        left = 1 - l * l - m * m
        use = left > 1 - GRAZING
        n = -np.sqrt(np.where(use, left, 1.0))
        return pixel[use], ring[use], (np.stack([l, m, n], -1) @ self.chief.screen_frame.axes)[use]

    def _follow(self, pixel, ways, random) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The first element that each ray meets [n], whether the ray comes to where light counts, and to the mirror."""
        first, counts, on_mirror = np.full(len(ways), -1), np.zeros(len(ways), bool), np.zeros(len(ways), bool)
        reflects = None if random is None else lambda step, rays: random.random(len(rays)) < 0.5
        for visit in walk(self.components, self.starts[pixel], ways, MAX_STEPS, reflects=reflects):
            new = first[visit.rays] < 0
            first[visit.rays[new]] = visit.numbers[new]
            arrives = np.isin(visit.numbers, list(self.ends))
            arrives |= (visit.numbers == self.stop) & ~new & self._in_field(visit.along)
            counts[visit.rays[arrives]] = True
            on_mirror[visit.rays[visit.numbers == 0]] = True
        # outside its cone no light comes straight to the mirror but by rounding
        counts &= first != 0
        return first, counts, on_mirror & (first != 0)

    def _in_field(self, along: np.ndarray) -> np.ndarray:
        """Whether light of these directions comes to the camera from the front, near the field of its detector."""
        frame, camera, model = self.chief.camera_frame, self.chief.scene.camera, self.chief.camera_model
        local = along @ frame.axes.T
        pixels = np.array(camera.detector.pixels)
        off_axis = np.abs(model.centre[::-1] - (pixels - 1) / 2)  # the detector's middle, in pixels
        half = float(np.hypot(*((pixels / 2 + off_axis) * model.pitch_mm)))
        reach = (half + camera.aperture_diameter_mm) / (camera.detector_distance_mm or camera.image_distance_mm)
        return (local[..., 2] > 0) & (np.hypot(local[..., 0], local[..., 1]) <= FIELD * reach * local[..., 2])

    def _sees_screen(self) -> bool:
        """Whether the camera has the lit side of the screen itself in its field."""
        to = self.chief.camera_frame.position_mm - self.starts
        distance = np.linalg.norm(to, axis=-1)
        ways = to / distance[:, None]
        lit = ways @ self.chief.screen_frame.axes[2] < -np.sqrt(1 - GRAZING)
        free = np.ones(len(to), bool)
        for component in self.components:
            if component.name not in ("stop", "lens"):
                free &= distance_to(component, self.starts, ways, np.zeros(len(to), bool)) > distance
        return bool(np.any(lit & free & self._in_field(ways)))


def _points_of(component: Component) -> np.ndarray:
    """Points [n, 3] in an element's aperture, in the world."""
    rim = _rim(component)
    points = np.concatenate([rim * part for part in INNER])
    radius = np.hypot(*points.T)
    points = points[radius >= component.inner_mm]
    if not len(points):
        points = rim * (component.inner_mm / np.hypot(*rim.T).max() + 1) / 2
    return _on_surface(component, points)


def _rim(component: Component) -> np.ndarray:
    """Points [n, 2] of the aperture's outer edge in the element's frame."""
    angle = np.arange(SPOKES) * (2 * np.pi / SPOKES)
    circle = np.stack([np.cos(angle), np.sin(angle)], -1)
    if np.isfinite(component.outer_mm):
        return component.outer_mm * circle
    return np.array(component.half_mm) * circle / np.abs(circle).max(-1, keepdims=True)


def _on_surface(component: Component, points: np.ndarray) -> np.ndarray:
    """Points [n, 3] of the surface in the world above points [n, 2] of the element's frame."""
    z = np.nan_to_num(component.quadric.meet(points[:, 0], points[:, 1], 0.0, 0.0))
    return component.frame.position_mm + np.column_stack([points, z]) @ component.frame.axes


def _to_element(chief: ChiefRays, component: Component) -> Aim | None:
    """Ellipses that cover an element. None: hardly less than the half space, as if it reaches to the screen's plane."""
    rim = _rim(component) if component.name != "stop" else component.inner_mm / component.outer_mm * _rim(component)
    x, y = pixel_centres(chief)
    frame, half_pixel, points = chief.screen_frame, ScreenFacets.of(chief).half_diagonal, _on_surface(component, rim)
    centre, root = np.empty((len(x), 2)), np.empty((len(x), 2, 2))
    try:
        with np.errstate(invalid="ignore", divide="ignore"):
            for part in np.array_split(np.arange(len(x)), len(x) // 4096 + 1):
                centre[part], root[part] = covering_ellipses(frame, points, x[part], y[part], half_pixel)
    except np.linalg.LinAlgError:  # no larger than rounding
        return None
    depth = (points - frame.position_mm) @ frame.axes[2]
    aim = Aim(centre, root, 1.0)
    if depth.max() >= 0 or not np.isfinite(root).all():
        return None
    aim = _within(aim)
    return None if aim.area.mean() > WIDE * np.pi else aim


def _within(aim: Aim) -> Aim:
    """The ellipses, with the half space in place of those that reach beyond it."""
    angle = np.arange(SPOKES) * (2 * np.pi / SPOKES)
    circle = np.stack([np.cos(angle), np.sin(angle)], -1)
    reach = np.linalg.norm(aim.centre[:, None] + circle @ aim.root.transpose(0, 2, 1), axis=-1).max(1)
    beyond = ~(reach < np.sqrt(GRAZING))
    centre, root = aim.centre.copy(), aim.root.copy()
    centre[beyond], root[beyond] = 0.0, np.eye(2)
    return Aim(centre, root, aim.share)
