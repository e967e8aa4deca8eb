"""Dr.Jit with its LLVM backend: one compiled kernel over all rays, float32, PCG32 random numbers.

Tuned: a lane traces many rays of one screen pixel in a loop that Dr.Jit records, not unrolls, so that its random state
is set up once; rays are counted by atomics (see count).
"""

from __future__ import annotations

import drjit as dr
import numpy as np
from drjit.llvm import PCG32, Array3f, Bool, Float, UInt32

LANES_PER_PIXEL = 1024


def peer(of_pixel: int, seed: int, given: dict, send=None) -> np.ndarray:
    """send: traces rays (start, direction, job) to the mirror and back, as `reflect` does; Mitsuba has its own.

    Raises ValueError if of_pixel is no multiple of LANES_PER_PIXEL.
    """
    lanes, send = LANES_PER_PIXEL, send or reflect
    if of_pixel % lanes:
        raise ValueError(f"rays per screen pixel = {of_pixel}: must be a multiple of {lanes}")
    n, sources = given["pixels"], len(given["sources"])
    index = dr.arange(UInt32, sources * lanes)
    pixel = index // lanes
    source = [dr.gather(Float, Float(column.astype(np.float32)), pixel) for column in given["sources"].T]
    random = PCG32(size=sources * lanes, initstate=dr.opaque(UInt32, seed + 1))
    image = dr.zeros(UInt32, n * n)
    rays = dr.opaque(UInt32, of_pixel // lanes)  # not a literal: another number of rays compiles nothing anew

    def body(k, random):
        start, direction = emit(random, source, given)
        hit, on = send(start, direction, given)
        count(image, *hit, on, given)
        return k + 1, random

    dr.while_loop((UInt32(0), random), lambda k, random: k < rays, body)
    dr.eval(image)
    return np.array(image).reshape(n, n)


def emit(random, source, given: dict) -> tuple[Array3f, Array3f]:
    """Starting points and unit directions in world coordinates."""
    x, y, l0, m0, ll, ml, mm = source
    position, axis_x, axis_y, axis_z = (Array3f(*map(float, row)) for row in given["screen"])
    radius = dr.sqrt(random.next_float32())
    sine, cosine = dr.sincos(2 * dr.pi * random.next_float32())
    disk_x, disk_y = radius * cosine, radius * sine
    l, m = dr.fma(ll, disk_x, l0), dr.fma(ml, disk_x, dr.fma(mm, disk_y, m0))
    u = x + given["pitch"] * (random.next_float32() - 0.5)
    v = y + given["pitch"] * (random.next_float32() - 0.5)
    start = position + u * axis_x + v * axis_y
    return start, l * axis_x + m * axis_y - dr.sqrt(1 - l * l - m * m) * axis_z


def reflect(start: Array3f, d: Array3f, given: dict) -> tuple[tuple[Array3f, Array3f], Bool]:
    """Points and directions after reflection by the sphere 2 R z = x^2 + y^2 + z^2, and whether within the rim."""
    curvature = 1 / given["radius"]
    p, q = d.x / d.z, d.y / d.z
    x0, y0 = start.x - start.z * p, start.y - start.z * q
    c = curvature * (x0 * x0 + y0 * y0)
    b = 1 - curvature * (x0 * p + y0 * q)
    z = c / (b + dr.sqrt(b * b - curvature * (p * p + q * q + 1) * c))
    point = Array3f(x0 + p * z, y0 + q * z, z)
    normal = Array3f(-curvature * point.x, -curvature * point.y, 1 - curvature * z)
    line = Array3f(p, q, 1)
    out = 2 * dr.dot(line, normal) * normal - line
    return (point, out), point.x * point.x + point.y * point.y <= given["rim2"]


def count(image: UInt32, point: Array3f, direction: Array3f, on: Bool, given: dict) -> None:
    """Add the rays that come through the aperture to the image, behind the paraxial lens.

    By atomics: two threads seldom meet in a pixel. An image for each thread took 5 % longer.
    """
    position, axis_x, axis_y, axis_z = (Array3f(*map(float, row)) for row in given["camera"])
    n, rel, inverse = given["pixels"], point - position, 1 / dr.dot(direction, axis_z)
    depth = dr.dot(rel, axis_z)
    cells, through = [], on
    at = []
    for axis in (axis_x, axis_y):
        slope = dr.dot(direction, axis) * inverse
        a = dr.dot(rel, axis) - depth * slope
        cells.append(-(a + given["image"] * (slope - a / given["focal"])) / given["pixel"] + 0.5 * n)
        at.append(a)
    through &= at[0] * at[0] + at[1] * at[1] <= given["aperture2"]
    column, row = cells
    through &= (column >= 0) & (column < n) & (row >= 0) & (row < n)
    dr.scatter_add(image, UInt32(1), UInt32(row) * n + UInt32(column), through, mode=dr.ReduceMode.Direct)
