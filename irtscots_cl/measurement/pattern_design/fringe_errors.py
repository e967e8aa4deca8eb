"""Errors of places by N-step fringes, before there are images: of the phases, and of the place that they make together.

A pixel that sends E electrons under a white screen records offset + amplitude cos(phase - step), amplitude = E m / 2, m
what its light leaves of the fringes. For four and more equal steps and noise of variance v at the mean signal the
phase's standard error is sqrt(2 v / N) / amplitude; with p periods over the screen's width that is a place error of
width / (2 pi p) times as much. Several series together have the sum of their weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from irtscots_cl.imaging.fringes import equal_steps
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.measurement.pattern_design.camera import DesignCamera
from irtscots_cl.measurement.pattern_design.pixels import SeenPixels
from irtscots_cl.measurement.phase import SinusoidFit

TAU = 2 * np.pi
PHASES = 2048  # of a sinusoid, for its mean through a screen's gamma


@dataclass(frozen=True)
class Fringes:
    """A set of fringes along both axes: numbers of periods over the screen, of `steps` equal steps each."""

    family: str
    periods: tuple[float, ...]
    steps: int

    @property
    def frames(self) -> int:
        """Of both axes, each once."""
        return 2 * self.steps * len(self.periods)

    @property
    def tells_noise(self) -> bool:
        """Whether its residuals tell the noise: those of three steps are always zero."""
        return self.steps > 3

    @property
    def name(self) -> str:
        return f"{len(self.periods)} x {self.steps} steps" + (f", {self.family}" if len(self.periods) > 1 else "")


@dataclass(frozen=True)
class Signal:
    """Of a pixel: electrons of the mean frame and of the sinusoid's amplitude [n]."""

    offset_e: FloatArray
    amplitude_e: FloatArray


@cache
def emitted(gamma: float) -> tuple[float, float]:
    """Mean and amplitude of the first harmonic of a full-range sinusoid on a screen of that gamma: 1/2, 1/2 for 1."""
    t = TAU * (np.arange(PHASES) + 0.5) / PHASES
    light = (0.5 + 0.5 * np.cos(t)) ** gamma
    return float(light.mean()), float(2 * np.mean(light * np.cos(t)))


def signal_of(seen: SeenPixels, camera: DesignCamera, axis: int, periods: float, gamma: float = 1.0) -> Signal:
    """What the pixels record of fringes of so many periods along an axis (0: x)."""
    electrons, (mean, first) = camera.electrons * seen.bright, emitted(gamma)
    return Signal(electrons * mean, electrons * first * seen.modulation_at(axis, periods))


def phase_errors(
    seen: SeenPixels, camera: DesignCamera, axis: int, fringes: Fringes, frames: float, gamma: float = 1.0
) -> FloatArray:
    """Standard errors [series, n] in rad of the phases by least squares, from `frames` frames of both axes."""
    steps = np.array(equal_steps(fringes.steps))
    place = seen.fraction(axis)
    errors = []
    for periods in fringes.periods:
        signal = signal_of(seen, camera, axis, periods, gamma)
        phase = TAU * periods * place
        none = np.zeros(0, np.int64)
        fit = SinusoidFit(
            signal.offset_e, signal.amplitude_e * np.cos(phase), signal.amplitude_e * np.sin(phase),
            np.zeros(len(place)), np.full(len(place), len(steps)), steps, none, np.zeros((0, 3, 3)),
        )  # fmt: skip
        errors.append(fit.phase_error_rad(camera.noise) * np.sqrt(fringes.frames / frames))
    return np.stack(errors)


def phase_bounds(
    seen: SeenPixels, camera: DesignCamera, axis: int, fringes: Fringes, frames: float, gamma: float = 1.0
) -> FloatArray:
    """Cramer-Rao bounds [series, n] in rad of the phases from the same frames, offset and amplitude unknown.

    They are below phase_errors where dark samples have less noise: least squares weigh all alike.
    """
    steps = np.array(equal_steps(fringes.steps))
    bounds = []
    for periods in fringes.periods:
        signal = signal_of(seen, camera, axis, periods, gamma)
        angle = TAU * periods * seen.fraction(axis)[:, None] - steps
        amplitude = signal.amplitude_e[:, None]
        variance = camera.noise.variance(signal.offset_e[:, None] + amplitude * np.cos(angle))
        columns = np.stack([-amplitude * np.sin(angle), np.cos(angle), np.ones_like(angle)], -1)
        # an amplitude of zero leaves the phase open
        with np.errstate(divide="ignore", invalid="ignore"):
            information = np.einsum("nsi,nsj->nij", columns / variance[..., None], columns)
            scale = np.sqrt(np.einsum("nii->ni", information))
            unit = information / (scale[:, :, None] * scale[:, None, :])
            known = np.isfinite(unit).all((1, 2)) & (signal.amplitude_e > 0)
            bound = np.full(len(angle), np.inf)
            bound[known] = np.sqrt(np.linalg.inv(unit[known] + 1e-13 * np.eye(3))[:, 0, 0]) / scale[known, 0]
        bounds.append(bound * np.sqrt(fringes.frames / frames))
    return np.stack(bounds)


def place_errors_mm(seen: SeenPixels, axis: int, periods: tuple[float, ...], errors_rad: FloatArray) -> FloatArray:
    """Standard errors [n] in mm of the place from phases with these errors [series, n], by which the series are
    weighed; orders are known."""
    p = np.array(periods)[:, None]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        errors = 1 / np.sqrt(np.square(p / errors_rad).sum(0))
    mm: FloatArray = seen.width_mm(axis) / TAU * errors
    return mm
