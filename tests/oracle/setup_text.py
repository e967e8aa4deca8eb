"""The set-up of the oracle's own tests, as text of a scene file: no symmetry, and nothing of it is the default."""

from __future__ import annotations

_CAMERA = """
[camera]
position_mm = [{camera}]
look_at_mm = [25.0, -18.0, 4.0]
roll_deg = 17.0
aperture_diameter_mm = 3.0
aperture_offset_mm = [0.7, -0.4]
focal_length_mm = 20.0
focus_distance_mm = 1450.0
transmittance = 0.8

[camera.intrinsics]
image_size_px = [220, 90]
principal_point_px = [104.3, 47.9]
fx = {fx}
fy = {fy}
distortion = [-0.31, 0.12, 0.004, -0.0025, -0.02{more}]
roi_px = [20, 11]
binning = [2, 1]

[camera.detector]
pixels = [90, 61]
pitch_mm = 0.06
"""

_SCREEN = """
[screen]
position_mm = [{screen}]
look_at_mm = [{target}]
clocking_deg = -33.0
pixels = [{pixels}]
pitch_mm = [0.9, 0.75]
radiance = 2.0
centre_offset_mm = [1.3, -7.3]

[screen.shape]
sag_mm = [[1, 0, 0.2], [2, 0, 3.1], [1, 1, -0.9], [0, 2, -1.7], [3, 1, 0.4], [0, 4, 0.3]]
"""

GLASS = """
[screen.cover_glass]
thickness_mm = 2.2
index = 1.52
"""

_CONCAVE = """
[mirror]
radius_mm = 1500.0
conic = -0.8
off_axis_mm = 240.0
diameter_mm = 330.0
reflectance = 0.9
"""

_CONVEX = """
[mirror]
radius_mm = -2600.0
conic = -0.3
diameter_mm = 330.0
reflectance = 0.9
"""

_FLAT = """
[mirror]
radius_mm = inf
diameter_mm = 330.0
"""

_ZERNIKE = """
[[mirror.zernike]]
radius_mm = 180.0
noll_um = { 5 = -3.0, 7 = 2.0, 8 = 1.5, 10 = 0.6 }
"""

MIRRORS = ("concave", "convex", "flat")


def setup_text(mirror: str = "concave", glass: bool = True, rational: bool = True, zernike: bool = True) -> str:
    """A set-up with everything on. mirror: of MIRRORS. rational: distortion with k4, k5, k6."""
    more = ", 0.05, -0.03, 0.01" if rational else ""
    if mirror == "concave":
        camera, screen, target, pixels = "-70.0, -120.0, 1530.0", "75.0, 130.0, 1540.0", "330.0, -400.0, 0.0", "61, 77"
    else:
        camera, screen, target, pixels = (
            "-370.0, -120.0, 1430.0",
            "425.0, 150.0, 1400.0",
            "60.0, 30.0, 0.0",
            "901, 1001",
        )
    text = f'name = "real-{mirror}"\n' + {"concave": _CONCAVE, "convex": _CONVEX, "flat": _FLAT}[mirror]
    text += _ZERNIKE if zernike else ""
    text += _SCREEN.format(screen=screen, target=target, pixels=pixels) + (GLASS if glass else "")
    return text + _CAMERA.format(camera=camera, fx=640.0, fy=331.0, more=more)
