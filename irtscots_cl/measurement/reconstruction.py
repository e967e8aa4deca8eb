"""From images to the mirror's surface: light curves, centroids, slopes, height. It uses the design, never the truth."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.maths.integration import Islands, Misfit, integration_misfit, white_noise
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.measurement.centroids import jackknife_centroids
from irtscots_cl.measurement.light_curves import Flag, flag_curves
from irtscots_cl.measurement.light_profiles import profile_centroids
from irtscots_cl.measurement.line_positions import check_fits
from irtscots_cl.measurement.one_scan import ScanEstimate
from irtscots_cl.measurement.scan_estimates import estimate_centroids
from irtscots_cl.measurement.surface_heights import Pair, surface_of
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.shown import html_table, one_line

MIN_PIXELS = 4  # to separate piston, tilt and power
# "centroid": of all samples with light (paper, Eq. 4); "chord": that, corrected by the profile of the design;
# "windowed" and "likelihood": of signed samples, with noise and background (scan_estimates.py).
LIGHT_CURVES = ("centroid", "chord", "windowed", "likelihood")
SIGNED = ("windowed", "likelihood")


@dataclass(frozen=True)
class Reconstruction:
    """A measured surface on the detector's grid [rows, columns]; NaN outside the mask. Mirror frame.

    x_mm, y_mm: mirror points. on_mirror: pixels that see enough of the mirror, of those that may be
    used; mask: the used pixels among them.
    flags: light_curves.Flag, the worse of the two scans (pixels without a light curve: EMPTY). centroid_x_mm,
    centroid_y_mm: in the screen's frame. slope_x, slope_y [rad]: of the whole surface. height_mm: design plus
    deviation; deviation_mm: from the design, zero mean over every group of joined islands. light_curve, method,
    pixel_average: arguments of reconstruct. updates_nm: rms change of each round of refinement; converged: whether the
    last one was below refine's tolerance, None without refinement. jackknife_*: [replicates, rows, columns], the same
    maps with one replicate left out in turn, for error bars. estimates_of_scans: of the x and the y scan, for
    "windowed" and "likelihood": error bars of the centroids, gains of the frames, chi-square, ... islands: of the mask,
    and how their heights are joined; None if it is known to have only one. place_errors_mm: standard errors [rows,
    columns] of centroid_x_mm and centroid_y_mm, where these come from no scans.
    """

    setup: Setup = field(repr=False)
    light_curve: str
    method: str
    pixel_average: bool
    x_mm: FloatArray = field(repr=False)
    y_mm: FloatArray = field(repr=False)
    on_mirror: BoolArray = field(repr=False)
    mask: BoolArray = field(repr=False)
    flags: IntArray = field(repr=False)
    centroid_x_mm: FloatArray = field(repr=False)
    centroid_y_mm: FloatArray = field(repr=False)
    slope_x: FloatArray = field(repr=False)
    slope_y: FloatArray = field(repr=False)
    height_mm: FloatArray = field(repr=False)
    deviation_mm: FloatArray = field(repr=False)
    jackknife_slope_x: FloatArray = field(repr=False)
    jackknife_slope_y: FloatArray = field(repr=False)
    jackknife_deviation_mm: FloatArray = field(repr=False)
    updates_nm: tuple[float, ...] = ()
    estimates_of_scans: tuple[ScanEstimate, ScanEstimate] | None = field(default=None, repr=False)
    islands: Islands | None = field(default=None, repr=False)
    converged: bool | None = None
    place_errors_mm: Pair | None = field(default=None, repr=False)

    __repr__ = one_line
    _repr_html_ = html_table

    def summary(self) -> dict[str, str]:
        """Scene, pixels, and the deviation from the design without piston and tilt."""
        found, used = self.levelled(self.deviation_mm) * 1e6, self.height_mask
        return {
            "scene": self.nominal.name,
            "pixels used": f"{self.pixels_used} of {int(self.on_mirror.sum())} on the mirror",
            "light curve, method": f"{self.light_curve}, {self.method}",
            "deviation from the design": f"{rms(found, used):.4g} nm rms, {np.ptp(found[used]):.4g} nm PV",
        }

    def grid_mm(self) -> Pair:
        """Mirror points x, y [rows, columns] of all detector pixels, for plots: `pcolormesh(*result.grid_mm(), map)`.

        Those of x_mm, y_mm; where these are NaN, off the mask, they are continued by a parabola of row and column.
        """
        row, column = (n / max(n.shape) for n in np.indices(self.mask.shape))
        terms = np.stack([np.ones(row.shape), row, column, row * row, row * column, column * column], -1)
        return _continued(self.x_mm, terms), _continued(self.y_mm, terms)

    @property
    def nominal(self) -> Scene:
        """The design scene."""
        return self.setup.scene

    @property
    def pixels_used(self) -> int:
        return int(self.mask.sum())

    @property
    def height_mask(self) -> BoolArray:
        """The pixels of the largest group of joined islands: heights are known against each other there."""
        return self.mask if self.islands is None else self.islands.main

    @property
    def join(self) -> bool | Islands:
        """The argument join of integrate_slopes that joins the islands of other slopes in the same way."""
        return True if self.islands is None else self.islands

    def levelled(self, height_mm: FloatArray) -> FloatArray:
        """Heights [rows, columns] without tilt and without the piston of each group of joined islands."""
        groups = None if self.islands is None or self.islands.groups == 1 else self.islands.group_map
        return remove_terms(self.x_mm, self.y_mm, height_mm, self.mask, "piston_tilt", groups)

    def joining_errors_mm(self) -> FloatArray:
        """Maps [draws, rows, columns] of what the joining of islands may have wrong; none where nothing was joined."""
        return np.zeros((0, *self.mask.shape)) if self.islands is None else self.islands.joining_errors()

    def misfit(self, slope_noise: Pair | None = None, systematic: Pair | None = None) -> Misfit:
        """The part of the slopes that no surface has (maths.integration.misfit), beside that of their noise.

        slope_noise: standard errors of slope_x, slope_y [rows, columns] in rad; by default the replicates' scatter.
        systematic: predicted errors of them besides noise, as PredictedError.line_sampling.
        """
        own = self.setup.chief_rays.surface.gradient(self.x_mm, self.y_mm)
        extra_x, extra_y = self.slope_x - own[0], self.slope_y - own[1]
        noise = np.stack(slope_noise or [jackknife_error(self.estimates(f"slope_{axis}")) for axis in "xy"])
        noise_x, noise_y = noise if np.isfinite(noise[:, self.mask]).all() else (None, None)
        return integration_misfit(self.x_mm, self.y_mm, extra_x, extra_y, self.mask, noise_x, noise_y, systematic)

    def white_slope_noise(self) -> float:
        """Standard error [rad] of the slopes if white noise alone makes their misfit; NaN for a mask without a loop."""
        return white_noise(self.misfit(), self.x_mm, self.y_mm, self.mask)

    def light_traced(self) -> BoolArray:
        """Pixels [rows, columns] of the mask whose light has no closed form: traced rays replace it."""
        return self._of_light(~self.setup.pixel_light.closed_form & self.setup.pixel_light.valid())

    def without_model(self) -> BoolArray:
        """Pixels [rows, columns] of the mask whose light is not known at all: they keep the plain centroid."""
        return self._of_light(~self.setup.pixel_light.valid())

    def _of_light(self, chosen: BoolArray) -> BoolArray:
        on_grid = np.zeros(self.mask.size, bool)
        on_grid[self.setup.pixel_light.pixels[chosen]] = True
        found: BoolArray = on_grid.reshape(self.mask.shape) & self.mask
        return found

    def refused(self) -> dict[str, int]:
        """Number of pixels on the mirror with an unusable light curve, by the flag's name."""
        return {flag.name.lower(): int(np.sum(self.on_mirror & (self.flags == flag))) for flag in Flag if flag}

    def estimates(self, name: str) -> FloatArray:
        """ "slope_x", "slope_y" or "deviation_mm" [1 + replicates, rows, columns]: the result, then the jackknife's."""
        return np.concatenate([getattr(self, name)[None], getattr(self, f"jackknife_{name}")])

    def height_standard_error_mm(self) -> FloatArray:
        """Standard error [rows, columns] of the deviation without piston and tilt; NaN for a single replicate.

        It includes the stated errors of joined islands. NaN outside height_mask.
        """
        error = jackknife_error(self._without_tilt(self.estimates("deviation_mm")))
        joining = self.joining_errors_mm()
        return np.hypot(error, np.sqrt(np.mean(self._without_tilt(joining) ** 2, axis=0))) if len(joining) else error

    def _without_tilt(self, heights: FloatArray) -> FloatArray:
        """Heights [maps, rows, columns] without piston and tilt over height_mask."""
        return np.stack([remove_terms(self.x_mm, self.y_mm, h, self.height_mask, "piston_tilt") for h in heights])


