"""Numba: one compiled function, parallel over screen pixels, float32 or float64, with one of three random numbers."""

from __future__ import annotations

import numba
import numpy as np

BLOCK = 512  # rays between the pass without branches and the one over those that came through
DIMENSIONS = 4
U32 = np.uint32
STEPS = tuple(np.uint64(step) for step in (0xDB4F0B9175AE2165, 0xBBE0563303A4615F, 0xA0F2EC75A1FE1576,
                                           0x89E182857D9ED689))  # fmt: skip  # of kernels/random/sampler_lattice.cl


@numba.njit(inline="always")
def mixed(h):
    """A 32-bit hash (MurmurHash3's last steps)."""
    h = U32(h)
    h ^= h >> U32(16)
    h = U32(h * U32(0x85EBCA6B))
    h ^= h >> U32(13)
    h = U32(h * U32(0xC2B2AE35))
    return U32(h ^ (h >> U32(16)))


@numba.njit(inline="always")
def words_hash(ray, source, key):
    """The cheapest words: a hash of a counter. All words_* return the four words of a ray; key: of the source."""
    c = U32(U32(4) * ray + key)
    return mixed(c), mixed(U32(c + U32(1))), mixed(U32(c + U32(2))), mixed(U32(c + U32(3)))


@numba.njit(inline="always")
def words_philox(ray, source, key):
    """Philox4x32-10 of counter (ray, 0, source, 0), as ours."""
    a, b, c, d = ray, U32(0), source, U32(0)
    key0, key1 = key, U32(0)
    for _ in range(10):
        one, two = np.uint64(a) * np.uint64(0xD2511F53), np.uint64(c) * np.uint64(0xCD9E8D57)
        a, b = U32(U32(two >> np.uint64(32)) ^ b ^ key0), U32(two)
        c, d = U32(U32(one >> np.uint64(32)) ^ d ^ key1), U32(one)
        key0, key1 = U32(key0 + U32(0x9E3779B9)), U32(key1 + U32(0xBB67AE85))
    return a, b, c, d


@numba.njit(inline="always")
def words_lattice(ray, source, key):
    """Our lattice: upper half of 64 bits of ray number times step, shifted at random by source and dimension."""
    n = np.uint64(ray)
    return (
        U32(U32((n * STEPS[0]) >> np.uint64(32)) + key),
        U32(U32((n * STEPS[1]) >> np.uint64(32)) + mixed(U32(key + U32(1)))),
        U32(U32((n * STEPS[2]) >> np.uint64(32)) + mixed(U32(key + U32(2)))),
        U32(U32((n * STEPS[3]) >> np.uint64(32)) + mixed(U32(key + U32(3)))),
    )


def compiled(real, fill):
    """A compiled function of (rays per screen pixel, seed, job) in float32 or float64, parallel over screen pixels.

    fill: one of words_*. Tuned: blocks of BLOCK rays; a pass without branches that the compiler vectorises, with
    polynomials for sine and cosine, and one over the rays that came through the aperture; an image for each thread;
    nothing in float64 unless asked for.
    """
    block, zero, half, one, two = BLOCK, real(0), real(0.5), real(1), real(2)
    scale = real(2.0**-24)

    @numba.njit(inline="always")
    def uniform(word):
        return (real(np.int32(word >> U32(8))) + half) * scale

    @numba.njit(parallel=True, error_model="numpy", fastmath=True)
    def run(of_pixel, seed, sources, s, c, radius, rim2, pitch, aperture2, focal, distance, pixel, n):
        images = np.zeros((numba.get_num_threads(), n * n), np.uint32)
        curvature, edge, centre = one / radius, real(n), half * real(n)
        for k in numba.prange(len(sources)):
            x0s, y0s, ll, mm, all_, aml, amm = sources[k]
            at_a, at_b = np.empty(block, real), np.empty(block, real)
            sl_a, sl_b, ok = np.empty(block, real), np.empty(block, real), np.empty(block, np.int32)
            index = np.empty(block + 1, np.int32)
            image = images[numba.get_thread_id()]
            key = mixed(U32(seed * 1000003 + k))
            for first in range(0, of_pixel, block):
                for j in range(block):
                    w0, w1, w2, w3 = fill(U32(first + j), U32(k), key)
                    u = x0s + pitch * (uniform(w0) - half)
                    v = y0s + pitch * (uniform(w1) - half)
                    r = np.sqrt(uniform(w2))
                    t = uniform(w3) - half
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
                    column = -(at_a[j] + distance * (sl_a[j] - at_a[j] / focal)) / pixel + centre
                    row = -(at_b[j] + distance * (sl_b[j] - at_b[j] / focal)) / pixel + centre
                    if zero <= column < edge and zero <= row < edge:
                        image[int(row) * n + int(column)] += np.uint32(1)
        return images

    def peer(of_pixel: int, seed: int, given: dict) -> np.ndarray:
        arrays = [given[name].astype(real) for name in ("sources", "screen", "camera")]
        scalars = [real(given[k]) for k in ("radius", "rim2", "pitch", "aperture2", "focal", "image", "pixel")]
        return run(of_pixel, seed, *arrays, *scalars, given["pixels"]).sum(0).reshape(given["pixels"], -1)

    return peer


hash_float32 = compiled(np.float32, words_hash)
philox_float32 = compiled(np.float32, words_philox)
lattice_float32 = compiled(np.float32, words_lattice)
hash_float64 = compiled(np.float64, words_hash)
philox_float64 = compiled(np.float64, words_philox)
lattice_float64 = compiled(np.float64, words_lattice)
