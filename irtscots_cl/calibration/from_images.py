"""Measurements for a calibration from line-scan images, or from maps of screen places in a file.

Pixels at the mirror's edge are left out: where the camera looks is not known well enough to say which part of them
lies on the mirror. Of large images every few pixels are used: the unknowns need no more, and their light takes time.
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.ndimage import binary_erosion

from irtscots_cl.calibration.measured import Measurement, from_maps
from irtscots_cl.imaging.image_files import read_images
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.measurement.line_positions import check_fits, with_all_lines
from irtscots_cl.measurement.methods import BEST
from irtscots_cl.measurement.one_scan import ScanEstimate
from irtscots_cl.measurement.quality import ERROR, OK, Check, check_images
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.measurement.saturation import find_ceiling
from irtscots_cl.measurement.scan_estimates import estimate_centroids
from irtscots_cl.optics.chief_rays import ChiefRays, trace_chief_rays
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene

MOST_PIXELS = 150_000  # whose light is estimated,
FEW_PIXELS = 2_000  # and for a first guess of the geometry
SAMPLES = 64  # along each axis, to count the pixels that see the mirror
EDGE = 2  # pixels beside the mirror's edge that are left out
LIT = 0.5  # of the median light
WHOLE = 0.999  # of a pixel's footprint that must lie on the mirror
FLOOR = 1e-4  # of a line's pitch: what the light's model leaves in places without noise
GEOMETRY_CHECKS = ("outline", "place x", "place y")  # what a calibration is there to mend
PLACES = [f"screen/{axis}{what}_mm" for what in ("", "_standard_error") for axis in "xy"]  # of pixels' centres


class ThinnedSetup(Setup):
    """A set-up of which the light of every step-th pixel in both directions is modelled; 1: of all."""

    def __init__(self, scene: Scene, step: int):
        super().__init__(scene)
        self.step = step

    @cached_property
    def chief_rays(self) -> ChiefRays:
        return ChiefRays(trace_chief_rays(self.scene).scene, every=self.step)

    @cached_property
    def chosen(self) -> IntArray:
        """Flat numbers of the pixels that can see the mirror, of every step-th row and column."""
        return np.flatnonzero(self.chief_rays.sees_mirror)

    @cached_property
    def pixel_light(self) -> PixelLight:
        return PixelLight.of(self.chief_rays, None if self.step == 1 else self.chosen)


def step_of(scene: Scene, most: int = MOST_PIXELS) -> int:
    """Every how many rows and columns a pixel of a scene's images is used, for about so many on the mirror at most."""
    chief = ChiefRays(scene)
    row, column = np.meshgrid(*(np.linspace(0, n - 1, min(n, SAMPLES)) for n in chief.shape), indexing="ij")
    points = chief.reverse(row, column)[0]
    with np.errstate(invalid="ignore"):
        share = float(np.mean(chief.surface.contains(points[..., 0], points[..., 1])))
    return max(math.ceil(math.sqrt(chief.shape[0] * chief.shape[1] * share / most)), 1)


def from_images(
    stack: ImageStack, scene: Scene, seen_as: Scene | None = None, most: int = MOST_PIXELS, **kind: Any
) -> tuple[Measurement, list[Check]]:
    """A measurement from line-scan images, and the checks of the images that concern a calibration.

    scene: geometry and mirror as believed. seen_as: a better guess of both, from which the pixels' light is modelled.
    most: of how many pixels the light is estimated, about. kind: turn_rad, knows_mirror, own, name of Measurement.
    Raises ValueError if the images do not fit the scene.
    """
    setup = _setup(scene, seen_as, most)
    return _measured(_usable(stack, setup), setup, scene, kind)


def _setup(scene: Scene, seen_as: Scene | None, most: int) -> ThinnedSetup:
    """The set-up from which the light is modelled."""
    return ThinnedSetup(seen_as or scene, step_of(scene, most))


def _usable(
    stack: ImageStack, setup: ThinnedSetup, saturation: float = math.inf, use: BoolArray | None = None
) -> ImageStack:
    """The part of the images that is looked at, with the value at which they are saturated."""
    stack = with_all_lines(stack, setup.scene)
    check_fits(stack, setup.chief_rays)
    if setup.step > 1:
        stack = stack.masked(setup.chief_rays.sees_mirror)
    stack = stack.saturating_at(min(find_ceiling(stack), stack.x.saturation_w, stack.y.saturation_w, saturation))
    return stack if use is None else stack.masked(use)


