"""The instrument transfer function: how a test shows a wave on the mirror, by its period and direction, in closed form.

A wave of height exp(i k . (x, y)) has slopes i k times it. What the measurement makes of them is, for a wave of
nanometres, a product of real factors (a factor below 0 turns the phase by pi):

- footprint: the mean over the pixel's parallelogram, sin(k . s) / (k . s) for each half edge s;
- aperture: the mean over the disk that the camera's aperture adds where the camera is not focused on the mirror,
  2 J1(q) / q with q = |(k . a, k . b)|;
- diffraction, where a wavelength is told: the transfer function of a round aperture without aberrations, for incoherent
  light. The simulation and the measures of this package are geometrical and have none;
- display: lines move a sampled centroid by not quite as much as the light. Fringes weigh the points of footprint and
  aperture by the cosine of their phase, so that the two means above get shifted arguments;
- sharpening: measures that convert means over pixels to their centres, 1 + sum (1 - cos theta) / 12;
- integration: maths/integration/rule_symbols.py;
- model: of measures that refine, the share c that their Zernike terms follow. It is measured exactly, and the rest as
  without a model: c + (1 - c) x the product.

Sources: docs/transfer.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import j1

from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.maths.integration.rule_symbols import height_symbol
from irtscots_cl.maths.zernike.fit import smoothing_matrix
from irtscots_cl.measurement.methods import Measure, check_measure
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.measurement.refinement import order_of_model, zernikes
from irtscots_cl.measurement.transfer_geometry import TransferGeometry, whole_pixels
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError

FRINGES = Measure("places", "cubic", pixel_average=False)  # what pipeline/measure_fringes.py does with places
OVER_MIRROR = 144  # pixels, about, of the extremes over the mirror
SHARE_STEPS, SHARE_ANGLES = 48, 4  # of the mean of the model's share


@dataclass(frozen=True)
class Response:
    """Of n pixels to m waves: real arrays [n, m], NaN where a wave looks like a tilt (height) or a factor is unknown.

    k_per_mm: [m, 2]. turns: [n, m, 2] rad, from pixel to pixel along column and row. model: [n, m], the share c.
    slope: amplitude of the measured slope along the wave over the true one. height: that of the height.
    """

    k_per_mm: FloatArray
    turns: FloatArray = field(repr=False)
    footprint: FloatArray
    aperture: FloatArray
    diffraction: FloatArray
    display: FloatArray
    sharpening: FloatArray
    integration: FloatArray
    model: FloatArray
    slope: FloatArray
    height: FloatArray

    @property
    def aliased(self) -> BoolArray:
        """Whether a wave turns by more than pi from a pixel to the next, [n, m]: it shows as another one."""
        return np.asarray(np.abs(self.turns).max(-1) > np.pi)


@dataclass(frozen=True)
class TransferFunction:
    """Of a design's measure. fringes: highest number of periods over the screen; None for line scans. wavelength_nm: of
    the light; None without diffraction. lines_averaged: whether the sampling by lines counts as its mean over the
    light's places, which is 1: for a mirror whose light moves over more than a line."""

    setup: Setup = field(repr=False)
    name: str
    how: Measure
    fringes: float | None = None
    wavelength_nm: float | None = None
    lines_averaged: bool = False

    @classmethod
    def of(
        cls, scene: Scene | Setup, measure: str = "paper", fringes: float | None = None,
        wavelength_nm: float | None = None,
    ) -> TransferFunction:  # fmt: skip
        """measure: a name of methods.MEASURES, which fringes do without. Raises ValueError for what is not allowed."""
        setup = Setup.of(scene).nominal
        if wavelength_nm is not None and not 1 <= wavelength_nm <= 1e6:
            raise OptionError(f"--wavelength-nm = {wavelength_nm}: must be from 1 to 1e6")
        if fringes is None:
            return cls(setup, measure, check_measure(measure), None, wavelength_nm)
        if not 0 < fringes < 1e5:
            raise OptionError(f"--fringes = {fringes}: must be above 0 and below 100000 periods over the screen")
        return cls(setup, "fringes", FRINGES, fringes, wavelength_nm)

    def pixels(self, count: int = OVER_MIRROR) -> IntArray:
        """About so many whole pixels over the mirror, flat numbers; ValueError if there is none."""
        whole = np.flatnonzero(whole_pixels(self.setup))
        if not whole.size:
            raise ValueError(f"scene {self.setup.scene.name}: no detector pixel lies on the mirror as a whole")
        step = max(1, int(np.sqrt(whole.size / count)))
        rows, columns = np.divmod(whole, self.setup.chief_rays.shape[1])
        middle = rows[whole.size // 2]
        kept = whole[((rows - middle) % step == 0) & ((columns - columns[whole.size // 2]) % step == 0)]
        return np.asarray(kept, np.intp)

    def nearest(self, x_mm: float = 0.0, y_mm: float = 0.0) -> IntArray:
        """The whole pixel [1] whose mirror point is nearest to (x, y). ValueError if there is none."""
        footprint, whole = self.setup.chief_rays.footprint, whole_pixels(self.setup)
        if not whole.any():
            raise ValueError(f"scene {self.setup.scene.name}: no detector pixel lies on the mirror as a whole")
        distance = np.where(whole, np.hypot(footprint.x_mm - x_mm, footprint.y_mm - y_mm), np.inf)
        return np.array([np.argmin(distance)], np.intp)

    def geometry(self, number: IntArray) -> TransferGeometry:
        """Of pixels by their flat numbers."""
        return TransferGeometry.of(self.setup, number)

    def response(self, geometry: TransferGeometry, k_per_mm: FloatArray) -> Response:
        """The response of pixels to waves k [m, 2] in rad/mm."""
        k = np.asarray(k_per_mm, np.float64)
        turns = geometry.turns(k)
        on_aperture = np.einsum("nax,mx->nma", geometry.aperture, k)
        footprint, aperture = _over_pixel(turns / 2), _over_disk(on_aperture)
        diffraction = self.diffraction(turns, self.wavelength_nm)
        # the measured slopes over the true ones along k: each screen axis has its own factor
        by_place = self._by_place(geometry, turns / 2, on_aperture, footprint * aperture)  # [n, m, 2]
        size = np.linalg.norm(k, axis=-1)
        places = np.einsum("nux,mx->nmu", np.linalg.inv(geometry.slopes), k)
        slopes = np.einsum("nxu,nmu->nmx", geometry.slopes, by_place * places) * diffraction[..., None]
        sharpening = 1.0 if self.how.pixel_average else 1 + np.sum(1 - np.cos(turns), -1) / 12
        with np.errstate(invalid="ignore", divide="ignore"):
            along = np.einsum("nmx,mx->nm", slopes, k) / size**2
            display = along / (footprint * aperture * diffraction)
        rises = np.einsum("ndx,nmx->nmd", geometry.pixel, slopes) * np.asarray(sharpening)[..., None]
        slope = along * sharpening
        height = height_symbol(self.how.method, turns, rises)
        model = self._share(geometry, turns)
        with np.errstate(invalid="ignore", divide="ignore"):
            integration = height / slope
        return Response(
            k, turns, footprint, aperture, diffraction, display, np.broadcast_to(sharpening, slope.shape), integration,
            model, model + (1 - model) * slope, model + (1 - model) * height,
        )  # fmt: skip

    def _by_place(
        self, geometry: TransferGeometry, on_pixel: FloatArray, on_aperture: FloatArray, mean: FloatArray
    ) -> FloatArray:
        """Measured over true displacement [n, m, 2] of the places u, v on the screen."""
        if self.fringes is None:
            # measures other than plain centroids know the light's profile
            plain = self.how.light_curve == "centroid" and not self.lines_averaged
            gain = np.nan_to_num(geometry.line_gain, nan=1.0) if plain else np.ones((len(mean), 2))
            return np.asarray(mean[..., None] * gain[:, None])
        screen, found = self.setup.scene.screen, []
        for axis in range(2):
            wave = 2 * np.pi * self.fringes / (screen.pixels[axis] * screen.pitch_xy_mm[axis])
            turn = wave * geometry.light[:, axis]  # [n, 4]
            modulation = _over_pixel(turn[:, :2]) * _over_disk(turn[:, 2:])
            sides = [
                _over_pixel(on_pixel + sign * turn[:, None, :2]) * _over_disk(on_aperture + sign * turn[:, None, 2:])
                for sign in (1.0, -1.0)
            ]
            with np.errstate(invalid="ignore", divide="ignore"):
                found.append((sides[0] + sides[1]) / (2 * modulation[:, None]))
        return np.stack(found, -1)

    def diffraction(self, turns: FloatArray, wavelength_nm: float | None) -> FloatArray:
        """What diffraction at the camera's aperture leaves of waves by their turns [n, m, 2] from pixel to pixel."""
        if wavelength_nm is None:
            return np.ones(turns.shape[:-1])
        camera, pitch = self.setup.scene.camera, self.setup.chief_rays.camera_model.pitch_mm
        per_rad = np.linalg.norm(turns / (2 * np.pi) * (camera.image_distance_mm / np.array(pitch)), axis=-1)
        part = np.minimum(per_rad * wavelength_nm * 1e-6 / camera.aperture_diameter_mm, 1.0)
        return np.asarray(2 / np.pi * (np.arccos(part) - part * np.sqrt(1 - part**2)))

    def modulation(self, geometry: TransferGeometry) -> FloatArray:
        """Share [n, 2] of the fringes along u and v that the light of the pixels leaves; 1 for line scans."""
        screen = self.setup.scene.screen
        size = np.array(screen.pixels) * np.array(screen.pitch_xy_mm)
        turn = geometry.light * (2 * np.pi * (self.fringes or 0.0) / size)[:, None]
        return np.abs(_over_pixel(turn[..., :2]) * _over_disk(turn[..., 2:]))

    def _share(self, geometry: TransferGeometry, turns: FloatArray) -> FloatArray:
        """The model's share [n, m] of waves, of what they look like on the pixels' grid: its mean over the mirror."""
        if not self.how.rounds:
            return np.zeros(turns.shape[:-1])
        size, share = self._mean_share
        seen = np.linalg.norm(geometry.waves(wrapped(turns)), axis=-1)
        return np.asarray(np.interp(seen, size, share, right=0.0))

    @cached_property
    def _mean_share(self) -> tuple[FloatArray, FloatArray]:
        """The model's share by |k| in rad/mm, as the mean over the mirror and over directions."""
        setup = self.setup
        x, y = (v[setup.chief_rays.footprint.coverage >= 0.5] for v in design_points(setup)[:2])
        radius = setup.scene.mirror.diameter_mm / 2
        order = order_of_model(x.size)
        terms = zernikes(order, x / radius, y / radius)
        fit = smoothing_matrix(terms)
        size = np.linspace(0.0, 3.0 * order / radius, SHARE_STEPS)
        angle = np.arange(SHARE_ANGLES) * np.pi / SHARE_ANGLES
        k = np.multiply.outer(size, np.stack([np.cos(angle), np.sin(angle)], -1)).reshape(-1, 2)
        along = k @ np.stack([x, y])  # [steps x angles, samples]
        share = np.zeros(len(k))
        for wave in (np.cos(along), np.sin(along)):  # real matrices: far faster than complex or stacked ones
            share += np.sum((wave @ terms.T) * (wave @ fit.T), axis=1) / x.size
        return size, share.reshape(SHARE_STEPS, SHARE_ANGLES).mean(1)


def wrapped(turns: FloatArray) -> FloatArray:
    """Turns [...] rad as the pixels' grid shows them: from -pi to pi."""
    return np.asarray(turns - 2 * np.pi * np.rint(turns / (2 * np.pi)))


def _over_pixel(half_turns: FloatArray) -> FloatArray:
    """Mean of exp(i (p s + q t)) over a pixel, s and t from -1 to 1, of (p, q) [..., 2]."""
    return np.asarray(np.sinc(half_turns / np.pi).prod(-1))


def _over_disk(turns: FloatArray) -> FloatArray:
    """Mean of exp(i (p a + q b)) over the unit disk, of (p, q) [..., 2]."""
    radius = np.linalg.norm(turns, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(radius > 1e-6, 2 * j1(radius) / radius, 1 - radius**2 / 8))
