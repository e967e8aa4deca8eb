"""Error sources: the detector's samples, of which each frame has one for a pixel.

A factor that is a pixel's own, the same in all frames, cancels from its place, by the centroid as by the phase: the
spread of the pixels' responses (prnu) does nothing. What is added to single frames acts by the frames' weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from irtscots_cl.budget.frames import LineFrames
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.imaging.detector import electrons_per_w
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.pixel.light import whole_flux_w

ROUNDING = 12**-0.5  # rms of an even error of one step


@dataclass(frozen=True)
class ReadNoise:
    """Independent normal errors of all samples."""

    name: str = "detector.read_noise"
    unit: str = "of the peak"
    text: str = "noise of each sample, rms over the brightest sample of all frames"
    usual: float = 1e-3
    kind: Kind = Kind.PROCESS

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial."""
        rms = [np.sqrt(np.sum(weights**2, -1)) for weights in design.frames.of_addition]
        return value * np.stack(rms) * draw.normal(self.name, 2, design.count)


@dataclass(frozen=True)
class Quantisation:
    """Samples rounded to whole steps: even errors of one step, and light below half a step is lost."""

    name: str = "detector.quantisation"
    unit: str = "of the peak"
    text: str = "step of the rounding over the brightest sample of all frames: 1/255 for 8 bits in full use"
    usual: float = 1 / 255
    kind: Kind = Kind.PROCESS

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial; NaN for a pixel without light in any frame of an axis."""
        bias, rms = [], []
        for signal, weights in zip(design.frames.signal, design.frames.of_addition, strict=True):
            dark = signal < value / 2
            lost = np.where(dark.all(-1), np.nan, 0.0)
            bias.append(lost - np.sum(np.where(dark, signal * weights, 0.0), -1))
            rms.append(value * ROUNDING * np.sqrt(np.sum(np.where(dark, 0.0, weights) ** 2, -1)))
        found: FloatArray = np.stack(bias) + np.stack(rms) * draw.normal(self.name, 2, design.count)
        return found


@dataclass(frozen=True)
class SceneNoise:
    """Shot noise, dark current, read noise and rounding of the scene's table [camera.detector.noise]. value: factor."""

    name: str = "detector.noise"
    unit: str = "times"
    text: str = "noise of [camera.detector.noise]: shot noise of light and dark current, read noise, rounding"
    usual: float = 1.0
    kind: Kind = Kind.PROCESS

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial."""
        noise = design.setup.scene.camera.detector.noise
        peak = _peak_electrons(design, noise)
        dark = noise.dark_current_e_per_s * (noise.exposure_s or 0.0)
        floor = noise.read_noise_e**2 + (noise.gain_e_per_dn * ROUNDING if noise.bits is not None else 0.0) ** 2
        rms = []
        for signal, weights in zip(design.frames.signal, design.frames.of_addition, strict=True):
            square = floor + (signal * peak + dark if noise.shot_noise else 0.0)
            rms.append(np.sqrt(np.sum(weights**2 * square, -1)) / peak)
        frames = noise.frames_averaged * noise.exposures
        return value / frames**0.5 * np.stack(rms) * draw.normal(self.name, 2, design.count)


def has_noise(noise: Any) -> bool:
    """Whether a scene's table of noise, or None, changes single samples at random."""
    return noise is not None and bool(noise.shot_noise or noise.read_noise_e or noise.bits)


def _peak_electrons(design: MeasuredDesign, noise: Any) -> float:
    """Electrons of the brightest sample of all frames: of a pixel that sees nothing but the screen in the mirror."""
    if noise.electrons_at_peak is not None:
        return float(noise.electrons_at_peak)
    share = design.frames.brightest if isinstance(design.frames, LineFrames) else 1.0
    flux = whole_flux_w(design.setup.chief_rays) * share
    return electrons_per_w(noise, flux) * flux
