"""Whole images of a scene in closed form, and noise added to them: what a laboratory's camera would give."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scenes import coarse

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.tracing.trace import trace


@dataclass(frozen=True)
class Images:
    """x, y: images [lines, rows, columns] or [exposures, lines, rows, columns] of both scans; lines_x, lines_y:
    [lines] mm."""

    x: np.ndarray
    y: np.ndarray
    lines_x: np.ndarray
    lines_y: np.ndarray

    @property
    def peak(self) -> float:
        """The brightest sample of both scans."""
        return float(max(np.nanmax(self.x), np.nanmax(self.y)))

    def each(self, change) -> Images:
        """The same change of the images of both scans."""
        return replace(self, x=change(self.x), y=change(self.y))

    def noisy(self, share: float, seed: int, exposures: int | None = None) -> Images:
        """With white noise of `share` of the peak, independent in each exposure; None: one, without that axis."""
        random, peak = np.random.default_rng(seed), self.peak
        first = () if exposures is None else (exposures,)
        return self.each(lambda a: a + random.normal(0, share * peak, (*first, *a.shape)))

    def stack(self) -> ImageStack:
        """As irtscots_cl.imaging.image_files.read_images gives it."""
        return ImageStack(Scan.from_images("x", self.lines_x, self.x), Scan.from_images("y", self.lines_y, self.y))


def sparse_stack(scene: Scene) -> ImageStack:
    """The noise-free images of a scene as a simulation stores them: lit pixels, and of each the lines around it."""
    return trace(scene, estimator="analytic").images(LineScan(scene))


@lru_cache
def images_of(scene: Scene) -> Images:
    """The noise-free images of a scene. They are shared: change copies only."""
    stack = sparse_stack(scene)
    whole = [np.stack([scan.image(k) for k in range(len(scan.positions_mm))]) for scan in (stack.x, stack.y)]
    for images in whole:
        images.flags.writeable = False
    return Images(*whole, stack.x.positions_mm, stack.y.positions_mm)


@lru_cache
def setup_of(scene: Scene) -> Setup:
    """The design of a scene, with its closed forms made once."""
    return Setup(scene.nominal())


def small(pixels: int = 45) -> Scene:
    """sphere-deviated behind the same optics, on fewer and larger detector pixels."""
    return coarse("sphere-deviated", pixels)


def height_difference_nm(one, other) -> float:
    """rms over the common pixels of two results, piston and tilt removed."""
    mask = one.height_mask & other.height_mask
    differ = remove_terms(one.x_mm, one.y_mm, one.deviation_mm - other.deviation_mm, mask, "piston_tilt")
    return rms(differ, mask) * 1e6
