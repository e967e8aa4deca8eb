"""Mirrors with aspheric terms of every kind, fast and far from their conics."""

from __future__ import annotations

import math

from irtscots_cl.scene.asphere import Asphere
from irtscots_cl.scene.instrument import Camera, Detector, Screen
from irtscots_cl.scene.mirror import Mirror, ZernikeTerms
from irtscots_cl.scene.model import Scene

RIM_MM = 50.0


def powers(**rises_mm: float) -> dict[int, float]:
    """Coefficients whose terms p4, p6, ... are that high at RIM_MM."""
    return {int(name[1:]): rise / RIM_MM ** int(name[1:]) for name, rise in rises_mm.items()}


DEVIATION = ZernikeTerms(radius_mm=60.0, ordering="noll", coefficients_um={5: 2.0, 8: -1.5, 22: 0.4, 211: 0.01})
EVEN = Asphere(coefficients_mm=powers(p4=0.5, p6=-0.3, p8=0.2))
HIGH = Asphere(coefficients_mm=powers(p4=0.9, p6=-1.1, p8=0.7, p10=0.4, p12=-0.6, p14=0.5, p16=-0.3, p18=0.2, p20=0.1))
ODD = Asphere(coefficients_mm=powers(p3=0.5, p4=-0.4, p5=0.3, p7=-0.2, p20=0.02))
Q_CON = Asphere(q_con_um={0: 400.0, 1: -150.0, 2: 60.0, 4: 9.0}, normalisation_radius_mm=52.0)
Q_BFS = Asphere(q_bfs_um={0: 900.0, 1: -300.0, 2: 60.0, 4: 12.0}, normalisation_radius_mm=53.0)
Q_FINE = Asphere(q_con_um={0: 100.0, 15: 0.5, 18: 0.3}, normalisation_radius_mm=52.0)
SEGMENT = Asphere(coefficients_mm={4: 3e-9, 6: 2e-14, 8: -4e-19})  # 1 to 16 mm high between 140 and 260 mm
MIRRORS = {
    "even": Mirror(radius_mm=200.0, conic=-1.0, diameter_mm=100.0, asphere=EVEN),
    "order-20": Mirror(radius_mm=200.0, conic=-0.5, diameter_mm=100.0, asphere=HIGH),
    "odd": Mirror(radius_mm=200.0, conic=0.3, diameter_mm=100.0, obscuration_mm=20.0, asphere=ODD),
    "q-con": Mirror(radius_mm=200.0, conic=-1.0, diameter_mm=100.0, asphere=Q_CON),
    "q-bfs": Mirror(radius_mm=200.0, diameter_mm=100.0, asphere=Q_BFS),
    "q-fine": Mirror(radius_mm=200.0, conic=-1.0, diameter_mm=100.0, asphere=Q_FINE),
    "convex": Mirror(radius_mm=-300.0, conic=-2.0, diameter_mm=100.0, asphere=HIGH),
    "flat": Mirror(radius_mm=math.inf, diameter_mm=100.0, asphere=Asphere(coefficients_mm=powers(p2=6.0, p4=-0.3))),
    "deviated": Mirror(radius_mm=200.0, conic=-1.0, diameter_mm=100.0, asphere=EVEN, zernike=(DEVIATION,)),
    "off-axis": Mirror(radius_mm=800.0, conic=-1.0, diameter_mm=120.0, off_axis_mm=200.0, asphere=SEGMENT),
    "off-axis-odd": Mirror(
        radius_mm=800.0, conic=-0.6, diameter_mm=100.0, off_axis_mm=200.0,
        asphere=Asphere(coefficients_mm={3: 2e-7, 4: 1e-9, 5: -2e-12}), zernike=(DEVIATION,),
    ),
    "off-axis-sphere": Mirror(radius_mm=-900.0, diameter_mm=110.0, off_axis_mm=90.0, asphere=SEGMENT),
}  # fmt: skip


def asphere_scene(name: str) -> Scene:
    """A mirror of MIRRORS, seen whole by a camera near its centre of curvature, beside a screen.

    A mirror that is not concave is looked at from as far away.
    """
    mirror = MIRRORS[name]
    distance = 300.0 if math.isinf(mirror.radius_mm) else abs(mirror.radius_mm)
    focal = 8.0
    pitch = mirror.diameter_mm / distance * focal / 44  # of 48 pixels, the mirror's picture has 44
    camera = Camera(
        position_mm=(-0.06 * distance, 0.02 * distance, distance), look_at_mm=(0.0, 0.0, 0.0), aperture_diameter_mm=1.0,
        focal_length_mm=focal, detector=Detector(pixels=(48, 48), pitch_mm=pitch),
    )  # fmt: skip
    screen = Screen(
        position_mm=(0.06 * distance, -0.02 * distance, distance), look_at_mm=(0.0, 0.0, 0.0), pixels=(120, 120),
        pitch_mm=distance / 400,
    )  # fmt: skip
    return Scene("asphere", mirror, screen, camera)
