"""Error sources: turbulent air on the way from the screen by the mirror to the camera, frozen, blown across it.

Each leg of the way has two layers of air, at Gauss's points, so that squares of levers, and with them the variance of
places, are those of air all along. A layer is a field of optical path of von Karman's spectrum that both legs cross,
each at its own place: near the mirror at nearly the same. Its slope there, averaged over the light of a pixel, bends
the chief ray. From frame to frame the wind moves the layers on, in a direction that differs from trial to trial.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import next_fast_len

from irtscots_cl.budget.light_sample import LINEAR, VARIANCES
from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.ray_bends import LAYERS
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.von_karman import slopes

NM_PER_MM = 1e6
MOST = 512  # points of a layer's grid per axis
PER_LIGHT = 3.0  # standard deviations of a pixel's light in a step of the grid: 3 % of the variance are below it
WIDE = (2.0, 3.0)  # times the way's width: the layer's; waves that are longer tilt all of it


@dataclass(frozen=True)
class Turbulence:
    """value: rms of the optical path from screen to camera over all time, whose part longer than the way is wide is
    but a tilt. Outer scale and wind: design.air."""

    name: str = "air.turbulence_nm"
    unit: str = "nm"
    text: str = "turbulent air: rms of the optical path from screen to camera, on the outer scale of [budget.air]"
    usual: float = 10.0
    kind: Kind = Kind.PROCESS

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places in one trial."""
        size, step = _grid(design)
        # two places for each measurement: of the layers and of the wind
        layers, wind_at = (replace(draw, repeat=2 * draw.repeat + k) for k in range(2))
        numbers = layers.normal(self.name, 2, size, size)
        (turn,) = 2 * np.pi * wind_at.uniform(self.name, 1)
        tilts = slopes(numbers[0] + 1j * numbers[1], step, design.air.outer_scale_mm, _light_mm(design))
        wind = design.air.wind_mm_per_s * design.air.frame_s * np.array([np.cos(turn), np.sin(turn)])
        return value / NM_PER_MM * _changes(design, tilts.reshape(len(LAYERS), -1, 2), step, wind)


def _changes(design: MeasuredDesign, tilts: FloatArray, step_mm: float, wind_mm: FloatArray) -> FloatArray:
    """Changes [2, n] by slopes [layers, size^2, 2] of layers that the wind moves on by wind_mm [2] each frame."""
    bends, frames = design.bends, design.frames
    size = round(np.sqrt(tilts.shape[1]))
    lengths = np.stack(bends.lengths_mm)
    parts = np.sqrt(lengths / lengths.sum(0) / len(LAYERS))  # of the rms, in each leg's layer
    found, first = np.zeros((2, design.count)), 0
    for axis in range(2):
        number = first + frames.numbers(axis)
        weights, first = frames.of_shift[axis], frames.counts[0]
        for layer, slope in enumerate(tilts):
            for leg in range(2):
                x, y = bends.crossings_mm[layer, leg]
                column, row = (
                    np.rint((place[:, None] - by * number) / step_mm).astype(np.intp) % size
                    for place, by in zip((x, y), wind_mm, strict=True)
                )
                seen = np.einsum("nk,nkc->cn", weights, slope.take(row * size + column, axis=0))
                found[axis] += parts[leg] * np.einsum("cn,cn->n", bends.levers_mm[layer, leg, :, axis], seen)
    return found


def _grid(design: MeasuredDesign) -> tuple[int, float]:
    """Points per axis of the layers' grid, and its step in mm."""
    places = design.bends.crossings_mm
    width = float(np.ptp(places, axis=(0, 1, 3)).max())
    period = max(WIDE[0] * width, min(WIDE[1] * width, 4 * design.air.outer_scale_mm))
    size = next_fast_len(int(min(MOST, max(32, np.ceil(period / (PER_LIGHT * _light_mm(design)))))))
    return size, period / size


def _light_mm(design: MeasuredDesign) -> float:
    """Standard deviation along an axis of the light of a pixel in the layers, rms over pixels and layers."""
    light, aperture = design.light, design.setup.scene.camera.aperture_diameter_mm / 2
    terms = np.array([[light.maps.term(output, key) for key in LINEAR] for output in "xy"])
    mirror = float(np.einsum("k,okn->on", VARIANCES, terms**2).mean())
    screen = float(np.einsum("iin->in", light.covariance_mm2).mean())
    ends = (aperture**2 / 4, screen)
    return float(np.sqrt(np.mean([(1 - f) ** 2 * mirror + f**2 * end for f in LAYERS for end in ends])))
