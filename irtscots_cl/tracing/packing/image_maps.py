"""Where the points of a detector pixel would be in the image of a lens without distortion: a quadratic for each pixel.

A device cannot invert a distortion for every ray; over one pixel its inverse is nearly linear. The quadratic is the
projection of the exact inverse (CameraModel.image_point, 1e-10 of a pixel) by Gauss' three points along each side, so
that its mean over the pixel is right to the fifth order. What it leaves, at most in the pixel's corners, is a tenth of
the pixel's third derivatives, in pixels about k1 / 10 times the square of the pixel's angle: 1e-7 of a pixel at 1 mrad.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.opencl.structs import image_dtype
from irtscots_cl.optics.camera_model import CameraModel

NODES = np.array([-1.0, 0.0, 1.0]) * np.sqrt(0.15)  # of Gauss, in pixels from the centre
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18
CHUNK = 2**14  # pixels at a time


def _fit() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points s, t [9], and the matrix [6, 9] from values there to coefficients of 1, s, t, ss, st, tt."""
    s, t = (values.ravel() for values in np.meshgrid(NODES, NODES))
    root = np.sqrt(np.outer(WEIGHTS, WEIGHTS).ravel())
    design = np.stack([np.ones(9), s, t, s * s, s * t, t * t], -1)
    return s, t, np.linalg.pinv(design * root[:, None]) * root


_S, _T, _FIT = _fit()


def image_maps(model: CameraModel, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Coefficients [2, 6, n] in mm of the image's x and y, by 1, s, t, ss, st, tt, of pixels (rows, columns) [n]."""
    out = np.empty((2, 6, len(rows)))
    for first in range(0, len(rows), CHUNK):
        part = slice(first, first + CHUNK)
        points = model.image_point(rows[part] + _T[:, None], columns[part] + _S[:, None])
        out[:, :, part] = [_FIT @ values for values in points]
    return out


def stretches(model: CameraModel, maps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Area of the image over the plain camera's pixel [n]: in the pixels' middle, and a bound of it over each pixel."""
    x, y = maps[0], maps[1]
    middle = (x[1] * y[2] - x[2] * y[1]) / model.pixel_area_mm2
    reach = [[np.abs(of[1]) + np.abs(of[3]) + np.abs(of[4]) / 2, np.abs(of[2]) + np.abs(of[5]) + np.abs(of[4]) / 2]
             for of in (x, y)]  # fmt: skip
    return middle, (reach[0][0] * reach[1][1] + reach[0][1] * reach[1][0]) / model.pixel_area_mm2


def fill_images(out: np.ndarray, maps: np.ndarray) -> None:
    """Write maps [2, 6, n] into receivers [n] of a lens with distortion, the centres' points among them."""
    out["x"], out["y"] = maps[:, 0]
    names = image_dtype(np.float64).names
    for name, values in zip(names, maps[:, 1:].reshape(10, -1), strict=True):
        out["image"][name] = values
