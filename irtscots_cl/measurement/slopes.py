"""Surface slopes by triangulation between camera, mirror and screen."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray


def half_vector_slopes(
    mirror_mm: FloatArray, screen_mm: FloatArray, camera_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Slopes (dz/dx, dz/dy) [...] of the mirror at its points (paper, Eq. 3; Su et al. 2010).

    mirror_mm, screen_mm: [..., 3] points of the mirror and the screen points that they reflect into the camera;
    camera_mm: [3] centre of the camera's aperture; all in world coordinates. The surface normal bisects the angle
    between the directions to screen and camera. The mirror points include the unknown height.
    """
    halves = []
    for end in (screen_mm, camera_mm):
        x, y, z = (end[..., axis] - mirror_mm[..., axis] for axis in range(3))
        length = np.sqrt(x * x + y * y + z * z)
        halves.append((x / length, y / length, z / length))
    x, y, z = (to_screen + to_camera for to_screen, to_camera in zip(*halves, strict=True))
    return -x / z, -y / z


def deconvolve_pixel(slope: FloatArray, mask: BoolArray) -> FloatArray:
    """Slopes at the pixels' centres from their means over the pixels: [..., rows, columns], mask [rows, columns].

    The mean of a smooth function over a pixel is its value at the centre plus 1/24 of its second differences along rows
    and columns, to fourth order in the pitch. At the mask's edge the neighbour's second difference replaces the
    pixel's own; a pixel with too few neighbours along a row or column keeps the mean there. NaN outside the mask.
    """
    slope = np.where(mask, slope, np.nan)
    excess = np.zeros_like(slope)
    for axis in (-2, -1):
        second = np.full_like(slope, np.nan)
        inner, along = np.moveaxis(second, axis, -1), np.moveaxis(slope, axis, -1)
        inner[..., 1:-1] = along[..., :-2] - 2 * along[..., 1:-1] + along[..., 2:]
        for shift in (-1, 1):
            borrowed = np.full_like(inner, np.nan)
            target, source = (slice(1, None), slice(None, -1)) if shift == 1 else (slice(None, -1), slice(1, None))
            borrowed[..., target] = inner[..., source]
            inner[...] = np.where(np.isnan(inner), borrowed, inner)
        excess += np.nan_to_num(second)
    return slope - excess / 24
