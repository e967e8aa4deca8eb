"""Mirrors with waves of a few nanometres, and images of them: rays of float64 to the true surface, no device."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import RectBivariateSpline

from irtscots_cl.imaging.fringes import FringeScan, FringeSet
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.departure import polar_points
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.pixel.traced_light import TracedLight
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface
from irtscots_cl.tracing.estimators.analytic import trace_analytic


@dataclass(frozen=True)
class SineDeparture:
    """A sum of waves: height = sum of amplitude x cos(k . (x, y) + phase). k_per_mm: [waves, 2] rad/mm; the other two
    [waves], amplitudes in mm."""

    k_per_mm: np.ndarray
    amplitude_mm: np.ndarray
    phase: np.ndarray
    radius_mm: float

    @classmethod
    def one(cls, k_per_mm, amplitude_mm: float, phase: float, radius_mm: float) -> SineDeparture:
        return cls(np.array([k_per_mm]), np.array([amplitude_mm]), np.array([phase]), radius_mm)

    def at(self, x_mm, y_mm):
        """Height [mm] and its slopes."""
        sums = np.zeros((3, *np.broadcast_shapes(np.shape(x_mm), np.shape(y_mm))))
        for (kx, ky), amplitude, phase in zip(self.k_per_mm, self.amplitude_mm, self.phase, strict=True):
            angle = kx * x_mm + ky * y_mm + phase
            falling = -amplitude * np.sin(angle)
            sums += np.stack([amplitude * np.cos(angle), kx * falling, ky * falling])
        return sums[0], sums[1], sums[2]

    def spread(self, aperture_radius_mm: float):
        return polar_points(aperture_radius_mm, 64)


@dataclass(frozen=True)
class RippledChiefRays(ChiefRays):
    """The chief rays of a scene whose mirror has waves on top."""

    ripple: SineDeparture | FieldDeparture | None = field(default=None, kw_only=True)

    @cached_property
    def surface(self) -> Surface:
        own = Surface.of(self.scene.mirror)
        return replace(own, deviation=(*own.deviation, self.ripple)) if self.ripple else own


class RippledSetup(Setup):
    """The set-up of a scene whose mirror has waves on top. Its light is traced: over a pixel no map is quadratic."""

    def __init__(self, scene, ripple: SineDeparture | FieldDeparture | None):
        super().__init__(scene)
        self.ripple = ripple

    @cached_property
    def chief_rays(self) -> ChiefRays:
        return RippledChiefRays(self.scene, ripple=self.ripple)

    @cached_property
    def pixel_response(self):
        pixels = np.flatnonzero(self.chief_rays.sees_mirror)
        light = TracedLight.of(self.chief_rays, pixels)
        return PixelLight(self.chief_rays, pixels, np.zeros(len(pixels), bool), ((np.arange(len(pixels)), light),))


def line_images(setup: Setup) -> ImageStack:
    """The images of a line scan, without noise."""
    return trace_analytic(setup).images(LineScan(setup.scene))


def fringe_stack(setup: Setup, periods, steps: int = 4):
    """Clean images of fringes in shares of the brightest white pixel."""
    sets = tuple(FringeSet.equal(axis, periods, steps) for axis in "xy")
    stack = trace_analytic(setup).images(FringeScan(setup.scene, sets))
    return replace(stack, frames=stack.frames / stack.white.max(), white=stack.white / stack.white.max())


def wave_fit(x_mm, y_mm, values, mask, k_per_mm, phase: float) -> complex:
    """What a map holds of the wave cos(k . (x, y) + phase): amplitude and phase against it as a complex number.

    Least squares under a window that falls to 0 at 0.85 of the largest radius, with a plane beside the wave.
    """
    x, y, z = (v[mask] for v in (x_mm, y_mm, values))
    radius = np.hypot(x, y)
    weight = np.where(radius < 0.85 * radius.max(), np.cos(np.pi / 2 * radius / (0.85 * radius.max())) ** 2, 0.0)
    angle = k_per_mm[0] * x + k_per_mm[1] * y + phase
    basis = np.stack([np.cos(angle), -np.sin(angle), np.ones_like(x), x, y], -1)
    root = np.sqrt(weight)
    found = np.linalg.lstsq(basis * root[:, None], z * root, rcond=None)[0]
    return complex(found[0], found[1])


@dataclass(frozen=True)
class FieldDeparture:
    """Seeded heights whose power spectral density is level_mm2 x frequency^-2 up to cut_per_mm, as a cubic spline."""

    spline: RectBivariateSpline = field(repr=False)
    radius_mm: float

    @classmethod
    def of(cls, seed: int, radius_mm: float, pitch_mm: float, level_mm2: float, cut_per_mm: float) -> FieldDeparture:
        """pitch_mm: of the spline's knots, a small part of 1 / cut_per_mm."""
        count = 2 * int(np.ceil(1.5 * radius_mm / pitch_mm))
        frequency = np.hypot(*np.meshgrid(*[np.fft.fftfreq(count, pitch_mm)] * 2))
        inside = (frequency > 0) & (frequency < cut_per_mm)
        density = np.where(inside, level_mm2 / np.where(inside, frequency, 1.0) ** 2, 0.0)
        white = np.fft.fft2(np.random.default_rng(seed).standard_normal((count, count)))  # of density pitch^2
        heights = np.fft.ifft2(white * np.sqrt(density) / pitch_mm).real
        axis = (np.arange(count) - count / 2) * pitch_mm
        return cls(RectBivariateSpline(axis, axis, heights), radius_mm)

    def at(self, x_mm, y_mm):
        """Height [mm] and its slopes."""
        x, y = np.broadcast_arrays(np.nan_to_num(x_mm), np.nan_to_num(y_mm))
        return tuple(self.spline.ev(y, x, dx=dy, dy=dx) for dx, dy in ((0, 0), (1, 0), (0, 1)))

    def spread(self, aperture_radius_mm: float):
        return polar_points(aperture_radius_mm, 64)
