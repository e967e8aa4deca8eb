"""What faults of camera and screen cost where the scene does not describe them, independent of the package.

The set-up is `paraboloid.toml`. A fault is in the data; the described set-up has none of it. Heights are fed back.
"""

from __future__ import annotations

import math
from pathlib import Path

from oracle.measured import heights, left_nm, record
from oracle.rig import Rig
from oracle.sensitivities import with_faults

SCENE = Path(__file__).with_name("paraboloid.toml")
RIM = 532.0 / math.hypot(218.0707, 4161.0366)  # radius of the mirror's image over the image distance
FAULTS = {
    "principal point 0.1 px in x": [("camera.principal_x_px", 0.1)],
    "principal point 0.1 px in y": [("camera.principal_y_px", 0.1)],
    "distortion 0.1 % at the rim": [("camera.k1", 1e-3 / RIM**2)],
    "camera rolled 0.1 degree": [("camera.roll_rad", math.radians(0.1))],
    "screen clocked 0.1 degree": [("screen.clocking_rad", math.radians(0.1))],
}
# Rms in nm without piston and tilt. The first two are in proportion to a pixel on the mirror, 9.6 mm here (111 pixels
# across): with 47 x 47 pixels of 0.0984 mm, 25.5 mm on the mirror, they are 310 nm, and the others stay within 3 %.
COSTS_NM = {
    "principal point 0.1 px in x": 116.96,
    "principal point 0.1 px in y": 116.82,
    "distortion 0.1 % at the rim": 79.52,
    "camera rolled 0.1 degree": 33.41,
    "screen clocked 0.1 degree": 33.25,
}


def costs_nm(scene: str, faults=None) -> dict[str, dict[str, float]]:
    """Rms in nm by fault and by what is removed (measured.TERMS)."""
    nominal = record(Rig.of(scene))
    costs = {}
    for name, changes in (faults or FAULTS).items():
        seen = nominal.through(with_faults(nominal.described, changes))
        costs[name] = left_nm(seen, heights(seen))
    return costs
