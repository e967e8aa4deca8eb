"""Error source: diffraction at the camera's aperture, which spreads each pixel's light over its neighbours.

A pixel gets light of its neighbours' parts of the mirror too, and the centroid of its light is the mean of theirs by
what each adds. Nothing moves where places are linear over the image; it does where they curve, and at the mirror's rim,
from beyond which no light comes. The second moment of the Airy disk, which would tell by how much, is infinite: its
share within a radius r grows with r. So the mean is taken over the whole image, by the transfer function.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import fft2, fftfreq, ifft2, next_fast_len
from scipy.interpolate import RectBivariateSpline

from irtscots_cl.budget.measured_design import MeasuredDesign
from irtscots_cl.budget.source import Draw, Kind
from irtscots_cl.maths.arrays import FloatArray

NM_PER_MM = 1e6
MOST_ORDERS = 64  # of the pixels' grid on each side, where the disk is that much smaller than a pixel
NODES = 25  # per axis, between which the sum of the orders but the 0th is interpolated: it is smooth


@dataclass(frozen=True)
class Diffraction:
    """value: wavelength. It acts in all tests alike, in full: a size without random numbers."""

    name: str = "camera.diffraction_nm"
    unit: str = "nm"
    text: str = "diffraction at the camera's aperture, at this wavelength"
    usual: float = 550.0
    kind: Kind = Kind.CONSTANT

    def changes_mm(self, design: MeasuredDesign, value: float, draw: Draw) -> FloatArray:
        """Changes (du, dv) [2, n] of the places."""
        return design.once(f"{self.name} {value!r}", lambda: _changes(design, value))


def _changes(design: MeasuredDesign, wavelength_nm: float) -> FloatArray:
    camera, seen, places = design.setup.scene.camera, design.seen, design.places_mm
    blur = wavelength_nm / NM_PER_MM * camera.image_distance_mm / camera.aperture_diameter_mm
    pitch = seen.step * np.array(design.setup.chief_rays.camera_model.pitch_mm)
    found: FloatArray = blurred(seen.on_grid(places), blur, pitch)[:, seen.mask] - places
    return found


def transfer(frequency_per_mm: FloatArray, blur_mm: float) -> FloatArray:
    """Transfer function [...] of the aperture for incoherent light.

    blur_mm: wavelength times image distance over the aperture's diameter.
    """
    part = np.minimum(frequency_per_mm * blur_mm, 1.0)
    found: FloatArray = 2 / np.pi * (np.arccos(part) - part * np.sqrt(1 - part**2))
    return found


def blurred(maps: FloatArray, blur_mm: float, pitch_mm: FloatArray) -> FloatArray:
    """Means [k, rows, columns] of maps (NaN where there is no light) over the light that diffraction brings to pixels.

    Between pixels, light and places are interpolated linearly. pitch_mm: [2] of columns and of rows.
    """
    light = np.isfinite(maps).all(0)
    values = np.concatenate([np.where(light, maps, 0.0), light[None]])
    shape = tuple(next_fast_len(2 * n) for n in light.shape)
    row, column = (np.abs(fftfreq(n)) for n in shape)
    taken = _taken(row, column, blur_mm / pitch_mm)
    rows, columns = light.shape
    summed = ifft2(fft2(values, shape) * (1 - taken)).real[:, :rows, :columns]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(light, summed[:-1] / summed[-1], np.nan)


def _taken(row: FloatArray, column: FloatArray, blur: FloatArray) -> FloatArray:
    """What the disk takes [rows, columns] of waves of maps by their frequencies from 0 to 1/2 per pixel.

    Of a linear interpolation between pixels, a wave has the share sinc^2 along each axis in each order of the grid; all
    orders together make 1. blur: [2] along columns and rows, in pixels.
    """
    node = np.linspace(0.0, 0.5, NODES)
    orders = min(int(np.ceil(1 / blur.min())) + 1, MOST_ORDERS)
    others, left = np.zeros((NODES, NODES)), np.ones((NODES, NODES))
    for k in range(-orders, orders + 1):
        for m in range(-orders, orders + 1):
            share = (np.sinc(node + k) ** 2)[:, None] * np.sinc(node + m) ** 2
            left -= share
            if k or m:
                others += share * (1 - transfer(np.hypot((node[:, None] + k) * blur[1], (node + m) * blur[0]), 1.0))
    others += left  # beyond, the disk takes all
    own = (np.sinc(row) ** 2)[:, None] * np.sinc(column) ** 2
    own = own * (1 - transfer(np.hypot(row[:, None] * blur[1], column * blur[0]), 1.0))
    spline = RectBivariateSpline(node, node, others)
    rest: FloatArray = spline(np.unique(row), np.unique(column))
    return own + rest[np.ix_(np.unique(row, return_inverse=True)[1], np.unique(column, return_inverse=True)[1])]
