"""Numba: one compiled function, parallel over screen pixels, float32 or float64."""

from __future__ import annotations

import numba
import numpy as np


def compiled(real):
    """A compiled function of (rays per screen pixel, seed, job) in float32 or float64, parallel over screen pixels.

    Tuned: blocks of 512 rays, a first loop without branches that the compiler vectorises, with a hash for random words
    and a polynomial for sine and cosine; a second one over the rays that came through the aperture.
    """
    block, half, one, two = 512, real(0.5), real(1), real(2)
    scale = real(2.0**-24)

    @numba.njit(inline="always")
    def uniform(counter):
        h = np.uint32(counter)
        h ^= h >> np.uint32(16)
        h = np.uint32(h * np.uint32(0x85EBCA6B))
        h ^= h >> np.uint32(13)
        h = np.uint32(h * np.uint32(0xC2B2AE35))
        h ^= h >> np.uint32(16)
        return (real(np.int32(h >> np.uint32(8))) + half) * scale

    @numba.njit(parallel=True, error_model="numpy", fastmath=True)
    def run(of_pixel, seed, sources, s, c, radius, rim2, pitch, aperture2, focal, distance, pixel, n):
        images = np.zeros((len(sources), n * n), np.uint32)
        curvature = one / radius
        for k in numba.prange(len(sources)):
            x0s, y0s, ll, mm, all_, aml, amm = sources[k]
            at_a, at_b = np.empty(block, real), np.empty(block, real)
            sl_a, sl_b, ok = np.empty(block, real), np.empty(block, real), np.empty(block, np.int32)
            index = np.empty(block + 1, np.int32)
            image = np.zeros(n * n, np.uint32)
            key = np.uint32(uniform(np.uint32(seed * 1000003 + k)) * real(2.0**31))
            for first in range(0, of_pixel, block):
                for j in range(block):
                    counter = np.uint32(np.uint32(4) * np.uint32(first + j) + key)
                    r = np.sqrt(uniform(counter))
                    t = uniform(counter + np.uint32(1)) - half
                    u = x0s + pitch * (uniform(counter + np.uint32(2)) - half)
                    v = y0s + pitch * (uniform(counter + np.uint32(3)) - half)
                    h = t * t
                    sine = t * ((((real(0.0776576603) * h - real(0.598291286)) * h + real(2.55007752)) * h
                                 - real(5.16771009)) * h + real(3.14159264))  # fmt: skip
                    cosine = (((((real(-0.0243963243) * h + real(0.234937314)) * h - real(1.335212)) * h
                                + real(4.05870916)) * h - real(4.93480214)) * h + one)  # fmt: skip
                    disk_x, disk_y = r * (one - two * sine * sine), r * two * sine * cosine
                    l, m = ll + all_ * disk_x, mm + aml * disk_x + amm * disk_y
                    w = -np.sqrt(one - l * l - m * m)
                    inverse = one / (l * s[1, 2] + m * s[2, 2] + w * s[3, 2])
                    p = (l * s[1, 0] + m * s[2, 0] + w * s[3, 0]) * inverse
                    q = (l * s[1, 1] + m * s[2, 1] + w * s[3, 1]) * inverse
                    z0 = s[0, 2] + u * s[1, 2] + v * s[2, 2]
                    x0 = s[0, 0] + u * s[1, 0] + v * s[2, 0] - z0 * p
                    y0 = s[0, 1] + u * s[1, 1] + v * s[2, 1] - z0 * q
                    cc = curvature * (x0 * x0 + y0 * y0)
                    b = one - curvature * (x0 * p + y0 * q)
                    z = cc / (b + np.sqrt(b * b - curvature * (p * p + q * q + one) * cc))
                    x, y = x0 + p * z, y0 + q * z
                    nx, ny, nz = -curvature * x, -curvature * y, one - curvature * z
                    dn = two * (p * nx + q * ny + nz)
                    ox, oy, oz = dn * nx - p, dn * ny - q, dn * nz - one
                    inverse = one / (ox * c[3, 0] + oy * c[3, 1] + oz * c[3, 2])
                    slope_a = (ox * c[1, 0] + oy * c[1, 1] + oz * c[1, 2]) * inverse
                    slope_b = (ox * c[2, 0] + oy * c[2, 1] + oz * c[2, 2]) * inverse
                    px, py, pz = x - c[0, 0], y - c[0, 1], z - c[0, 2]
                    depth = px * c[3, 0] + py * c[3, 1] + pz * c[3, 2]
                    a = px * c[1, 0] + py * c[1, 1] + pz * c[1, 2] - depth * slope_a
                    e = px * c[2, 0] + py * c[2, 1] + pz * c[2, 2] - depth * slope_b
                    ok[j] = (x * x + y * y <= rim2) & (a * a + e * e <= aperture2)
                    at_a[j], at_b[j], sl_a[j], sl_b[j] = a, e, slope_a, slope_b
                through = 0
                for j in range(block):
                    index[through] = j
                    through += ok[j]
                for i in range(through):
                    j = index[i]
                    column = -(at_a[j] + distance * (sl_a[j] - at_a[j] / focal)) / pixel + half * n
                    row = -(at_b[j] + distance * (sl_b[j] - at_b[j] / focal)) / pixel + half * n
                    if 0 <= column < n and 0 <= row < n:
                        image[int(row) * n + int(column)] += np.uint32(1)
            images[k] = image
        return images

    def peer(of_pixel: int, seed: int, given: dict) -> np.ndarray:
        arrays = [given[name].astype(real) for name in ("sources", "screen", "camera")]
        scalars = [real(given[k]) for k in ("radius", "rim2", "pitch", "aperture2", "focal", "image", "pixel")]
        return run(of_pixel, seed, *arrays, *scalars, given["pixels"]).sum(0).reshape(given["pixels"], -1)

    return peer


peer_float32, peer_float64 = compiled(np.float32), compiled(np.float64)
