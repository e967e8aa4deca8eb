"""A scene without any symmetry, so that no flip or swap of axes can hide."""

from __future__ import annotations

from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene


def lopsided() -> Scene:
    """Off-axis conic with deviations and a hole, a turned camera off centre, unequal grids, a moved screen.

    Part of the mirror's image falls beside the detector, and part of the light beside the screen.
    """
    zernike = (
        ZernikeTerms(
            radius_mm=180.0, ordering="noll", coefficients_um={5: -3.0, 7: 2.0, 8: 1.5, 10: 0.6, 211: 0.02}
        ),  # 211 is of radial order 20: too high for sums of powers
        ZernikeTerms(radius_mm=180.0, ordering="osa", coefficients_um={1: 2.5, 2: -4.0, 17: 0.5}),
    )
    mirror = Mirror(
        radius_mm=1500.0,
        conic=-0.8,
        off_axis_mm=240.0,
        diameter_mm=330.0,
        obscuration_mm=70.0,
        reflectance=0.9,
        zernike=zernike,
    )
    screen = Screen(
        position_mm=(75.0, 130.0, 1540.0),
        look_at_mm=(330.0, -400.0, 0.0),
        pixels=(23, 17),
        pitch_mm=0.9,
        radiance=2.0,
        centre_offset_mm=(1.3, -7.3),
    )
    camera = Camera(
        position_mm=(-70.0, -120.0, 1530.0),
        look_at_mm=(25.0, -18.0, 4.0),
        aperture_diameter_mm=3.0,
        focal_length_mm=20.0,
        focus_distance_mm=1450.0,
        transmittance=0.8,
        detector=Detector(pixels=(90, 61), pitch_mm=0.06),
    )
    return Scene(name="lopsided", mirror=mirror, screen=screen, camera=camera)
