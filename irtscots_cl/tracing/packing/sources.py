"""The kernels' sources of rays: emitters of the screen, receivers of the detector."""

from __future__ import annotations

import numpy as np

from irtscots_cl.opencl.structs import PRECISIONS, WEIGHT_ONE, emitter_dtype, line_receiver_dtype, receiver_dtype
from irtscots_cl.optics.aim import camera_aim, mirror_aim, pixel_centres
from irtscots_cl.optics.chief_rays import Calibration
from irtscots_cl.optics.pixel.response import pixel_light
from irtscots_cl.system.memory import check_memory

LEAST_COSINE4 = 2.0**-6  # weights stay at or below WEIGHT_ONE times its inverse, 2^30


def receivers(calibration: Calibration, slots: np.ndarray, origins: np.ndarray, precision: str) -> np.ndarray:
    """Adjoint sources [slots]: slots are flat detector pixel numbers, origins [slots, 2] the windows' (column, row)."""
    rows, columns = np.divmod(slots, calibration.shape[1])
    out = np.zeros(len(slots), receiver_dtype(PRECISIONS[precision]))
    out["x"], out["y"] = calibration.image_point(rows, columns)
    out["weight_scale"] = WEIGHT_ONE / cosine4(calibration, slots)
    out["column"], out["row"] = origins.T
    out["pixel"] = slots
    return out


def line_receivers(calibration: Calibration, slots: np.ndarray, origins: np.ndarray, precision: str) -> np.ndarray:
    """Sources [slots] of the smoothed adjoint estimator: receivers and, from the pixels' maps, their chords.

    A pixel without a map (some of its rays miss the surface) gets chords of no length: its rays land as points.
    """
    real = PRECISIONS[precision]
    out = np.zeros(len(slots), line_receiver_dtype(real))
    out["start"] = receivers(calibration, slots, origins, precision)
    light = pixel_light(calibration.scene)  # of all pixels that see the mirror; slots are some of these
    index = np.searchsorted(light.pixels, slots)
    radius, pitch = calibration.scene.camera.aperture_diameter_mm / 2, calibration.scene.screen.pitch_mm
    for k, output in enumerate("uv"):
        chord = light.chord(output)
        values = (*chord.normal, chord.slope / pitch / radius, chord.bend / pitch / radius**2, chord.growth / radius,
                  *(chord.mirror / radius))  # fmt: skip
        for name, value in zip(out["chords"].dtype.names, values, strict=True):
            out["chords"][name][:, k] = value[index]
    return out


def cosine4(calibration: Calibration, slots: np.ndarray) -> np.ndarray:
    """cos^4 of the chief rays' object-side angle to the camera's axis at the pixels' centres [slots].

    At least LEAST_COSINE4: a pixel so wide that its centre is far off the axis and its edge near it would otherwise
    have rays whose weight, relative to the centre's, does not fit 31 bits.
    """
    x, y = calibration.image_point(*np.divmod(slots, calibration.shape[1]))
    distance = calibration.scene.camera.image_distance_mm
    return np.maximum((1 + (x**2 + y**2) / distance**2) ** -2, LEAST_COSINE4)


BYTES_PER_PIXEL = {"mirror": 140, "camera": 840}  # of the screen, while its aim is found; measured


def emitters(calibration: Calibration, precision: str, overfill: float, aim: str) -> tuple[np.ndarray, np.ndarray]:
    """Forward sources [rows * columns of the screen] and the area of their aim's ellipse in direction cosines [same].

    overfill: the ellipse's area over the least of the aim, which is one of options.AIMS. Raises ValueError if the
    screen has more pixels than the memory can hold aims of.
    """
    scene = calibration.scene
    columns, rows = scene.screen.pixels
    check_memory(f"scene {scene.name}: screen.pixels = {[columns, rows]}", columns * rows * BYTES_PER_PIXEL[aim])
    chosen = (camera_aim if aim == "camera" else mirror_aim)(scene).overfilled(overfill)
    out = np.zeros(len(chosen.centre), emitter_dtype(PRECISIONS[precision]))
    out["x"], out["y"] = pixel_centres(calibration)
    out["centre_l"], out["centre_m"] = chosen.centre.T
    out["aim_ll"], out["aim_ml"], out["aim_mm"] = chosen.root[:, 0, 0], chosen.root[:, 1, 0], chosen.root[:, 1, 1]
    return out, chosen.area
