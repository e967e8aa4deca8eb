"""Surface slopes by triangulation between camera, mirror and screen."""

from __future__ import annotations

import numpy as np


def half_vector_slopes(mirror_mm: np.ndarray, screen_mm: np.ndarray, camera_mm: np.ndarray):
    """Slopes (dz/dx, dz/dy) [...] of the mirror at its points (paper, Eq. 3; Su et al. 2010).

    mirror_mm, screen_mm: [..., 3] points of the mirror and the screen points that they reflect into the camera;
    camera_mm: [3] centre of the camera's aperture; all in world coordinates. The surface normal halves the angle
    between the directions to screen and camera. The mirror points contain the height that is sought.
    """
    to_screen, to_camera = screen_mm - mirror_mm, camera_mm - mirror_mm
    half = to_screen / np.linalg.norm(to_screen, axis=-1, keepdims=True) + to_camera / np.linalg.norm(
        to_camera, axis=-1, keepdims=True
    )
    return -half[..., 0] / half[..., 2], -half[..., 1] / half[..., 2]
