"""Image stacks: camera images recorded while the screen shows the lines of a scan one by one. Flux in W.

Only a few adjacent lines light a detector pixel, so a scan is stored as one short light curve per pixel. Whole images
are made from the curves on demand. Replicates (independent repeats of a simulation, or exposures in a lab) are stored
separately for error bars.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from irtscots_cl.imaging.bad_values import check_values
from irtscots_cl.maths.arrays import BoolArray, FloatArray, IntArray
from irtscots_cl.maths.statistics import jackknife_error
from irtscots_cl.system.shown import html_table, one_line


@dataclass(frozen=True)
class Scan:
    """Line images of one scan direction ("x": columns of screen pixels, "y": rows). n: pixels with a light curve.

    positions_mm: [lines] the line centres in the screen's own x (or y). shape: detector (rows, columns).
    pixels: [n] flat pixel numbers row * columns + column. first_line: [n] the light curves' first line.
    flux_w: [replicates, n, window] flux; outside its window a pixel is dark. weights: [replicates] share of each
    replicate in the mean (rays, exposures). hits: [n] number of independent random rays in a whole light curve; NaN
    for other samplers and lab images. saturation_w: flux at which the camera's pixels saturate; infinite for a
    simulation without a detector's limits. unit: of the flux and of saturation_w; "DN" of a recorded scan. line_width:
    of a line over the lines' distance.
    """

    axis: str
    positions_mm: FloatArray
    shape: tuple[int, int]
    pixels: IntArray
    first_line: IntArray
    flux_w: FloatArray = field(repr=False)
    weights: FloatArray
    hits: FloatArray = field(repr=False)
    saturation_w: float = math.inf
    unit: str = "W"
    line_width: float = 1.0

    __repr__ = one_line
    _repr_html_ = html_table

    def summary(self) -> dict[str, str]:
        """Lines, pixels, replicates and unit."""
        rows, columns = self.shape
        return {
            "axis": self.axis,
            "lines": f"{len(self.positions_mm)} from {self.positions_mm[0]:.4g} to {self.positions_mm[-1]:.4g} mm",
            "detector": f"{rows} x {columns} (rows x columns), {len(self.pixels)} with a light curve",
            "replicates": str(len(self.weights)),
            "unit": self.unit,
        }

    @property
    def lines(self) -> IntArray:
        """Line numbers [n, window] of the light curves' samples."""
        return self.first_line[:, None] + np.arange(self.flux_w.shape[-1])

    def part(self, chosen: slice | BoolArray | IntArray) -> Scan:
        """The scan of some of its light curves."""
        return replace(
            self,
            pixels=self.pixels[chosen],
            first_line=self.first_line[chosen],
            flux_w=self.flux_w[:, chosen],
            hits=self.hits[chosen],
        )

    def of_all_lines(self) -> Scan:
        """The same scan with whole light curves, all lines of every pixel [replicates, rows * columns, lines]."""
        count, pixels = len(self.positions_mm), self.shape[0] * self.shape[1]
        if self.flux_w.shape[1:] == (pixels, count) and not self.first_line.any():
            return self
        flux, hits = np.zeros((len(self.weights), pixels, count)), np.full(pixels, np.nan)
        inside = self.lines < count
        pixel = np.broadcast_to(self.pixels[:, None], inside.shape)[inside]
        flux[:, pixel, self.lines[inside]] = self.flux_w[:, inside]
        hits[self.pixels] = self.hits
        first = np.zeros(pixels, np.int64)
        return replace(self, pixels=np.arange(pixels), first_line=first, flux_w=flux, hits=hits)

    def mean_w(self) -> FloatArray:
        """Light curves [n, window], the mean over the replicates."""
        return np.tensordot(self.weights / self.weights.sum(), self.flux_w, 1)

    def jackknife_w(self) -> FloatArray:
        """Light curves [1 + replicates, n, window]: the mean, then the means with one replicate left out in turn.

        A single replicate gives only the mean.
        """
        replicates = len(self.weights)
        if replicates == 1:
            return self.flux_w.copy()
        weighted = self.flux_w * self.weights[:, None, None]
        total = weighted.sum(0)
        left = (total - weighted) / (self.weights.sum() - self.weights)[:, None, None]
        # a sample that is dark in all other replicates is exactly 0, without rounding errors of total - weighted
        left[(left < 0) & (left > -1e-12 * total)] = 0.0
        return np.concatenate([total[None] / self.weights.sum(), left])

    def standard_error_w(self) -> FloatArray:
        """Standard error [n, window] of mean_w() from the scatter of the replicates; NaN for a single one."""
        return jackknife_error(self.jackknife_w())

    def image(self, line: int, values: FloatArray | None = None) -> FloatArray:
        """Camera image [rows, columns] under one line: of mean_w(), or of other values [n, window]."""
        values = self.mean_w() if values is None else values
        offset = line - self.first_line
        lit = (offset >= 0) & (offset < values.shape[1])
        image = np.zeros(self.shape[0] * self.shape[1])
        image[self.pixels[lit]] = values[lit, offset[lit]]
        return image.reshape(self.shape)

    def replicate(self, number: int) -> Scan:
        """The scan of one replicate. Its hits are its share of all hits."""
        share = self.weights[number] / self.weights.sum()
        one = slice(number, number + 1)
        return replace(self, flux_w=self.flux_w[one], weights=self.weights[one], hits=self.hits * share)

    @classmethod
    def from_images(cls, axis: str, positions_mm: FloatArray, images_w: FloatArray, line_width: float = 1.0) -> Scan:
        """A scan from whole images [lines, rows, columns] or [exposures, lines, rows, columns], upright.

        A value that is not a number (NaN) marks a sample as missing. Raises ValueError for other shapes, for positions
        that do not match or increase, or for infinite values.
        """
        check_shapes(axis, np.shape(positions_mm), np.shape(images_w))
        images = np.asarray(images_w, float)
        positions = np.asarray(positions_mm, float)
        check_values(f"images/{axis}", images, nan_allowed=True)
        check_values(f"lines/{axis}_mm", positions)
        images = images[None] if images.ndim == 3 else images
        falls = np.flatnonzero(np.diff(positions) <= 0)
        if falls.size:
            pair = f"{positions[falls[0]]:g} then {positions[falls[0] + 1]:g}"
            all_fall = (np.diff(positions) < 0).all()
            cause = "; all fall: reverse the order of the lines and of their images" if all_fall else ""
            raise ValueError(
                f"the line positions of the {axis} scan must grow from line to line: lines/{axis}_mm has {pair} at "
                f"lines {falls[0]} and {falls[0] + 1}, counted from 0{cause}"
            )
        count = images.shape[2] * images.shape[3]
        return cls(
            axis,
            positions,
            images.shape[2:],
            np.arange(count),
            np.zeros(count, np.int64),
            images.reshape(*images.shape[:2], count).transpose(0, 2, 1),
            np.ones(len(images)),
            np.full(count, np.nan),
            line_width=line_width,
        )


