"""What a small bend of a chief ray somewhere on its way does to the place that a pixel sees.

Rays go backwards here: camera, mirror, screen. A ray that is bent by an angle at a distance z from the camera goes on
as one that starts at the camera, displaced by -z times that angle, in the new direction; beyond the mirror, a bend at a
distance t before the screen displaces the ray there by t times the angle. Derivatives are those of exact rays.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from irtscots_cl.calibration.seen_pixels import SeenPixels
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.setup import Setup

STEP_MM = 0.1  # of the differences
STEP_RAD = 1e-5
LAYERS = (1 - np.array([1, -1]) / np.sqrt(3)) / 2  # of each leg, from the mirror: Gauss's points, for squares of levers


@dataclass(frozen=True)
class RayBends:
    """Chief rays of n pixels. camera_mm: [3] their start; points_mm: [n, 3] on the mirror; screen_mm: [n, 3] ends."""

    setup: Setup = field(repr=False)
    camera_mm: FloatArray
    points_mm: FloatArray = field(repr=False)
    screen_mm: FloatArray = field(repr=False)

    @classmethod
    def of(cls, setup: Setup, seen: SeenPixels) -> RayBends:
        chief = setup.chief_rays
        points, u, v = chief.reverse(*seen.pixels)
        return cls(setup, chief.camera_frame.position_mm, points, chief.screen_model.to_world(u, v))

    @cached_property
    def lengths_mm(self) -> tuple[FloatArray, FloatArray]:
        """Lengths [n] of the ways from the camera to the mirror and from there to the screen."""
        return np.linalg.norm(self._there, axis=-1), np.linalg.norm(self.screen_mm - self.points_mm, axis=-1)

    @property
    def _there(self) -> FloatArray:
        return self.points_mm - self.camera_mm

    def camera_leg(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Changes [2, n] of the places per mm and per rad by which the ray starts displaced, or turned, along a world
        vector [3], of which the part across the ray counts."""
        direction = self._there / self.lengths_mm[0][:, None]
        across = _across(vector, direction)

        def place(start: FloatArray, along: FloatArray) -> FloatArray:
            points, outgoing = self.setup.chief_rays.surface.meet(start, along)
            return np.stack(self.setup.chief_rays.screen_model.arrive(points, outgoing))

        start = np.broadcast_to(self.camera_mm, direction.shape)
        by_mm = place(start + STEP_MM * across, direction) - place(start - STEP_MM * across, direction)
        by_rad = place(start, direction + STEP_RAD * across) - place(start, direction - STEP_RAD * across)
        return by_mm / (2 * STEP_MM), by_rad / (2 * STEP_RAD)

    def screen_leg(self, vector: FloatArray) -> FloatArray:
        """Changes [2, n] of the places per mm by which the ray to the screen is displaced along a world vector."""
        way = self.screen_mm - self.points_mm
        across = _across(vector, way / self.lengths_mm[1][:, None])
        arrive = self.setup.chief_rays.screen_model.arrive
        up, down = (np.stack(arrive(self.points_mm + sign * STEP_MM * across, way)) for sign in (1, -1))
        found: FloatArray = (up - down) / (2 * STEP_MM)
        return found

    @cached_property
    def axes(self) -> FloatArray:
        """Unit vectors [2, 3] across the mean of both legs, of which the first has no part along the world's y."""
        middle, end = self.points_mm.mean(0), self.screen_mm.mean(0)
        legs = [(to - middle) / np.linalg.norm(to - middle) for to in (self.camera_mm, end)]
        along = sum(legs) if np.linalg.norm(sum(legs)) > 1e-3 else legs[0]
        first = np.cross([0.0, 1.0, 0.0], along)
        if np.linalg.norm(first) < 1e-3 * np.linalg.norm(along):  # along the world's y
            first = np.array([1.0, 0.0, 0.0])
        second = np.cross(along, first)
        return np.stack([first / np.linalg.norm(first), second / np.linalg.norm(second)])

    @cached_property
    def crossings_mm(self) -> FloatArray:
        """Places [layers, 2, 2, n] along the axes at which both legs cross the layers of air; the camera's first."""
        ends = (self.camera_mm, self.screen_mm)
        return np.stack([
            np.stack([self.axes @ (self.points_mm + part * (end - self.points_mm)).T for end in ends])
            for part in LAYERS
        ])  # fmt: skip

    @cached_property
    def levers_mm(self) -> FloatArray:
        """Changes [layers, 2, 2, 2, n] of the places (u, v) per rad of a bend in each layer: of its layer, its leg,
        the axis along which it is."""
        camera, screen = self.lengths_mm
        found = np.empty((len(LAYERS), 2, 2, 2, len(camera)))
        for k, axis in enumerate(self.axes):
            by_mm, by_rad = self.camera_leg(axis)
            at_screen = self.screen_leg(axis)
            for layer, part in enumerate(LAYERS):
                found[layer, 0, k] = by_rad - (1 - part) * camera * by_mm
                found[layer, 1, k] = (1 - part) * screen * at_screen
        return found


def _across(vector: FloatArray, direction: FloatArray) -> FloatArray:
    """Parts [n, 3] of a vector [3] across unit directions [n, 3]."""
    found: FloatArray = vector - direction * (direction @ vector)[:, None]
    return found
