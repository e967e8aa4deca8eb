"""From errors of places to nm of height: the measurement's own propagation, once, and then by ratio.

The errors of pixels are independent, so that the mean square of the heights is a weighted sum of their squares. The
weights of pixels differ mostly by what a place does to the slope there; their common factor is that of a reference with
nearly the same distribution over the mirror, which goes through triangulation and integration.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.low_order import rms
from irtscots_cl.measurement.error_bars import error_bars, slope_derivatives
from irtscots_cl.measurement.pattern_design.pixels import COVERAGE, SeenPixels
from irtscots_cl.measurement.reconstruction import Reconstruction, design_points
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.optics.setup import Setup

METHOD = "cubic"  # of integration, as of real fringes
MOST_PIXELS = 16_000  # on the mirror, of the reference: more are joined
NM = 1e6


@dataclass(frozen=True)
class HeightNoise:
    """weight: [2, n] of the squared errors of places along x and y, nm^2 per mm^2; reference: the design's surface."""

    weight: FloatArray = field(repr=False)
    reference: Reconstruction = field(repr=False)

    def nm(self, errors_mm: FloatArray) -> float:
        """Rms height error, piston and tilt removed, of places with these errors [2, n]; infinite where one is.

        Pixels without a place are left out of a measurement: up to a hundredth of them are left out here as well.
        """
        return float(np.sqrt(sum(self.squares(errors_mm))))

    def squares(self, errors_mm: FloatArray) -> tuple[float, float]:
        """Mean squares in nm^2 of the errors along x and along y."""
        known = np.isfinite(errors_mm).all(0)
        if known.mean() < 0.99:
            return np.inf, np.inf
        whole = self.weight.sum(1) / self.weight[:, known].sum(1)
        x, y = (self.weight[:, known] * errors_mm[:, known] ** 2).sum(1) * whole
        return float(x), float(y)


def height_noise(setup: Setup, seen: SeenPixels, errors_mm: FloatArray) -> HeightNoise:
    """The weights, from a reference with the errors [2, n] of the sampled pixels.

    setup: of the design.
    """
    joined, times = _joined(setup, seen)
    points = design_points(joined)
    chief = joined.chief_rays
    seen_points = _mirror_points(setup, seen)
    near = cKDTree(seen_points.T)
    on_mirror = (chief.footprint.coverage >= COVERAGE) & np.isfinite(points).all(0)
    # a joined pixel has the light, and the independent errors, of `times` squared pixels
    maps = np.full((2, *on_mirror.shape), np.nan)
    nearest = near.query(np.stack([points[0][on_mirror], points[1][on_mirror]], -1))[1]
    known = np.isfinite(errors_mm)
    finite = np.where(known, errors_mm, np.median(errors_mm[known]))
    maps[:, on_mirror] = finite[:, nearest] / times
    result = surface_from_places(
        ScreenPlaces(points[2], points[3], maps[0], maps[1]), joined, method=METHOD, pixel_average=False,
        min_coverage=COVERAGE,
    )  # fmt: skip
    bars = error_bars(result)
    assert bars is not None
    (x_by_u, y_by_u), (x_by_v, y_by_v) = slope_derivatives(result)
    own = np.stack([x_by_u**2 + y_by_u**2, x_by_v**2 + y_by_v**2])
    inside = result.mask
    tree = cKDTree(np.stack([result.x_mm[inside], result.y_mm[inside]], -1))
    weight = own[:, inside][:, tree.query(seen_points.T)[1]]
    square = (rms(bars.height_mm, result.height_mask) * NM) ** 2
    return HeightNoise(weight * square / (weight * finite**2).sum(), result)


def _mirror_points(setup: Setup, seen: SeenPixels) -> FloatArray:
    """Mirror points [2, n] of the sampled pixels, by their chief rays."""
    footprint = setup.chief_rays.footprint
    return np.stack([footprint.x_mm.ravel()[seen.pixels], footprint.y_mm.ravel()[seen.pixels]])


def _joined(setup: Setup, seen: SeenPixels) -> tuple[Setup, int]:
    """A set-up of at most MOST_PIXELS on the mirror, and how many pixels of a side were joined for it."""
    times = int(np.ceil(np.sqrt(np.count_nonzero(seen.usable) / MOST_PIXELS)))
    scene = setup.scene
    if times <= 1 or scene.camera.intrinsics is not None:  # those are in pixels
        return setup, 1
    detector = scene.camera.detector
    columns, rows = (max(n // times, 1) for n in detector.pixels)
    detector = replace(detector, pixels=(columns, rows), pitch_mm=detector.pitch_mm * times, noise=None)
    return Setup(replace(scene, camera=replace(scene.camera, detector=detector))), times