def _continued(values: FloatArray, terms: FloatArray) -> FloatArray:
    """A map [rows, columns] whose NaN are those of the least-squares sum of terms [rows, columns, count]."""
    known = np.isfinite(values)
    weights = np.linalg.lstsq(terms[known], values[known], rcond=None)[0]
    return np.where(known, values, terms @ weights)


def reconstruct(
    stack: ImageStack,
    nominal: Scene | Setup,
    *,
    light_curve: str = "centroid",
    method: str = "southwell",
    pixel_average: bool = True,
    min_coverage: float = 0.5,
    threshold: float = 0.0,
    estimates: tuple[ScanEstimate, ScanEstimate] | None = None,
) -> Reconstruction:
    """Measure the surface from line-scan images and the design scene only.

    nominal: the scene without deviation (scene.nominal()), or a Setup of it. light_curve: "centroid" uses the light
    curves' centroids (paper, Eq. 4), "chord" corrects them by the profile from the design (light_profiles.py),
    "windowed" and "likelihood" use signed samples, with noise and background (scan_estimates.py); no threshold. method:
    of integrate_slopes. pixel_average: true to use the measured slopes, which are means over the pixels; false to
    convert them to the pixels' centres (slopes.deconvolve_pixel). min_coverage: smallest share of a pixel's footprint
    that must lie on the mirror. threshold: see light_curves.effective_screen_pixels. estimates: of this stack's scans.

    Raises ValueError if the stack does not match the scene or fewer than MIN_PIXELS pixels can be used or are joined.
    """
    if light_curve not in LIGHT_CURVES:
        raise ValueError(f"light_curve = {light_curve!r}: must be one of {', '.join(LIGHT_CURVES)}")
    setup = Setup.of(nominal)
    chief = setup.chief_rays
    check_fits(stack, chief)
    if estimates is None and light_curve in SIGNED:
        estimates = estimate_centroids(stack, setup, light_curve)
    centroid_x, centroid_y, flags = _both_scans(setup, stack, light_curve, threshold, estimates)
    on_mirror = (chief.footprint.coverage >= min_coverage) & (True if stack.use is None else stack.use)
    points = design_points(setup)
    mask = _usable(chief, on_mirror, flags, points)
    found = {"light_curve": light_curve, "flags": flags, "estimates_of_scans": estimates}
    return reconstruction_of(setup, points, on_mirror, mask, (centroid_x, centroid_y), method, pixel_average, **found)


