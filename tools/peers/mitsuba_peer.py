"""Mitsuba 3 (llvm_ad_mono): its ray casting against its analytic sphere; emission, camera and bins in Dr.Jit.

What is timed is a general ray caster (Embree, called for packets of rays) in place of one formula. Radiance, textures
and materials take no part. Single precision, PCG32 random numbers.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_mono")

from drjit.llvm import Array3f, Bool  # noqa: E402  after Mitsuba has chosen its types

from peers import drjit_peer  # noqa: E402


def peer(of_pixel: int, seed: int, given: dict) -> np.ndarray:
    centre, radius = [0.0, 0.0, given["radius"]], given["radius"]
    scene = mi.load_dict({"type": "scene", "mirror": {"type": "sphere", "center": centre, "radius": radius}})

    def send(start: Array3f, direction: Array3f, given: dict) -> tuple[tuple[Array3f, Array3f], Bool]:
        rays = mi.Ray3f(mi.Point3f(start), mi.Vector3f(direction))
        found = scene.ray_intersect(rays, mi.RayFlags.Minimal, True)
        point, normal = Array3f(dr.detach(found.p)), Array3f(dr.detach(found.n))
        on = point.x * point.x + point.y * point.y <= given["rim2"]
        return (point, direction - 2 * dr.dot(direction, normal) * normal), on

    return drjit_peer.peer(of_pixel, seed, given, send)