def check_shapes(axis: str, positions: tuple[int, ...], images: tuple[int, ...]) -> None:
    """Raise ValueError for shapes that Scan.from_images cannot use."""
    if len(images) not in (3, 4) or 0 in images:
        raise ValueError(
            f"images of the {axis} scan have shape {images}; "
            "must be [lines, rows, columns] or [exposures, lines, rows, columns]"
        )
    if positions != images[-3:-2]:
        raise ValueError(f"the {axis} scan has {images[-3]} images but line positions of shape {positions}")


@dataclass(frozen=True)
class ImageStack:
    """The two scans of a measurement. use: [rows, columns] detector pixels that may be used; None: all."""

    x: Scan
    y: Scan
    use: BoolArray | None = field(default=None, repr=False)

    __repr__ = one_line
    _repr_html_ = html_table

    def summary(self) -> dict[str, str]:
        """Detector, and both scans."""
        rows, columns = self.x.shape
        return {
            "detector": f"{rows} x {columns} (rows x columns)",
            **{
                f"{scan.axis} scan": f"{len(scan.positions_mm)} lines, {len(scan.pixels)} pixels with a light curve, "
                f"{len(scan.weights)} replicates, {scan.unit}"
                for scan in (self.x, self.y)
            },
        }

    def replicate(self, number: int) -> ImageStack:
        """The images of one replicate."""
        return replace(self, x=self.x.replicate(number), y=self.y.replicate(number))

    def masked(self, use: BoolArray) -> ImageStack:
        """The images of the pixels [rows, columns] that are to be used alone.

        Raises ValueError for a mask of another shape.
        """
        if use.shape != self.x.shape:
            raise ValueError(f"a mask of {use.shape} (rows, columns) does not fit images of {self.x.shape}")
        x, y = (scan.part(use.ravel()[scan.pixels]) for scan in (self.x, self.y))
        return ImageStack(x, y, use if self.use is None else use & self.use)

    def saturating_at(self, saturation_w: float) -> ImageStack:
        """The same images, for a camera whose pixels saturate at saturation_w, in the images' own unit.

        Raises ValueError for a value that is not positive.
        """
        if not saturation_w > 0:
            raise ValueError(f"--saturation = {saturation_w}: must be above 0")
        x, y = (replace(scan, saturation_w=saturation_w) for scan in (self.x, self.y))
        return replace(self, x=x, y=y)
