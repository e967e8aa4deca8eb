"""batoid: its sphere reflects, its plane is the aperture (C++, float64); emission and bins are NumPy's."""

from __future__ import annotations

import batoid
import numpy as np

from peers.numpy_peer import count_pixels, emit


def peer(of_pixel: int, seed: int, given: dict) -> np.ndarray:
    random = np.random.default_rng(seed)
    n, image = given["pixels"], np.zeros(given["pixels"] ** 2, np.int64)
    mirror, aperture = batoid.Sphere(given["radius"]), batoid.Plane()
    position, *axes = given["camera"]
    camera = batoid.CoordSys(position, np.array(axes).T)  # columns: the camera's axes
    for source in given["sources"]:
        start, direction = emit(random, source, of_pixel, given)
        rays = batoid.RayVector(*start.T.copy(), *direction.T.copy())
        mirror.reflect(rays)
        on = rays.x**2 + rays.y**2 <= given["rim2"]
        aperture.intersect(rays, coordSys=camera)
        through = on & (rays.x**2 + rays.y**2 <= given["aperture2"]) & ~rays.failed
        image += count_pixels(rays.x, rays.y, rays.vx / rays.vz, rays.vy / rays.vz, through, given)
    return image.reshape(n, n)