def reconstruction_of(
    setup: Setup,
    points: list[FloatArray],
    on_mirror: BoolArray,
    mask: BoolArray,
    centroid: Pair,
    method: str,
    pixel_average: bool,
    **found: Any,
) -> Reconstruction:
    """The surface from centroids (u, v) [1 + replicates, rows, columns] in mm, of the pixels in the mask.

    points: of the design, as from design_points. found: other fields of the Reconstruction. Raises ValueError if fewer
    than MIN_PIXELS pixels have heights that are known against each other.
    """
    x_mm, y_mm, u_mm, v_mm = (np.where(mask, v, np.nan) for v in points)
    slope_x, slope_y, deviation, islands = surface_of(
        setup.chief_rays, (x_mm, y_mm), (u_mm, v_mm), mask, centroid, method, pixel_average, alike=True
    )
    joined = int(islands.main.sum())
    if joined < MIN_PIXELS:
        raise ValueError(
            f"scene {setup.scene.name}: the {mask.sum()} usable pixels lie in islands, of which the largest joined "
            f"group has {joined}; must be at least {MIN_PIXELS}"
        )
    return Reconstruction(
        setup=setup,
        method=method,
        pixel_average=pixel_average,
        x_mm=x_mm,
        y_mm=y_mm,
        on_mirror=on_mirror,
        mask=mask,
        centroid_x_mm=np.where(mask, centroid[0][0], np.nan),
        centroid_y_mm=np.where(mask, centroid[1][0], np.nan),
        slope_x=slope_x[0],
        slope_y=slope_y[0],
        height_mm=setup.chief_rays.surface.sag(x_mm, y_mm) + deviation[0],
        deviation_mm=deviation[0],
        jackknife_slope_x=slope_x[1:],
        jackknife_slope_y=slope_y[1:],
        jackknife_deviation_mm=deviation[1:],
        islands=islands,
        **found,
    )


def _usable(chief: ChiefRays, on_mirror: BoolArray, flags: IntArray, points: list[FloatArray]) -> BoolArray:
    """Pixels [rows, columns] that can be used. points: of the design, design_points; flags: worse where they say more.

    Raises ValueError if they are too few; the message counts the reasons.
    """
    # the design sends part of such a pixel's rays past the screen's front
    flags[(flags == Flag.GOOD) & on_mirror & ~np.isfinite(points).all(0)] = Flag.CLIPPED
    mask: BoolArray = on_mirror & (flags == Flag.GOOD)
    if mask.sum() < MIN_PIXELS:
        refused = ", ".join(f"{np.sum(flags[on_mirror] == flag)} {flag.name.lower()}" for flag in list(Flag)[1:])
        raise ValueError(
            f"scene {chief.scene.name}: {mask.sum()} of the {on_mirror.sum()} detector pixels on the mirror have a "
            f"usable light curve in both scans ({refused}); must be at least {MIN_PIXELS}{_too_wide(chief, on_mirror)}"
        )
    return mask


