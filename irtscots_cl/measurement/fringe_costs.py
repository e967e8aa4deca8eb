"""What a change between frames that was not mended costs, in nm of height: for the order and the text of warnings."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates


def fraction_error(one: AxisCoordinates, added: FloatArray) -> FloatArray:
    """Change of the fractions [rows, columns] as stored by light that was added to the frames of this axis.

    added: [frames] parts of the screen's mean light. To first order; the series count as their phase errors say.
    """
    total, weights, start = np.zeros(one.fraction.shape), 0.0, 0
    for k, (periods, steps) in enumerate(zip(one.fringes.periods, one.survey.steps_rad, strict=True)):
        basis = np.stack([np.ones_like(steps), np.cos(steps), np.sin(steps)], -1)
        _, cosine, sine = np.linalg.pinv(basis) @ added[start : start + len(steps)]
        start += len(steps)
        phase = one.survey.sign * np.asarray(one.phase_rad[k], float)
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = (np.cos(phase) * sine - np.sin(phase) * cosine) * one.offset[k] / one.amplitude[k]
        error = np.hypot(np.nanmedian(one.phase_error_rad[k]), one.survey.floor_rad)
        weight = (periods / max(float(error), 1e-12)) ** 2
        total += weight * one.survey.sign * turned / (2 * np.pi * periods)
        weights += weight
    return (-1 if one.fringes.reverse else 1) * total / weights


def height_cost_nm(result: Reconstruction, other: Reconstruction) -> float:
    """rms over the pixels, piston and tilt removed, of the height by which two surfaces of the same mirror differ."""
    both = result.height_mask & other.height_mask
    differ = result.deviation_mm - other.deviation_mm
    return rms(remove_terms(result.x_mm, result.y_mm, differ, both, "piston_tilt"), both) * 1e6
