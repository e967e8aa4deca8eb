#!/usr/bin/env python3
"""The same job in other tools, in one run: rays launched per second, as ratios to this program's forward estimator.

The job: the preset `sphere`. Rays leave all screen pixels, uniform over the pixel and over the aim's ellipse in
direction cosines (Lambertian), are reflected by the sphere and counted by detector pixel if they pass the aperture.
A peer's fraction of rays that are detected must equal ours within its Poisson error, or it gets no row.
Peers: NumPy, and Numba (parallel, float32 and float64) where it is installed: pip install numba.
"""

from __future__ import annotations

import json
import os
import time

import numpy as np

from irtscots_cl.calibration import calibrate
from irtscots_cl.device import select_device
from irtscots_cl.packing import emitters
from irtscots_cl.presets import load_scene
from irtscots_cl.tracer import TraceOptions, Tracer, trace

ROUNDS = 5
SIGMAS = 5  # of a hit fraction's difference from ours: a correct peer fails with a chance of 6e-7


def job() -> dict:
    """The scene's numbers, from this program's own description but traced by nobody here."""
    scene = load_scene("sphere")
    calibration = calibrate(scene)
    sources, _ = emitters(calibration, "fp64", 1.0)
    return {
        "radius": scene.mirror.radius_mm,
        "rim2": (scene.mirror.diameter_mm / 2) ** 2,
        "pitch": scene.screen.pitch_mm,
        "sources": np.array([list(source) for source in sources]),  # x, y, centre l, m, aim ll, ml, mm
        "screen": np.vstack([calibration.screen_frame.position_mm, calibration.screen_frame.axes]),
        "camera": np.vstack([calibration.camera_frame.position_mm, calibration.camera_frame.axes]),
        "aperture2": (scene.camera.aperture_diameter_mm / 2) ** 2,
        "focal": scene.camera.focal_length_mm,
        "image": scene.camera.image_distance_mm,
        "pixel": scene.camera.detector.pitch_mm,
        "pixels": scene.camera.detector.pixels[0],
    }


def numpy_peer(of_pixel: int, seed: int, given: dict) -> np.ndarray:
    """Counts [pixels, pixels] of of_pixel rays per screen pixel, whole arrays at a time."""
    random = np.random.default_rng(seed)
    n, image = given["pixels"], np.zeros(given["pixels"] ** 2, np.int64)
    (sp, *saxes), (cp, *caxes) = given["screen"], given["camera"]
    for x, y, l0, m0, ll, ml, mm in given["sources"]:
        radius, angle = np.sqrt(random.random(of_pixel)), 2 * np.pi * random.random(of_pixel)
        disk_x, disk_y = radius * np.cos(angle), radius * np.sin(angle)
        l, m = l0 + ll * disk_x, m0 + ml * disk_x + mm * disk_y
        u, v = (c + given["pitch"] * (random.random(of_pixel) - 0.5) for c in (x, y))
        start = sp + np.multiply.outer(u, saxes[0]) + np.multiply.outer(v, saxes[1])
        d = np.multiply.outer(l, saxes[0]) + np.multiply.outer(m, saxes[1])
        d -= np.multiply.outer(np.sqrt(1 - l * l - m * m), saxes[2])
        start[:, 2] -= given["radius"]  # from the sphere's centre
        along = np.einsum("ij,ij->i", start, d)
        t = -along + np.sqrt(along**2 - np.einsum("ij,ij->i", start, start) + given["radius"] ** 2)
        point = start + t[:, None] * d
        normal = -point / given["radius"]
        d -= 2 * np.einsum("ij,ij->i", d, normal)[:, None] * normal
        on = point[:, 0] ** 2 + point[:, 1] ** 2 <= given["rim2"]
        point[:, 2] += given["radius"]
        rel, out = (point - cp) @ np.array(caxes).T, d @ np.array(caxes).T
        slope_a, slope_b = out[:, 0] / out[:, 2], out[:, 1] / out[:, 2]
        a, b = rel[:, 0] - rel[:, 2] * slope_a, rel[:, 1] - rel[:, 2] * slope_b
        on &= a * a + b * b <= given["aperture2"]
        column, row = (
            np.floor(-(at + given["image"] * (slope - at / given["focal"])) / given["pixel"] + n / 2)
            for at, slope in ((a[on], slope_a[on]), (b[on], slope_b[on]))
        )
        inside = (column >= 0) & (column < n) & (row >= 0) & (row < n)
        image += np.bincount((row * n + column)[inside].astype(int), minlength=n * n)
    return image.reshape(n, n)


def numba_peer(real):
    """A compiled function of (rays per screen pixel, seed, job) in float32 or float64, parallel over screen pixels.

    Tuned: blocks of 512 rays, a first loop without branches that the compiler vectorises, with a hash for random words
    and a polynomial for sine and cosine; a second one over the rays that came through the aperture.
    """
    import numba

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


def peers() -> dict:
    """Peers by name, each with the rays per screen pixel of one timed call."""
    found = {"NumPy float64": (numpy_peer, 20_000)}
    try:
        found["Numba float32"] = (numba_peer(np.float32), 409_600)
        found["Numba float64"] = (numba_peer(np.float64), 409_600)
    except ImportError:
        print("Numba is not installed: no row (pip install numba)")
    return found


def main() -> None:
    device, given = select_device(), job()
    ours = trace(load_scene("sphere"), device=device, estimator="forward", rays_per_pixel=400_000, replicates=1)
    fraction = ours.ledger["detected"] / ours.rays_total
    tracers = {
        f"irtscots-cl {sampler}": Tracer(calibrate(load_scene("sphere")), device, TraceOptions("forward", sampler))
        for sampler in ("philox", "sobol", "lattice")
    }
    found, streams = peers(), len(given["sources"])
    for name, (peer, _) in list(found.items()):
        rays = 4096 * streams
        hits = int(peer(4096, 7, given).sum())  # also compiles
        sigma = np.sqrt(fraction * (1 / rays + 1 / ours.rays_total)) * SIGMAS
        print(f"{name}: detects {hits / rays:.5f} of its rays, ours {fraction:.5f} +- {sigma / SIGMAS:.5f}")
        if abs(hits / rays - fraction) > sigma:
            print(f"{name}: not the same work, no row")
            del found[name]
    rates: dict[str, list[float]] = {name: [] for name in (*tracers, *found)}
    for seed in range(ROUNDS):
        for name, tracer in tracers.items():
            rates[name].append(tracer.throughput(400_000 * streams))
        for name, (peer, of_pixel) in found.items():
            started = time.perf_counter()
            peer(of_pixel, seed, given)
            rates[name].append(of_pixel * streams / (time.perf_counter() - started))
    base = np.median(rates["irtscots-cl philox"])
    rows = {name: {"rays_per_second": float(np.median(r)), "lowest": min(r), "highest": max(r),
                   "of_ours_with_philox": float(np.median(r) / base)} for name, r in rates.items()}  # fmt: skip
    for name, row in rows.items():
        print(f"{name:22} {row['rays_per_second'] / 1e6:8.1f} M rays/s   {row['of_ours_with_philox']:.3f}")
    print(json.dumps({"device": device.name, "cores": os.cpu_count(), "rows": rows}))


if __name__ == "__main__":
    main()