def _too_wide(chief: ChiefRays, on_mirror: BoolArray) -> str:
    """What a message says of light that is wider than the screen, so that no pixel sees a single point of it; or ""."""
    screen, light = chief.scene.screen, []
    for k in range(2):
        half_width, *boxes = chief.light_shape(k)
        width = (2 * half_width + sum(boxes))[on_mirror]
        light.append(float(np.nanmedian(width)) if np.isfinite(width).any() else 0.0)
    size = [n * p for n, p in zip(screen.pixels, screen.pitch_xy_mm, strict=True)]
    if all(width <= of_screen for width, of_screen in zip(light, size, strict=True)):
        return ""
    return (
        f"; a pixel sees {light[0]:.4g} x {light[1]:.4g} mm of the screen's plane at a time and the screen has "
        f"{size[0]:.4g} x {size[1]:.4g} mm: a larger screen, smaller detector pixels or a sharper focus"
    )


def _both_scans(
    setup: Setup,
    stack: ImageStack,
    light_curve: str,
    threshold: float,
    estimates: tuple[ScanEstimate, ScanEstimate] | None,
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Centroids of the x and the y scan [1 + replicates, rows, columns] in mm, and the worse of their flags."""
    if estimates:
        centroid_x, flag_x = _estimated(setup, estimates[0], light_curve)
        centroid_y, flag_y = _estimated(setup, estimates[1], light_curve)
    else:
        light = setup.pixel_light if light_curve == "chord" else None
        if light is not None:
            light.coverage()  # made once, before two threads ask for it, as are
        setup.chief_rays.light_shape(0)  # the chief rays
        with ThreadPoolExecutor(2) as pool:  # NumPy works on both scans at once
            measured = pool.map(lambda scan: _measured(setup, scan, light, threshold), (stack.x, stack.y))
            (centroid_x, flag_x), (centroid_y, flag_y) = measured
    flags = np.maximum(flag_x, flag_y)
    # if one replicate has all the light, leaving it out leaves none
    flags[(flags == Flag.GOOD) & ~np.isfinite(centroid_x + centroid_y).all(0)] = Flag.EMPTY
    return centroid_x, centroid_y, flags


def _measured(setup: Setup, scan: Scan, light: PixelLight | None, threshold: float) -> tuple[FloatArray, IntArray]:
    """Centroids [1 + replicates, rows, columns] in mm, NaN where there is none, and flags [rows, columns].

    light: whose profiles correct the centroids; None: they stay as they are.
    """
    found = jackknife_centroids(scan, threshold)
    on_grid = np.full((len(found), scan.shape[0] * scan.shape[1]), np.nan)
    if light is not None:  # one shift for all replicates: it varies by percents only
        found = found + (profile_centroids(scan, light, found[0], threshold) - found[0])
    on_grid[:, scan.pixels] = found
    half_width, box_row, box_column = setup.chief_rays.light_shape("xy".index(scan.axis))
    reach = (half_width + (box_row + box_column) / 2).ravel()[scan.pixels]
    flags = np.full(on_grid.shape[1], Flag.EMPTY)
    flags[scan.pixels] = flag_curves(scan, scan.mean_w(), on_grid[0, scan.pixels], reach)
    return on_grid.reshape(-1, *scan.shape), flags.reshape(scan.shape)


def _estimated(setup: Setup, estimate: ScanEstimate, light_curve: str) -> tuple[FloatArray, IntArray]:
    """As _measured, of a scan's estimate."""
    scan, found = estimate.scan, estimate.centroid_mm
    if light_curve == "windowed":
        found = found + (profile_centroids(scan, setup.pixel_light, found[0]) - found[0])
    on_grid = np.full((len(found), scan.shape[0] * scan.shape[1]), np.nan)
    on_grid[:, scan.pixels] = found
    flags = np.full(on_grid.shape[1], Flag.EMPTY)
    flags[scan.pixels] = estimate.flags
    return on_grid.reshape(-1, *scan.shape), flags.reshape(scan.shape)


def design_points(setup: Setup) -> list[FloatArray]:
    """Mirror point x, y and screen point u, v [rows, columns] in mm of each pixel's light, were the mirror the design.

    They come from the model of the light, or from the mean of the chief rays for pixels without one.
    """
    light, footprint = setup.pixel_light, setup.chief_rays.footprint
    points = [v.copy() for v in (footprint.x_mm, footprint.y_mm, footprint.u_mm, footprint.v_mm)]
    means = light.means("xyuv")
    use = light.valid() & np.isfinite(means).all(0)
    for on_grid, mean in zip(points, means, strict=True):
        on_grid.ravel()[light.pixels[use]] = mean[use]
    return points