def _measured(
    stack: ImageStack, setup: ThinnedSetup, scene: Scene, kind: dict[str, Any]
) -> tuple[Measurement, list[Check]]:
    estimates = estimate_centroids(stack, setup, BEST)
    checks = _checks(stack, setup, estimates, setup.step)
    places, errors, flux = _maps(setup, estimates)
    x, y, u, v = design_points(setup)
    good = np.isfinite(np.stack([*places, *errors, x, y, u, v])).all(0) & (flux > 0)
    pixels = np.flatnonzero(good & _inside(setup, flux, setup.step))
    points, at_u, at_v = setup.chief_rays.reverse(*np.divmod(pixels, good.shape[1]))
    u, v, x, y = (values.ravel()[pixels] for values in (u, v, x, y))
    pitch = np.array(scene.screen.pitch_xy_mm)[:, None]
    measurement = Measurement(
        scene,
        pixels,
        places.reshape(2, -1)[:, pixels],
        np.hypot(errors.reshape(2, -1)[:, pixels], FLOOR * pitch),
        np.stack([u - at_u, v - at_v]),
        np.stack([x - points[:, 0], y - points[:, 1]]),
        every=setup.step,
        **kind,
    )
    return measurement, checks


def _checks(stack: ImageStack, setup: Setup, estimates: tuple[ScanEstimate, ScanEstimate], step: int) -> list[Check]:
    """The images' own checks without those that a calibration or the thinning answer. Raises ValueError for errors."""
    checks = [c for c in check_images(stack, setup, estimates) if c.name not in GEOMETRY_CHECKS]
    if step > 1:
        checks = [check for check in checks if check.name != "pixels"]
    bad = [f"{check.name}: {check.text}" for check in checks if check.level == ERROR]
    if bad:
        raise ValueError("; ".join(bad))
    return checks


def _maps(setup: Setup, estimates: tuple[ScanEstimate, ScanEstimate]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places and their errors [2, rows, columns], NaN where a light curve is not good; the light of both scans."""
    shape = setup.chief_rays.shape
    places, errors = np.full((2, 2, shape[0] * shape[1]), np.nan)
    flux = np.full((2, shape[0] * shape[1]), np.nan)
    for k, estimate in enumerate(estimates):
        good = estimate.flags == Flag.GOOD
        pixels = estimate.scan.pixels
        places[k, pixels] = np.where(good, estimate.centroid_mm[0], np.nan)
        errors[k, pixels] = np.where(good, estimate.error_mm, np.nan)
        flux[k, pixels] = estimate.flux
    return places.reshape(2, *shape), errors.reshape(2, *shape), np.nan_to_num(flux.min(0)).reshape(shape)


def _inside(setup: Setup, flux: FloatArray, step: int) -> BoolArray:
    """Pixels [rows, columns] whose footprint lies on the mirror as believed and as lit, with a margin at its edge."""
    every = (slice(step // 2, None, step),) * 2
    lit = flux[every] > LIT * np.median(flux[flux > 0]) if np.any(flux > 0) else np.zeros_like(flux[every], bool)
    size = 2 * math.ceil(EDGE / step) + 1
    inside = np.zeros(flux.shape, bool)
    inside[every] = binary_erosion(lit, np.ones((size, size), bool))
    found: BoolArray = inside & (setup.chief_rays.footprint.coverage >= WHOLE)
    return found


def from_file(
    path: Path,
    scene: Scene,
    seen_as: Scene | None = None,
    most: int = MOST_PIXELS,
    *,
    saturation: float = math.inf,
    use: BoolArray | None = None,
    **kind: Any,
) -> tuple[Measurement, list[Check]]:
    """A measurement from an HDF5 file: images, or places /screen/x_mm, y_mm with standard errors.

    saturation: value from which a sample is saturated. use: [rows, columns] upright pixels that may be used. seen_as,
    most, kind: as for from_images. Raises ValueError for a file that has neither, or does not fit the scene.
    """
    try:
        places = _places_of(path)
        if places is None:
            setup = _setup(scene, seen_as, most)
            stack = _usable(read_images(path, scene), setup, saturation, use)  # the others' memory is free again
            return _measured(stack, setup, scene, kind)
        places = [upright(values, scene.camera.detector.orientation) for values in places]
        if use is not None and use.shape == places[0].shape:
            places[0] = np.where(use, places[0], np.nan)
        found = from_maps(scene, *places, **kind)
    except ValueError as error:
        said = str(error)
        raise ValueError(said if said.startswith(str(path)) else f"{path}: {said}") from None
    return found, [Check("places", OK, float(len(found.pixels)), 0.0, 0.0, "screen places read from the file")]


def is_of_images(path: Path) -> bool:
    """Whether a file holds images, or is none that this program reads; False: places on the screen."""
    try:
        with h5py.File(path, "r") as file:
            return "images" in file or PLACES[0] not in file
    except OSError:
        return True


def _places_of(path: Path) -> list[FloatArray] | None:
    """Maps u, v and their errors [rows, columns] of a file without images; None for any other."""
    if is_of_images(path):
        return None  # read_images says what is wrong with the file
    with h5py.File(path, "r") as file:
        missing = [name for name in PLACES if not isinstance(file.get(name), h5py.Dataset)]
        if missing:
            raise ValueError(f"{path}: /{missing[0]}: missing; a calibration needs places with standard errors")
        return [np.asarray(file[name][()], float) for name in PLACES]
