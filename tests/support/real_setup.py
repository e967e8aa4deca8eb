"""Lop-sided scenes with what real set-ups have: a calibrated camera with distortion, a bent screen under glass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from lopsided import lopsided

from irtscots_cl.scene.camera_intrinsics import Intrinsics
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.screen_shape import CoverGlass, ScreenShape

DISTORTION = (-1.2, 3.0, 0.012, -0.008, -2.0, 0.15, -0.4, 0.3)  # up to 2 % at the image's corner
SAG_MM = ((2, 0, 0.9), (0, 2, -0.35), (1, 1, 0.3), (3, 0, -0.2), (1, 2, 0.15), (1, 0, 0.4), (0, 0, 0.7))
SHAPES = ("flat", "sag", "points")


def _height(u, v):
    """A bent screen in units of half its sides: mm."""
    return 0.6 * u**2 - 0.3 * v**2 + 0.25 * u * v - 0.2 * u**3 + 0.1 * np.sin(2 * u + v)


def measured_points(n: int = 7, interpolation: str = "smooth", bend: float = 1.0) -> ScreenShape:
    """Points of a screen of 20.7 x 14.45 mm that is bent and stretched, on a grid of n x n places."""
    u, v = (w.ravel() for w in np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)))
    x = 10.35 * u + 0.08 * bend * (u**2 - v**2) + 1.3
    y = 7.225 * v + 0.06 * bend * (u * v + 0.5 * v**3) - 7.3
    z = _height(u, v) * bend
    fractions = tuple((float(a), float(b)) for a, b in zip((u + 1) / 2, (v + 1) / 2, strict=True))
    points = tuple((float(a), float(b), float(c)) for a, b, c in zip(x, y, z, strict=True))
    return ScreenShape(fractions=fractions, points_mm=points, interpolation=interpolation)


def real_setup(shape: str = "sag", glass: bool = True, distorted: bool = True, aperture_mm: float = 3.0) -> Scene:
    """No two lengths are equal, nothing is centred: roll, clocking, principal point, fx and fy, aperture, pitches."""
    base = lopsided()
    intrinsics = Intrinsics(
        image_size_px=(200, 140), principal_point_px=(97.3, 66.2), fx=682.0, fy=671.5, roi_px=(8, 5), binning=(2, 2),
        distortion=DISTORTION if distorted else (),
    )  # fmt: skip
    camera = replace(
        base.camera,
        intrinsics=intrinsics,
        roll_deg=7.0,
        aperture_offset_mm=(0.8, -0.5),
        aperture_diameter_mm=aperture_mm,
    )
    shapes = {"flat": None, "sag": ScreenShape(sag_mm=SAG_MM), "points": measured_points()}
    screen = replace(
        base.screen, pitch_mm=(0.9, 0.85), clocking_deg=-5.0, shape=shapes[shape],
        cover_glass=CoverGlass(thickness_mm=1.1, index=1.52) if glass else None,
    )  # fmt: skip
    name = f"real-{shape}" + "-glass" * glass + "-plain" * (not distorted)
    return replace(base, name=name, camera=camera, screen=screen)


def turned_setup() -> Scene:
    """What the non-sequential estimator knows of it: a perfect lens in mid-aperture, a flat bare screen."""
    scene = real_setup("flat", glass=False, distorted=False)
    return replace(scene, name="turned", camera=replace(scene.camera, aperture_offset_mm=(0.0, 0.0)))


REAL = {
    "real": real_setup,
    "real-points": lambda: real_setup("points"),
    "narrow-real": lambda: real_setup(aperture_mm=1.0),
    "narrow-points": lambda: real_setup("points", aperture_mm=1.0),
    "turned": turned_setup,
}
