"""NumPy: whole arrays of one screen pixel's rays at a time, float64. Emission and lens serve other peers too."""

from __future__ import annotations

import numpy as np


def emit(random: np.random.Generator, source: np.ndarray, count: int, given: dict) -> tuple[np.ndarray, np.ndarray]:
    """Starting points and unit directions [count, 3] in world coordinates of one screen pixel's rays."""
    x, y, l0, m0, ll, ml, mm = source
    position, *axes = given["screen"]
    radius, angle = np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    disk_x, disk_y = radius * np.cos(angle), radius * np.sin(angle)
    l, m = l0 + ll * disk_x, m0 + ml * disk_x + mm * disk_y
    u, v = (c + given["pitch"] * (random.random(count) - 0.5) for c in (x, y))
    start = position + np.multiply.outer(u, axes[0]) + np.multiply.outer(v, axes[1])
    direction = np.multiply.outer(l, axes[0]) + np.multiply.outer(m, axes[1])
    direction -= np.multiply.outer(np.sqrt(1 - l * l - m * m), axes[2])
    return start, direction


def count_pixels(a, b, slope_a, slope_b, through, given: dict) -> np.ndarray:
    """Counts [pixels^2] of the rays that came through the aperture, behind the paraxial lens.

    a, b: positions on the aperture in the camera's frame; slope_a, slope_b: of the rays there; through: [rays] bool.
    """
    n = given["pixels"]
    column, row = (
        np.floor(-(at + given["image"] * (slope - at / given["focal"])) / given["pixel"] + n / 2)
        for at, slope in ((a[through], slope_a[through]), (b[through], slope_b[through]))
    )
    inside = (column >= 0) & (column < n) & (row >= 0) & (row < n)
    return np.bincount((row * n + column)[inside].astype(int), minlength=n * n)


def arrive(point: np.ndarray, direction: np.ndarray, given: dict) -> tuple[np.ndarray, ...]:
    """Positions and slopes (a, b, slope_a, slope_b) on the aperture's plane, in the camera's frame."""
    position, *axes = given["camera"]
    rel, out = (point - position) @ np.array(axes).T, direction @ np.array(axes).T
    slope_a, slope_b = out[:, 0] / out[:, 2], out[:, 1] / out[:, 2]
    return rel[:, 0] - rel[:, 2] * slope_a, rel[:, 1] - rel[:, 2] * slope_b, slope_a, slope_b


def peer(of_pixel: int, seed: int, given: dict) -> np.ndarray:
    random = np.random.default_rng(seed)
    n, image = given["pixels"], np.zeros(given["pixels"] ** 2, np.int64)
    for source in given["sources"]:
        start, d = emit(random, source, of_pixel, given)
        start[:, 2] -= given["radius"]  # from the sphere's centre
        along = np.einsum("ij,ij->i", start, d)
        t = -along + np.sqrt(along**2 - np.einsum("ij,ij->i", start, start) + given["radius"] ** 2)
        point = start + t[:, None] * d
        normal = -point / given["radius"]
        d -= 2 * np.einsum("ij,ij->i", d, normal)[:, None] * normal
        on = point[:, 0] ** 2 + point[:, 1] ** 2 <= given["rim2"]
        point[:, 2] += given["radius"]
        a, b, slope_a, slope_b = arrive(point, d, given)
        image += count_pixels(a, b, slope_a, slope_b, on & (a * a + b * b <= given["aperture2"]), given)
    return image.reshape(n, n)
