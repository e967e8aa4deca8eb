"""What the harmonics of a screen's gamma would do to phases, were they left in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from irtscots_cl.maths.arrays import BoolArray
from irtscots_cl.measurement.fringe_light import LINEAR, LightPhases
from irtscots_cl.measurement.harmonics import bias_size, gamma_harmonics
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates


@dataclass(frozen=True)
class HarmonicBias:
    """Of an axis. gamma, gamma_error: of the screen. closed_form_rad, bias_rad: [series] the largest bias of a phase,
    without blur for any phase, and in the pixels used. height_nm: what both axes' biases make of the heights, rms."""

    gamma: float
    gamma_error: float
    closed_form_rad: tuple[float, ...]
    bias_rad: tuple[float, ...]
    height_nm: float = np.nan


def harmonic_bias(
    found: ScreenCoordinates, phases: Mapping[str, LightPhases], used: BoolArray
) -> dict[str, HarmonicBias]:
    """By axis, where the images show a gamma. used: pixels [rows, columns], lying as the maps of phases do."""
    told = {}
    for axis, one in found.axes.items():
        light = phases[axis]
        if light.gamma == LINEAR:
            continue
        ratios = gamma_harmonics(light.gamma.value)
        told[axis] = HarmonicBias(
            light.gamma.value,
            light.gamma.standard_error,
            tuple(bias_size(steps, ratios) for steps in one.survey.steps_rad),
            tuple(float(np.nanmax(np.abs(row[used]), initial=0.0)) for row in light.harmonics_rad),
        )
    return told
